"""Runs a case with libcosim's fixed-step algorithm: all FMUs step, then the connected values are passed on."""

from libcosimpy.CosimConstants import success
from libcosimpy.CosimEnums import CosimErrorCode, CosimExecutionState
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
from runner import main


def simulate(case):
    nanoseconds = case["step"] * 1e9
    assert nanoseconds == int(nanoseconds)  # libcosim's clock
    if "ssp" in case:
        execution = CosimExecution.from_ssp_file(case["ssp"], int(nanoseconds))
        slaves = {name: execution.slave_index_from_instance_name(name) for name in case["outputs"]}
    else:
        execution = CosimExecution.from_step_size(int(nanoseconds))
        slaves = {
            name: execution.add_local_slave(CosimLocalSlave(fmu_path=path, instance_name=name))
            for name, path in case["fmus"].items()
        }
    references = {
        name: {v.name.decode(): v.reference for v in execution.slave_variables(slave)} for name, slave in slaves.items()
    }
    for source, here, target, there in case["connections"]:
        assert (
            execution.connect_real_variables(
                slaves[source], references[source][here], slaves[target], references[target][there]
            )
            == success
        )
    observer, override = CosimObserver.create_last_value(), CosimManipulator.create_override()
    assert execution.add_observer(observer) and execution.add_manipulator(override)
    rows = {name: [] for name in case["outputs"]}
    for k in range(case["steps"]):
        for name, inputs in case["inputs"].items():
            assert override.slave_real_values(
                slaves[name], [references[name][v] for v in inputs], [values[k] for values in inputs.values()]
            )
        assert execution.step()
        for name, outputs in case["outputs"].items():
            rows[name].append(observer.last_real_values(slaves[name], [references[name][v] for v in outputs]))
    status = execution.status()
    assert status.state == CosimExecutionState.STOPPED.value and status.error_code == CosimErrorCode.SUCCESS.value
    return rows


main(simulate)
