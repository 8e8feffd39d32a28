"""Get, set and step of FMPy's FMU2Slave and FMU3Slave alike: by lists of scalar variables, on moving pointers."""

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

# Takes a pointer to doubles: where values come from, or go to.
Transfer = Callable[[Any], Any]


class Access2:
    """instance: an FMU2Slave. Variables: FMPy's."""

    def __init__(self, instance: Any):
        self.instance = instance

    def start(self, start: float, stop: float, tolerance: float | None) -> None:
        """Into initialization mode."""
        self.instance.setupExperiment(tolerance=tolerance, startTime=start, stopTime=stop)
        self.instance.enterInitializationMode()

    def reader(self, variables: list) -> Transfer:
        return self._call(self.instance.fmi2GetReal, variables)

    def writer(self, variables: list) -> Transfer:
        return self._call(self.instance.fmi2SetReal, variables)

    def _call(self, function: Callable, variables: list) -> Transfer:
        component, refs, count = self.instance.component, references(variables), len(variables)
        return lambda values: function(component, refs, count, values)

    def stepper(self) -> Callable[[float, float], Any]:
        """A function of a step's start and length, s."""
        step, component = self.instance.fmi2DoStep, self.instance.component
        return lambda time, size: step(component, time, size, 1)


class Access3:
    """instance: an FMU3Slave. Variables: Elements of its arrays, which are got and set whole."""

    def __init__(self, instance: Any, variables: dict[str, Any]):
        """variables: all of the FMU, for the start values of what is never set."""
        self.instance = instance
        self._sizes: dict[int, int] = {}
        for each in variables.values():
            self._sizes[each.valueReference] = max(self._sizes.get(each.valueReference, 0), each.place + 1)
        self._starts: dict[int, list] = {}
        for each in variables.values():
            if each.type == "Real" and each.causality in ("input", "parameter"):
                self._starts.setdefault(each.valueReference, []).append(float(each.start or 0))
        self._values: dict[int, np.ndarray] = {}

    def start(self, start: float, stop: float, tolerance: float | None) -> None:
        self._values = {reference: np.array(values) for reference, values in self._starts.items()}
        self.instance.enterInitializationMode(tolerance=tolerance, startTime=start, stopTime=stop)

    def reader(self, variables: list) -> Transfer:
        call, size, places = self._call(self.instance.fmi3GetFloat64, variables)
        if places is None:
            return call
        buffer = np.empty(size)
        pointer = buffer.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

        def read(values):
            call(pointer)
            view(values, len(places))[:] = buffer[places]

        return read

    def writer(self, variables: list) -> Transfer:
        call, _, places = self._call(self.instance.fmi3SetFloat64, variables)
        if places is None:
            return call
        arrays = [self._values[reference] for reference in dict.fromkeys(v.valueReference for v in variables)]
        buffer = np.concatenate(arrays)
        pointer = buffer.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        begins = np.cumsum([0] + [len(each) for each in arrays])

        def write(values):
            buffer[places] = view(values, len(places))
            call(pointer)
            for each, begin in zip(arrays, begins):  # another writer may set other elements
                each[:] = buffer[begin : begin + len(each)]

        return write

    def _call(self, function: Callable, variables: list) -> tuple[Transfer, int, np.ndarray | None]:
        """Of the arrays of these elements: the call, how many values it takes, and where among them the elements stand;
        None where they are all there is, in order."""
        begins, size = {}, 0
        for reference in dict.fromkeys(variable.valueReference for variable in variables):
            begins[reference] = size
            size += self._sizes[reference]
        places = np.array([begins[v.valueReference] + v.place for v in variables], dtype=int)
        component, count = self.instance.component, len(begins)
        refs = (ctypes.c_uint32 * count)(*begins)
        whole = len(places) == size and bool((places == np.arange(size)).all())
        return (lambda values: function(component, refs, count, values, size)), size, None if whole else places

    def stepper(self) -> Callable[[float, float], Any]:
        step, component = self.instance.fmi3DoStep, self.instance.component
        flags = [ctypes.byref(ctypes.c_bool()) for _ in range(3)]
        reached = ctypes.byref(ctypes.c_double())
        return lambda time, size: step(component, time, size, True, *flags, reached)


def references(variables: list) -> Any:
    return (ctypes.c_uint32 * len(variables))(*(variable.valueReference for variable in variables))


def view(pointer: Any, count: int) -> np.ndarray:
    """The doubles at a pointer, which may move afterwards."""
    return np.ctypeslib.as_array((ctypes.c_double * count).from_address(ctypes.addressof(pointer.contents)))


def moving_pointer() -> tuple[Any, ctypes.c_size_t]:
    """A pointer to doubles, and its address as a number that can be set: no object is made in a step."""
    pointer = ctypes.POINTER(ctypes.c_double)()
    return pointer, ctypes.c_size_t.from_buffer(pointer)
