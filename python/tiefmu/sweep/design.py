"""sweep.toml: parameters and how they are combined to cases."""

import copy
import itertools
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from ..acceptance.criteria import Run
from ..errors import SceneError, UsageError
from ..results import needed
from ..scene import read_toml
from ..schema import Name, Table, parse_as, suggestion, wrong

Number = Annotated[float, Field(allow_inf_nan=False)]


class Parameter(Table):
    """One of scene, start and input says what varies; values, or from and to, how."""

    name: Name | None = None
    scene: Name | None = None  # a key of the scene: model.inertia, node[2].mass, tie[weld].formulation
    start: Name | None = None  # the start value of a variable of the FMU
    input: Name | None = None  # a factor on a column of the input, or on all: "*"
    values: list[Any] | None = None
    lowest: Number | None = Field(None, alias="from")
    highest: Number | None = Field(None, alias="to")
    count: Annotated[int, Field(ge=2)] | None = None
    scale: Literal["linear", "log"] = "linear"

    @model_validator(mode="after")
    def one_of_each(self):
        if sum(x is not None for x in (self.scene, self.start, self.input)) != 1:
            raise wrong("give one of scene, start and input: what varies")
        if (self.values is None) == (self.lowest is None or self.highest is None):
            raise wrong("give values, or from and to")
        if self.values is not None and not self.values:
            raise wrong("values: is empty")
        if self.scale == "log" and not (self.lowest or 0) > 0:
            raise wrong("scale = 'log': from must be more than 0")
        if self.scene is None and any(
            not isinstance(x, (int, float)) or isinstance(x, bool) for x in self.values or []
        ):
            raise wrong("values: expected numbers; only keys of the scene take words")
        return self

    @property
    def title(self) -> str:
        return self.name or self.scene or self.start or f"input {self.input}"

    def between(self, parts: np.ndarray) -> list[float]:
        """Values at parts (0 to 1) of the way from the lowest to the highest."""
        assert self.lowest is not None and self.highest is not None
        if self.scale == "log":
            return (self.lowest * (self.highest / self.lowest) ** parts).tolist()
        return (self.lowest + (self.highest - self.lowest) * parts).tolist()


class Design(Table):
    kind: Literal["grid", "list", "latin-hypercube"] = "grid"
    samples: Annotated[int, Field(ge=1)] | None = None
    seed: Annotated[int, Field(ge=0)] = 0


class Sweep(Table):
    """A whole file. scene: TOML or FMU; criteria, signals: what a case gives."""

    title: str = ""
    scene: Name
    criteria: Name | None = None
    signals: list[Name] = Field(default=[])
    run: Run = Run()
    design: Design = Design()
    parameter: list[Parameter] = Field(default=[])

    @model_validator(mode="after")
    def something(self):
        if not self.parameter:
            raise wrong("holds no parameter; give at least one [[parameter]]")
        if self.criteria is None and not self.signals:
            raise wrong("gives no numbers; name criteria or signals")
        return self


TABLES: dict[str, type[Table]] = {"run": Run, "design": Design, "parameter": Parameter}
ARRAYS = ("parameter",)


@dataclass
class Case:
    """values: of the parameters, in their order."""

    number: int
    values: list


def read(path: Path) -> Sweep:
    """Raises UsageError."""
    try:
        sweep = parse_as(Sweep, TABLES, ARRAYS, read_toml(path))
    except SceneError as error:
        raise UsageError(f"{path}: {error}") from None
    titles = [parameter.title for parameter in sweep.parameter]
    for title in titles:
        if titles.count(title) > 1:
            raise UsageError(f"{path}: parameter '{title}': is given twice; name one of them otherwise")
    for name in [sweep.scene, *filter(None, [sweep.criteria, sweep.run.input])]:
        if not (path.parent / name).is_file():
            raise UsageError(f"{path}: {name}: no such file beside it")
    if sweep.scene.lower().endswith(".fmu"):
        for parameter in sweep.parameter:
            if parameter.scene:
                raise UsageError(
                    f"{path}: parameter '{parameter.title}': an FMU has no scene; give the scene file, or vary start "
                    "values and inputs"
                )
    return sweep


def cases(sweep: Sweep, name: str) -> list[Case]:
    """In their order, which does not depend on who runs them. name: how messages call the file. Raises UsageError."""
    parameters, design = sweep.parameter, sweep.design
    if design.kind == "latin-hypercube":
        needed("scipy", "sweep", f"{name}: design")
        from scipy.stats import qmc

        if design.samples is None:
            raise UsageError(f"{name}: design: samples: is missing; a Latin hypercube needs their number")
        parts = qmc.LatinHypercube(d=len(parameters), rng=np.random.default_rng(design.seed)).random(design.samples)
        columns = []
        for parameter, column in zip(parameters, parts.T):
            if parameter.values is not None:
                place = np.minimum((column * len(parameter.values)).astype(int), len(parameter.values) - 1)
                columns.append([parameter.values[k] for k in place.tolist()])
            else:
                columns.append(parameter.between(column))
        return [Case(k, list(values)) for k, values in enumerate(zip(*columns))]

    lists = []
    for parameter in parameters:
        if parameter.values is None and parameter.count is None:
            raise UsageError(
                f"{name}: parameter '{parameter.title}': count: is missing; from and to need it, save in a Latin "
                "hypercube"
            )
        lists.append(parameter.values or parameter.between(np.linspace(0, 1, parameter.count or 2)))
    if design.kind == "grid":
        return [Case(k, list(values)) for k, values in enumerate(itertools.product(*lists))]
    if len(set(map(len, lists))) > 1:
        lengths = ", ".join(f"{p.title} {len(v)}" for p, v in zip(parameters, lists))
        raise UsageError(f"{name}: design: a list needs as many values of each parameter, found {lengths}")
    return [Case(k, list(values)) for k, values in enumerate(zip(*lists))]


PLACE = re.compile(r"(\w+)(?:\[([^\]]+)\])?\.(\w+)")


def put(raw: dict, key: str, value: Any) -> None:
    """Sets a key of a scene: TABLE.KEY, or TABLE[NUMBER or NAME].KEY of an array of tables. Raises UsageError."""
    match = PLACE.fullmatch(key)
    if not match:
        raise UsageError(f"'{key}': expected TABLE.KEY or TABLE[NUMBER].KEY, as in node[2].mass")
    table, which, name = match.groups()
    found = raw.get(table)
    if which is None:
        if isinstance(found, list):
            raise UsageError(f"'{key}': there are {len(found)} tables [[{table}]]; say which, as {table}[1].{name}")
        raw.setdefault(table, {})[name] = value
        return
    if not isinstance(found, list):
        raise UsageError(f"'{key}': the scene has no tables [[{table}]]{suggestion(table, raw)}")
    places = {str(k): row for k, row in enumerate(found, 1)} | {
        row["name"]: row for row in found if isinstance(row, dict) and "name" in row
    }
    if which not in places:
        raise UsageError(f"'{key}': no such table{suggestion(which, places)}")
    places[which][name] = value


def variant(raw: dict, sweep: Sweep, values: list) -> dict:
    """The scene of a case."""
    changed = copy.deepcopy(raw)
    for parameter, value in zip(sweep.parameter, values):
        if parameter.scene:
            put(changed, parameter.scene, value)
    return changed
