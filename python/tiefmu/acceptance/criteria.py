"""criteria.toml: its tables, and what is said when they are wrong."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, model_validator

from ..errors import SceneError, UsageError
from ..scene import read_toml
from ..schema import Name, NotNegative, Positive, Table, Text, finite, found, is_number, parse_as, wrong

GRADES = {"excellent": 0.94, "good": 0.8, "fair": 0.58}  # least overall ratings of ISO/TS 18571


def window(value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2 or not all(map(is_number, value)):
        raise wrong(f"expected [from, to] in s, found {found(value)}")
    start, end = map(finite, value)
    if not start < end:
        raise wrong(f"ends at {end:g} s, before it starts at {start:g} s")
    return start, end


def grade(value: Any) -> float:
    """A number from 0 to 1, or a word of GRADES."""
    if isinstance(value, str) and value in GRADES:
        return GRADES[value]
    if not is_number(value) or not 0 <= value <= 1:
        raise wrong(f"expected a number from 0 to 1, or one of {', '.join(GRADES)}, found {found(value)}")
    return float(value)


def cfc(value: Any) -> int:
    if value not in (60, 180, 600, 1000) or isinstance(value, bool):
        raise wrong(f"{found(value)} is no channel frequency class; known: 60, 180, 600, 1000")
    return int(value)


Window = Annotated[Any, PlainValidator(window)]
Number = Annotated[float, Field(allow_inf_nan=False)]


class Run(Table):
    """How the FMU is run; what is not given, as `tiefmu run` takes it."""

    stop_time: Positive | None = None
    step: Positive | None = None
    input: Name | None = None


class Criterion(Table):
    name: Name | None = None
    signal: Name
    combine: Literal["norm", "sum", "largest"] = "norm"
    filter: Annotated[Any, PlainValidator(cfc)] | None = None
    window: Window | None = None


class Against(Criterion):
    """Against a column of a reference CSV."""

    reference: Name
    column: Name | None = None  # None: named like the signal
    time_column: Name = "time"
    scale: Number = 1.0
    time_scale: Positive = 1.0
    filter_reference: bool = True


class Band(Against):
    absolute: NotNegative = 0.0
    relative: NotNegative = 0.0
    at: Literal["run", "reference"] = "run"

    @model_validator(mode="after")
    def some(self):
        if not {"absolute", "relative"} & self.model_fields_set:
            raise wrong("give absolute, relative, or both: the half-width of the band")
        return self


class Rating(Against):
    least: Annotated[Any, PlainValidator(grade)]
    of: Literal["overall", "corridor", "phase", "magnitude", "slope"] = "overall"


class Limit(Criterion):
    measure: Literal["peak", "maximum", "minimum", "end", "time_of_peak", "impulse"] = "peak"
    at_least: Number | None = None
    at_most: Number | None = None

    @model_validator(mode="after")
    def some(self):
        if self.at_least is None and self.at_most is None:
            raise wrong("give at_least, at_most, or both")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise wrong(f"at_least {self.at_least:g} is more than at_most {self.at_most:g}")
        return self


HEALTH = {  # key: name of the criterion
    "energy_residual": "energy residual",
    "drift": "drift",
    "power_residual": "power residual",
    "stability_margin": "stability margin",
    "added_mass": "added mass",
    "dropped": "dropped slaves",
    "half_step": "half the step",
}


class Health(Table):
    energy_residual: NotNegative | None = None
    drift: NotNegative | None = None
    power_residual: NotNegative | None = None
    stability_margin: NotNegative | None = None
    added_mass: NotNegative | None = None
    dropped: Annotated[int, Field(ge=0)] | None = None
    half_step: NotNegative | None = None


class Criteria(Table):
    """A whole file."""

    title: Text = ""
    run: Run = Run()
    band: list[Band] = Field(default=[])
    rating: list[Rating] = Field(default=[])
    limit: list[Limit] = Field(default=[])
    health: Health = Health()

    @model_validator(mode="after")
    def something(self):
        if not (self.band or self.rating or self.limit or self.health.model_fields_set):
            raise wrong("holds no criterion; give [[band]], [[rating]], [[limit]] or [health]")
        return self

    @property
    def named(self) -> list[tuple[str, Criterion]]:
        """The criteria but those of health, with the names of messages and tables."""
        rows: list[tuple[str, Criterion]] = []
        for key in ("band", "rating", "limit"):
            for number, row in enumerate(getattr(self, key), 1):
                rows.append((row.name or f"{key} {number}", row))
        return rows

    @property
    def labels(self) -> list[str]:
        """Names of all criteria."""
        given = [HEALTH[key] for key in HEALTH if getattr(self.health, key) is not None]
        return [name for name, _ in self.named] + given


TABLES: dict[str, type[Table]] = {"run": Run, "band": Band, "rating": Rating, "limit": Limit, "health": Health}
ARRAYS = ("band", "rating", "limit")


def read(path: Path) -> Criteria:
    """Raises UsageError: file, criterion, what is wrong and what would be right."""
    try:
        criteria = parse_as(Criteria, TABLES, ARRAYS, read_toml(path))
    except SceneError as error:
        raise UsageError(f"{path}: {error}") from None
    seen = set()
    for name, _ in criteria.named:
        if name in seen:
            raise UsageError(f"{path}: criterion '{name}': this name is repeated")
        seen.add(name)
    for name in files(criteria):
        if not (path.parent / name).is_file():
            raise UsageError(f"{path}: {name}: no such file beside it")
    return criteria


def files(criteria: Criteria) -> list[str]:
    """What the criteria refer to: reference CSVs and the input, each once."""
    names = [row.reference for row in [*criteria.band, *criteria.rating]]
    names += [criteria.run.input] if criteria.run.input else []
    return list(dict.fromkeys(names))
