"""A tie with driven masters as its host sees it, loads from motions: by the solver in this process, or by the FMU.

Freedoms are the masters' translations, three each, then the rotations of those that turn.
"""

import ctypes
import tempfile

import numpy as np

from .. import package
from .._core import Diverged, SceneError
from ..scene import MOTIONS, Scene


class Names:
    """FMU names of what the host sets and reads; masters in the order of their numbers."""

    def __init__(self, scene: Scene):
        found: dict[tuple[str, str], dict[int, list[str]]] = {}  # names of the components by number
        for k, block in enumerate(scene.start.variables):
            names, size = scene.start.variable_names(k), block["components"]
            own = found.setdefault((block["name"], block["causality"]), {})
            own |= {number: names[size * n : size * (n + 1)] for n, number in enumerate(block["numbers"].tolist())}

        def names_of(name: str, causality: str, numbers: list[int]) -> list[str]:
            own = found.get((name, causality), {})
            return [component for number in numbers for component in own.get(number, [])]

        self.driven = sorted(found.get(("master.v", "input"), {}))
        self.turning = sorted(found.get(("master.w", "input"), {}))
        if not self.driven:
            raise SceneError(f"{scene.file}: no tied master is driven, so there is nothing for a host to move")
        self.velocity = names_of("master.v", "input", self.driven) + names_of("master.w", "input", self.turning)
        self.acceleration = names_of("master.a", "input", self.driven) + names_of("master.z", "input", self.turning)
        self.position = names_of("master.r", "input", self.driven)
        self.inputs = self.velocity + self.acceleration + self.position
        self.load = names_of("master.f", "output", self.driven) + names_of("master.t", "output", self.turning)
        # freedom of each entry of `load`: a turning node without a moment output gets none
        answering = found.get(("master.t", "output"), {})
        self.loaded = np.array(
            list(range(3 * len(self.driven)))
            + [3 * len(self.driven) + 3 * n + k for n, i in enumerate(self.turning) if i in answering for k in range(3)]
        )
        self.slaves = sorted(found["slave.v", "output"])
        self.slave_velocity = names_of("slave.v", "output", self.slaves)
        self.slave_force = names_of("slave.f", "input", self.slaves)
        self.freedoms = len(self.velocity)


class Tie:
    """The tie as its host sees it: loads from motions. `start`: positions of the driven masters, flat, m; `own`,
    `added`: the masters' own and the lumped inertia per freedom (kg, kg m2)."""

    def __init__(self, scene: Scene):
        self.names = Names(scene)
        found = scene.model.report()
        nodes = found["nodes"]
        master = nodes["master"].astype(bool)
        row = {int(number): i for i, number in enumerate(nodes["number"]) if master[i]}
        driven, turning = [row[i] for i in self.names.driven], [row[i] for i in self.names.turning]
        self.rows = driven + [len(nodes["id"]) + i for i in turning]  # of held_acceleration
        self.start = nodes["position"][driven].ravel()
        self.own = np.repeat(np.concatenate([nodes["mass"][driven], nodes["inertia"][turning]]), 3)
        self.node_ids = nodes["id"][driven]
        added_mass, added_inertia = scene.start.get("added_mass"), np.zeros(len(nodes["id"]))
        if "added_inertia" in scene.start.fields:
            added_inertia[: nodes["rotating"]] = scene.start.get("added_inertia")
        self.added = np.repeat(np.concatenate([added_mass[driven], added_inertia[turning]]), 3)
        self.accelerated, self.positioned = bool(self.names.acceleration), bool(self.names.position)
        self.inputs = np.zeros(len(self.names.inputs))
        self.leads = "acceleration_change" in scene.start.fields
        # Do loads of small motions depend on more than the inputs of now: on springs at offsets, on free nodes?
        offsets = (found["slaves"]["coupling"] != found["couplings"].index("translation")).any()
        free = (nodes["motion"] == MOTIONS.index("free")).any()
        self.keeps_state = self.leads or bool(found["springs"] and (offsets or free))

    def restart(self) -> None:
        """Back to time 0."""
        raise NotImplementedError

    def remember(self, held: np.ndarray, change: np.ndarray) -> None:
        """As after two steps: accelerations of the last one, and what they are more than in the one before."""
        raise NotImplementedError

    def set_inputs(self) -> None:
        raise NotImplementedError

    def loads_now(self) -> np.ndarray:
        raise NotImplementedError

    def step(self, time: float, size: float) -> None:
        raise NotImplementedError

    def carry(self, velocity, time: float, size: float):
        """One step of the tie. velocity: mean of the step, with which the tie turns its offsets; the velocity at either
        end would make that, and every load on an offset, of first order."""
        self.inputs[: len(velocity)] = velocity
        self.set_inputs()
        self.step(time, size)

    def move(self, displacement, velocity, acceleration) -> np.ndarray:
        """Sets the masters' motion (freedoms,); returns the loads that the tie answers with (freedoms,), N and N m."""
        n = len(velocity)
        self.inputs[:n] = velocity
        if self.accelerated:
            self.inputs[n : 2 * n] = acceleration
        if self.positioned:
            self.inputs[-len(self.start) :] = self.start + displacement[: len(self.start)]
        load = np.zeros(n)
        self.set_inputs()
        load[self.names.loaded] = self.loads_now()
        return load

    def derivatives(self) -> np.ndarray:
        """Of the loads by the accelerations, (freedoms, freedoms), at rest: kg, kg m, kg m2. Differences are exact but
        for rounding, as loads are affine in accelerations; an importer asks fmi2GetDirectionalDerivative."""
        n = self.names.freedoms
        rest = np.zeros(n)
        still = self.move(rest, rest, rest)
        return np.array([self.move(rest, rest, one) - still for one in np.eye(n)]).T


class InProcess(Tie):
    """By the solver in this process."""

    def __init__(self, scene: Scene):
        super().__init__(scene)
        self.simulation = scene.simulation()
        self.simulation.initialise(0.0)

    def restart(self):
        """Back to time 0."""
        self.simulation.reset()
        self.simulation.initialise(0.0)

    def remember(self, held, change):
        for field, values in (("held_acceleration", held), ("acceleration_change", change)):
            rows = self.simulation.get(field).reshape(-1, 3)
            rows[self.rows] = values.reshape(-1, 3)
            self.simulation.set(field, rows)

    def set_inputs(self):
        self.simulation.set_values(self.names.inputs, self.inputs)

    def loads_now(self):
        return self.simulation.get_values(self.names.load)

    def push(self, forces):
        self.simulation.set_values(self.names.slave_force, forces)

    def slave_velocity(self):
        return self.simulation.get_values(self.names.slave_velocity)

    def step(self, time, size):
        self.simulation.step(size)


class Packaged(Tie):
    """By the packaged FMU under FMPy. Its calls take arrays made once, because FMPy's own conversions cost more than
    the FMU does. Use as a context manager."""

    def __init__(self, scene: Scene):
        super().__init__(scene)
        import fmpy  # here, because importing it takes half a second
        import fmpy.fmi2

        self.failed = fmpy.fmi1.FMICallException
        self.folder = tempfile.TemporaryDirectory(prefix="tiefmu-")
        path = package.build(scene, f"{self.folder.name}/scene.fmu")
        description = fmpy.read_model_description(str(path), validate=False)
        fmpy.extract(str(path), self.folder.name)
        self.fmu = fmpy.fmi2.FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.folder.name,
            instanceName="tie",
            modelIdentifier=description.coSimulation.modelIdentifier,
        )
        self.reference = reference = {v.name: v.valueReference for v in description.modelVariables}

        def block(names, values):
            """Arguments of fmi2SetReal and fmi2GetReal after the instance."""
            return (
                (ctypes.c_uint32 * len(names))(*(reference[n] for n in names)),
                len(names),
                values.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
            )

        self.loads = np.zeros(len(self.names.load))
        self.forces, self.slave = np.zeros((2, len(self.names.slave_force)))
        self.calls = {
            "inputs": block(self.names.inputs, self.inputs),
            "loads": block(self.names.load, self.loads),
            "forces": block(self.names.slave_force, self.forces),
            "slave": block(self.names.slave_velocity, self.slave),
        }
        self.fmu.instantiate()
        self.restart(reset=False)

    def derivatives(self):
        """At rest, a call of fmi2GetDirectionalDerivative a column."""
        n = self.names.freedoms
        self.move(*np.zeros((3, n)))
        known = [self.reference[name] for name in self.names.acceleration]
        unknown = [self.reference[name] for name in self.names.load]
        found = np.zeros((n, n))
        for column, one in enumerate(known):
            found[self.names.loaded, column] = self.fmu.getDirectionalDerivative(unknown, [one], [1.0])
        return found

    def restart(self, reset=True):
        """Back to time 0."""
        if reset:
            self.fmu.reset()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def __enter__(self):
        return self

    def __exit__(self, *reason):
        self.fmu.freeInstance()
        self.folder.cleanup()

    def set_inputs(self):
        self.fmu.fmi2SetReal(self.fmu.component, *self.calls["inputs"])

    def loads_now(self):
        self.fmu.fmi2GetReal(self.fmu.component, *self.calls["loads"])
        return self.loads

    def push(self, forces):
        self.forces[:] = forces
        self.fmu.fmi2SetReal(self.fmu.component, *self.calls["forces"])

    def slave_velocity(self):
        self.fmu.fmi2GetReal(self.fmu.component, *self.calls["slave"])
        return self.slave.copy()

    def step(self, time, size):
        try:
            self.fmu.fmi2DoStep(self.fmu.component, time, size, 1)
        except self.failed as error:
            raise Diverged(f"the FMU stopped at t = {time:g} s") from error
