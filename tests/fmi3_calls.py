"""An FMI 3.0 FMU seen through its C functions: every call gives back the bare status, every log message is kept."""

import ctypes
import tempfile
import zipfile
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_int64, c_size_t, c_uint32, c_void_p
from pathlib import Path

import fmpy
import numpy as np
from fmu_calls import build_without_references
from tiefmu.fmi3_variables import elements
from tiefmu.platforms import here


def functions() -> set[str]:
    """Of the standard, by its header."""
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text()
    return {line.split("FullName(")[1].split(")")[0] for line in header.splitlines() if "FullName(fmi3" in line}


OK, WARNING, DISCARD, ERROR, FATAL = range(5)
LogMessage = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
Update = ctypes.CFUNCTYPE(
    None, c_void_p, c_double, c_bool, c_bool, c_bool, c_bool, ctypes.POINTER(c_bool), ctypes.POINTER(c_double)
)


class Fmu:
    """A scene built with fmi=3, without reference results, and unpacked into a new folder in `folder`. arrays: FMPy's
    variables by name; elements: by the names that FMI 2.0 has for them."""

    def __init__(self, scene, folder: Path):
        self.folder = Path(tempfile.mkdtemp(dir=folder))
        self.path = build_without_references(scene, self.folder / "scene.fmu", fmi=3)
        with zipfile.ZipFile(self.path) as archive:
            archive.extractall(self.folder)
        self.description = fmpy.read_model_description(str(self.path), validate=True)
        self.arrays = {v.name: v for v in self.description.modelVariables}
        self.elements = elements(self.description, (self.folder / "modelDescription.xml").read_bytes())
        identifier = self.description.coSimulation.modelIdentifier
        self.library = ctypes.CDLL(str(self.folder / "binaries" / here().folder_of(3) / (identifier + here().suffix)))
        self.library.fmi3InstantiateCoSimulation.restype = c_void_p
        self.library.fmi3GetVersion.restype = c_char_p
        self.library.fmi3FreeInstance.restype = None

    def names(self, causality: str) -> list[str]:
        return [v.name for v in self.description.modelVariables if v.causality == causality]

    def size(self, name: str) -> int:
        return int(np.prod(self.arrays[name].shape or ()))


class Instance:
    """log: (status, category, message). update: called in the middle of steps with time and early return allowed;
    what it returns, if anything, is the time to end the step at."""

    def __init__(
        self, fmu: Fmu, name="tie", token=None, path=None, logging=False, update=None, early=False, events=False
    ):
        self.fmu, self.log = fmu, []
        self.logger = LogMessage(
            lambda _, status, category, text: self.log.append((status, category.decode(), text.decode()))
        )

        def asked(_, time, set_requested, get_allowed, finished, can_return, early_return, until):
            assert set_requested and get_allowed and finished
            found = update(self, time, can_return)
            if found is not None:
                early_return[0], until[0] = True, found

        self.update = Update(asked) if update else Update()
        path = str(fmu.folder / "resources") + "/" if path is None else path
        self.component = fmu.library.fmi3InstantiateCoSimulation(
            name.encode(),
            (fmu.description.instantiationToken if token is None else token).encode(),
            path.encode(),
            c_bool(False),
            c_bool(logging),
            c_bool(events),
            c_bool(early),
            None,
            c_size_t(0),
            None,
            self.logger,
            self.update,
        )

    def call(self, function: str, *arguments) -> int:
        return getattr(self.fmu.library, "fmi3" + function)(c_void_p(self.component), *arguments)

    def initialise(self, time=0.0, stop=None) -> int:
        return self.call(
            "EnterInitializationMode",
            c_bool(False),
            c_double(0),
            c_double(time),
            c_bool(stop is not None),
            c_double(stop or 0),
        )

    def start(self, time=0.0) -> "Instance":
        assert self.initialise(time) == OK
        assert self.call("ExitInitializationMode") == OK
        return self

    def references(self, names) -> tuple:
        return (c_uint32 * len(names))(*(self.fmu.arrays[name].valueReference for name in names)), c_size_t(len(names))

    def set(self, values: dict) -> int:
        """Array -> values."""
        flat = np.concatenate([np.ravel(v).astype(float) for v in values.values()])
        return self.call("SetFloat64", *self.references(list(values)), flat.ctypes, c_size_t(len(flat)))

    def get(self, *names) -> np.ndarray:
        values = np.full(sum(self.fmu.size(name) for name in names), np.nan)
        assert self.call("GetFloat64", *self.references(names), values.ctypes, c_size_t(len(values))) == OK, self.log
        return values

    def ids(self, name: str) -> list[int]:
        values = (c_int64 * self.fmu.size(name))()
        assert self.call("GetInt64", *self.references([name]), values, c_size_t(len(values))) == OK, self.log
        return list(values)

    def labels(self, name: str) -> list[str]:
        values = (c_char_p * self.fmu.size(name))()
        assert self.call("GetString", *self.references([name]), values, c_size_t(len(values))) == OK, self.log
        return [value.decode() for value in values]

    def step(self, time: float, size: float) -> tuple[int, bool, float]:
        """Status, early return, last successful time."""
        flags, reached = [c_bool() for _ in range(3)], c_double(np.nan)
        status = self.call("DoStep", c_double(time), c_double(size), c_bool(True), *map(byref, flags), byref(reached))
        assert not flags[0].value and not flags[1].value
        return status, flags[2].value, reached.value

    def derivative(self, kind: str, unknowns, knowns, seed) -> np.ndarray:
        """kind: Directional (seed of the knowns) or Adjoint (of the unknowns)."""
        sizes = [sum(map(self.fmu.size, names)) for names in (unknowns, knowns)]
        change = np.full(sizes[0] if kind == "Directional" else sizes[1], np.nan)
        seed = np.ascontiguousarray(seed, dtype=float)
        status = self.call(
            f"Get{kind}Derivative",
            *self.references(unknowns),
            *self.references(knowns),
            seed.ctypes,
            c_size_t(seed.size),
            change.ctypes,
            c_size_t(len(change)),
        )
        assert status == OK, self.log
        return change

    def dependencies(self, name: str) -> list[tuple[int, int, int, int]]:
        """(element, value reference, element, kind) each."""
        vr, count = c_uint32(self.fmu.arrays[name].valueReference), c_size_t()
        assert self.call("GetNumberOfVariableDependencies", vr, byref(count)) == OK
        n = count.value
        arrays = (c_size_t * n)(), (c_uint32 * n)(), (c_size_t * n)(), (c_int * n)()
        assert self.call("GetVariableDependencies", vr, *arrays, count) == OK
        return list(zip(*arrays))

    def save(self) -> c_void_p:
        state = c_void_p()
        assert self.call("GetFMUState", byref(state)) == OK
        return state

    def errors(self) -> list[str]:
        return [text for status, _, text in self.log if status == ERROR]

    def free(self) -> None:
        self.fmu.library.fmi3FreeInstance(c_void_p(self.component))
