"""Runs a case with fmuloader: all FMUs step, then the connected values are passed on."""

import xml.etree.ElementTree as xml
import zipfile

from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
from runner import main


def simulate(case):
    slaves, references = {}, {}
    for name, path in case["fmus"].items():
        with zipfile.ZipFile(path) as archive:
            description = xml.fromstring(archive.read("modelDescription.xml"))
        references[name] = {v.get("name"): int(v.get("valueReference")) for v in description.iter("ScalarVariable")}
        slave = Fmi2Slave(path, model_identifier=description.find("CoSimulation").get("modelIdentifier"))
        slave.instantiate(name, Fmi2Type.CO_SIMULATION, guid=description.get("guid"))
        slaves[name] = slave
    for slave in slaves.values():
        slave.setup_experiment(start_time=0.0)
        slave.enter_initialization_mode()

    def exchange():
        passed = [
            (target, references[target][there], slaves[source].get_real([references[source][here]])[0])
            for source, here, target, there in case["connections"]
        ]
        for target, reference, value in passed:
            slaves[target].set_real([reference], [value])

    exchange()
    for slave in slaves.values():
        slave.exit_initialization_mode()
    rows = {name: [] for name in case["outputs"]}
    for k in range(case["steps"]):
        for name, inputs in case["inputs"].items():
            slaves[name].set_real([references[name][v] for v in inputs], [values[k] for values in inputs.values()])
        for slave in slaves.values():
            slave.do_step(k * case["step"], case["step"])
        for name, outputs in case["outputs"].items():
            rows[name].append(list(slaves[name].get_real([references[name][v] for v in outputs])))
        exchange()
    for slave in slaves.values():
        slave.terminate()
        slave.free_instance()
    return rows


main(simulate)
