"""FMUs and their instances on FMPy's FMU2Slave and FMU3Slave: a step is three calls, on preallocated arrays."""

import contextlib
import ctypes
import io
import itertools
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .errors import RunError, RunStopped, one_line
from .fmi3_variables import elements
from .fmi_access import Access2, Access3, moving_pointer
from .platforms import LibraryError, here, library_of
from .signals import Experiment

LARGEST_BLOCK = 2**26  # bytes of rows handed on at a time
INPUTS_AHEAD = 2**22  # bytes of inputs computed at a time


class Fmu:
    """An FMI 2.0 or 3.0 co-simulation FMU, described and unpacked; a context manager that removes what it unpacked.

    description: FMPy's; variables: by name, of arrays each element (fmi3_variables.py); name: how messages call it.
    """

    def __init__(self, path: Path, name: str | None = None):
        """Raises RunError where it cannot be read."""
        import fmpy  # here, because importing it takes half a second

        self.path, self.name = path, name or str(path)
        try:
            self.description = fmpy.read_model_description(str(path), validate=False)
        except Exception as error:
            raise RunError(f"{self.name}: not an FMU that FMPy can read: {one_line(error)}") from None
        self.fmi = {"2.0": 2, "3.0": 3}.get(self.description.fmiVersion, 0)
        if not self.fmi or self.description.coSimulation is None:
            raise RunError(f"{self.name}: not an FMU for co-simulation by FMI 2.0 or 3.0")
        variables = self.description.modelVariables
        if self.fmi == 3:
            with zipfile.ZipFile(path) as archive:
                variables = elements(self.description, archive.read("modelDescription.xml"))
        self.variables: dict[str, Any] = {variable.name: variable for variable in variables}
        self._folder: tempfile.TemporaryDirectory | None = None

    def __enter__(self) -> "Fmu":
        import fmpy

        # Windows keeps the file of a library that is still loaded.
        self._folder = tempfile.TemporaryDirectory(prefix="tiefmu-", ignore_cleanup_errors=True)
        try:
            fmpy.extract(str(self.path), self._folder.name)
        except Exception as error:
            self.__exit__()
            raise RunError(f"{self.name}: cannot be unpacked: {one_line(error)}") from None
        try:
            check_library(self.folder, self.description.coSimulation.modelIdentifier, self.name, self.fmi)
        except RunError:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_) -> None:
        if self._folder:
            self._folder.cleanup()
            self._folder = None

    @property
    def folder(self) -> Path:
        """Where it is unpacked."""
        assert self._folder, "inside `with`"
        return Path(self._folder.name)

    def outputs(self) -> list[str]:
        """Names of the Real outputs, in the order of the description."""
        return [v.name for v in self.variables.values() if v.causality == "output" and v.type == "Real"]

    def unit(self, name: str) -> str:
        variable = self.variables[name]
        return variable.unit or (variable.declaredType and variable.declaredType.unit) or "1"

    def experiment(self, key: str, default):
        """startTime, stopTime, stepSize or tolerance of the default experiment."""
        value = getattr(self.description.defaultExperiment, key, None)
        return default if value is None else float(value)


def check_library(folder: Path, identifier: str, name: str, fmi: int) -> None:
    """Refuses an unpacked FMU whose library this process cannot load: some of them would end it. Raises RunError."""
    import fmpy

    mine = here()
    binaries, file = folder / "binaries", identifier + mine.suffix
    wanted = [
        binaries / mine.folder_of(fmi) / file,
        binaries / (fmpy.platform_tuple if fmi == 3 else fmpy.platform) / file,
    ]
    path = next((path for path in wanted if path.is_file()), None)
    if path is None:
        found = sorted(each.name for each in binaries.iterdir()) if binaries.is_dir() else []
        raise RunError(
            f"{name}: holds no library for this system (binaries/{mine.folder_of(fmi)}/{file}); found "
            f"{', '.join(found) or 'none'}"
        )
    where = f"{name}: {path.relative_to(folder).as_posix()}"
    try:
        system, machines = library_of(path.read_bytes())
    except LibraryError as error:
        raise RunError(f"{where}: {error}") from None
    if system != mine.system or mine.machine not in machines:
        raise RunError(
            f"{where}: is a library for {system} on {' and '.join(sorted(machines))}, this is {mine.system} on "
            f"{mine.machine}"
        )
    if path != wanted[1]:  # FMPy looks into linux64 on Arm, too
        wanted[1].parent.mkdir(exist_ok=True)
        wanted[1].write_bytes(path.read_bytes())


class Instance:
    """An instance. Outputs: names of Real variables."""

    def __init__(self, fmu: Fmu, outputs: list[str]):
        """Raises RunError where it cannot be instantiated."""
        import fmpy.fmi2
        from fmpy.simulation import instantiate_fmu

        self.fmu, self.said = fmu, []
        self.outputs = [fmu.variables[name] for name in outputs]

        def log(*arguments):  # of FMI 2.0: environment, instance, status, category, message; 3.0 has no instance
            status, _, message = arguments[-3:]
            if status >= fmpy.fmi2.fmi2Error:
                self.said.append(message.decode(errors="replace") if isinstance(message, bytes) else str(message))

        with self._errors("cannot be instantiated"), contextlib.redirect_stdout(io.StringIO()):
            self.instance = instantiate_fmu(
                str(fmu.folder), fmu.description, "CoSimulation", logger=log, require_functions=False
            )
        self.access = Access3(self.instance, fmu.variables) if fmu.fmi == 3 else Access2(self.instance)

    @contextlib.contextmanager
    def _errors(self, what: str, kind: type[RunError] = RunError):
        try:
            yield
        except Exception as error:
            message = one_line(self.said[-1] if self.said else error)
            self.said.clear()
            raise kind(f"{self.fmu.name}: {what}: {message}") from None

    def reset(self) -> None:
        """Back to where it was after its instantiation."""
        with self._errors("cannot be reset"):
            self.instance.reset()

    def free(self) -> None:
        self.instance.freeInstance()

    def read(self, names: list[str]) -> list[float]:
        """Values of Real variables."""
        with self._errors("cannot be read"):
            return self._get([self.fmu.variables[name] for name in names])

    def blocks(
        self,
        plan: Experiment,
        start_values: dict[str, float] | None = None,
        finished: Callable[[float], Any] | None = None,
        largest: int = LARGEST_BLOCK,
    ) -> Iterator[np.ndarray]:
        """Runs it. Yields rows of time and outputs (rows, 1 + outputs), at the start and after each step, in blocks of
        at most `largest` bytes. finished(time) after each step. Row k holds what the FMU answers at the end of step k,
        the inputs being those of the start of the step. Raises RunError, RunStopped of a step."""
        inputs, time = plan.inputs, plan.start
        points = plan.points(self.fmu.description.coSimulation.canHandleVariableCommunicationStepSize)
        estimate = int(min(plan.rows, 1e15)) + 3
        width = 8 * (1 + len(self.outputs))
        block = np.empty((max(2, min(estimate, largest // width)), 1 + len(self.outputs)))
        given = np.empty((0, 0))
        do_step, get_outputs, n_controls = (
            self.access.stepper(),
            self.access.reader(self.outputs),
            len(inputs.variables),
        )
        value, value_at = moving_pointer()
        control, control_at = moving_pointer()

        ahead = max(1, INPUTS_AHEAD // (8 * max(n_controls, 1)))
        block[0, 0] = time
        value_at.value = block.ctypes.data + 8
        with self._errors(f"stopped at t = {time:g} s"):
            self._initialise(plan, start_values or {})
            set_inputs = self.access.writer(inputs.variables)
            get_outputs(value)
        row = 1
        while True:
            ends = np.fromiter(itertools.islice(points, min(len(block) - row, ahead)), float)
            if not len(ends):
                break
            if n_controls:
                given = inputs.at(np.append(time, ends[:-1]))
            control_at.value = given.ctypes.data
            block[row : row + len(ends), 0] = ends
            value_at.value = block[row:].ctypes.data + 8
            try:
                for end in ends.tolist():
                    if n_controls:
                        set_inputs(control)
                        control_at.value += 8 * n_controls
                    do_step(time, end - time)
                    get_outputs(value)
                    value_at.value += width
                    time = end
                    if finished:
                        finished(time)
            except Exception:
                with self._errors(f"stopped at t = {time:g} s", RunStopped):
                    raise
            row += len(ends)
            if row == len(block):
                yield block
                block, row = np.empty_like(block), 0
        if row:
            yield block[:row]
        with self._errors("cannot be terminated"):
            self.instance.terminate()

    def _initialise(self, plan: Experiment, start_values: dict[str, float]) -> None:
        """As `simulate_fmu` does it: start values, then inputs, in initialization mode."""
        self.access.start(plan.start, plan.stop, self.fmu.experiment("tolerance", None))
        if start_values:
            self._set([self.fmu.variables[name] for name in start_values], np.array(list(start_values.values())))
        if plan.inputs.variables:
            self._set(plan.inputs.variables, plan.inputs.at(np.array([plan.start]), after_jump=False)[0])
        self.instance.exitInitializationMode()

    def _set(self, variables: list, values: np.ndarray) -> None:
        values = np.ascontiguousarray(values, dtype=float)
        self.access.writer(variables)(values.ctypes.data_as(ctypes.POINTER(ctypes.c_double)))

    def _get(self, variables: list) -> list[float]:
        values = np.empty(len(variables))
        self.access.reader(variables)(values.ctypes.data_as(ctypes.POINTER(ctypes.c_double)))
        return values.tolist()
