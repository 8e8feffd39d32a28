"""An FMU seen through its C functions: every call gives back the bare status, and every log message is kept."""

import ctypes
import tempfile
import zipfile
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path

import fmpy
import numpy as np
import pytest
import tiefmu
from tiefmu.platforms import here

# Refused, but there: some importers look up every function of the standard.
MODEL_EXCHANGE = [
    "EnterEventMode",
    "NewDiscreteStates",
    "EnterContinuousTimeMode",
    "CompletedIntegratorStep",
    "SetTime",
    "SetContinuousStates",
    "GetDerivatives",
    "GetEventIndicators",
    "GetContinuousStates",
    "GetNominalsOfContinuousStates",
]

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
# The logger is variadic; our messages are the format, without arguments.
Logger = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", Logger),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    ]


def build_without_references(scene, path: Path, fmi: int = 2) -> Path:
    """The FMU but for its reference results: to run them takes seconds where a scene needs many substeps."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tiefmu.content.reference", lambda *_: {})
        return tiefmu.build(tiefmu.load(scene), path, fmi=fmi)


class Fmu:
    """A scene (dict or TOML file) built, without reference results, or an FMU, unpacked into a new folder in `folder`,
    with its description read and validated."""

    def __init__(self, scene, folder: Path):
        self.folder = Path(tempfile.mkdtemp(dir=folder))  # a library that is loaded must not be overwritten
        made = isinstance(scene, Path) and scene.suffix == ".fmu"
        self.path = scene if made else build_without_references(scene, self.folder / "scene.fmu")
        with zipfile.ZipFile(self.path) as archive:
            archive.extractall(self.folder)
        self.description = fmpy.read_model_description(
            str(self.path), validate=True, validate_variable_names=False, validate_model_structure=True
        )
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.reference = {v.name: v.valueReference for v in self.description.modelVariables}
        identifier = self.description.coSimulation.modelIdentifier
        self.binary = self.folder / "binaries" / here().folder / (identifier + here().suffix)
        self.library = ctypes.CDLL(str(self.binary))
        self.library.fmi2Instantiate.restype = c_void_p
        self.library.fmi2Instantiate.argtypes = [c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int]
        self.library.fmi2FreeInstance.restype = None

    def names(self, causality: str) -> list[str]:
        return [v.name for v in self.description.modelVariables if v.causality == causality]


class Instance:
    """`log` holds (environment, instance name, status, category, format, text) of every message; a format that asks
    for an argument fails."""

    def __init__(self, fmu: Fmu, name="tie", guid=None, location=None, kind=1, logging=False, environment=0):
        self.fmu = fmu
        self.log = []

        def keep(*message):
            *head, form = (m.decode() if isinstance(m, bytes) else m for m in message)
            self.log.append((*head, form, form % ()))

        self.callbacks = Callbacks(Logger(keep), None, None, None, environment)
        location = (fmu.folder / "resources").as_uri() if location is None else location
        self.component = fmu.library.fmi2Instantiate(
            name.encode(),
            kind,
            (fmu.description.guid if guid is None else guid).encode(),
            location.encode(),
            byref(self.callbacks),
            0,
            int(logging),
        )

    def call(self, function: str, *arguments) -> int:
        return getattr(self.fmu.library, "fmi2" + function)(c_void_p(self.component), *arguments)

    def start(self, time=0.0, values=None, stop=None) -> "Instance":
        """Up to the first communication point."""
        assert (
            self.call("SetupExperiment", 0, c_double(0), c_double(time), int(stop is not None), c_double(stop or 0))
            == OK
        )
        if values:
            assert self.set(values) == OK
        assert self.call("EnterInitializationMode") == OK
        assert self.call("ExitInitializationMode") == OK
        return self

    def set_references(self, references, values) -> int:
        n = len(references)
        return self.call("SetReal", (c_uint * n)(*references), c_size_t(n), (c_double * n)(*values))

    def set(self, values: dict) -> int:
        return self.set_references([self.fmu.reference[name] for name in values], list(values.values()))

    def get_references(self, references) -> tuple[int, np.ndarray]:
        n = len(references)
        values = (c_double * n)(*[np.nan] * n)
        status = self.call("GetReal", (c_uint * n)(*references), c_size_t(n), values)
        return status, np.array(values[:])

    def get(self, names) -> np.ndarray:
        status, values = self.get_references([self.fmu.reference[name] for name in names])
        assert status == OK, self.log
        return values

    def step(self, time: float, size: float) -> int:
        return self.call("DoStep", c_double(time), c_double(size), 0)

    def save(self, state=None) -> c_void_p:
        state = c_void_p() if state is None else state
        assert self.call("GetFMUstate", byref(state)) == OK
        return state

    def restore(self, state) -> int:
        return self.call("SetFMUstate", state)

    def errors(self) -> list[str]:
        return [message[5] for message in self.log if message[2] == ERROR]

    def free(self):
        if self.component:
            self.fmu.library.fmi2FreeInstance(c_void_p(self.component))
            self.component = None


def set_derivatives(instance, names, orders, values) -> int:
    n = len(names)
    return instance.call(
        "SetRealInputDerivatives",
        (c_uint * n)(*[instance.fmu.reference[name] for name in names]),
        c_size_t(n),
        (c_int * n)(*orders),
        (c_double * n)(*values),
    )


def diverged(loose) -> Instance:
    instance = Instance(loose).start(values={"slave[1].f[1]": 1e30})
    assert instance.step(0, 1.0) == ERROR
    return instance
