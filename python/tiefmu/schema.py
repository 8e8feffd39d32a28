"""Tables, keys and types of a scene file, and what is said when they are wrong.

Only what one table shows by itself is checked here. References between tables and units are the matter of scene.py.
"""

import difflib
import re
import sys
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationError,
    model_validator,
)
from pydantic_core import PydanticCustomError

from ._core import SceneError


def suggestion(word: str, known) -> str:
    """'; did you mean ...?', or the list of what is known when nothing is close."""
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    if close:
        return f"; did you mean '{close[0]}'?"
    known = sorted(known)
    return f"; known: {', '.join(known[:12])}{', ...' if len(known) > 12 else ''}" if known else ""


def found(value: Any) -> str:
    """How a message shows a value of the file."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"'{shortened(value)}'"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(found, value))}]" if len(value) <= 5 else f"a list of {len(value)} values"
    return shortened(str(value))


def shortened(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."


def wrong(message: str) -> PydanticCustomError:
    # braces would be taken for a template
    return PydanticCustomError("scene", "{message}", {"message": message})


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def selection(value: Any) -> str | list[int]:
    """ "all", the name of a set, or a list of ids."""
    if isinstance(value, str):
        if not value:
            raise wrong("the name of the set is empty")
        return value
    if not isinstance(value, list):
        raise wrong(f"expected a list of ids, a set name or 'all', found {found(value)}")
    if not value:
        raise wrong("the list is empty; give at least one id")
    seen = set()
    for item in value:
        if type(item) is not int or not 1 <= item < 2**63:
            raise wrong(f"expected ids (whole numbers from 1), found {found(item)}")
        if item in seen:
            raise wrong(f"id {item} is repeated")
        seen.add(item)
    return value


LARGEST = 1e30  # products of lengths, up to the eighth power in the inertia of a segment, stay finite


def finite(value: float) -> float:
    if not abs(value) <= sys.float_info.max:
        raise wrong(f"{found(value)} is not a finite number")
    if abs(value) > LARGEST:
        raise wrong(f"{value:g} is too large; it must be at most {LARGEST:g}")
    return value


def printable(value: str, also: str = "") -> str:
    """Refuses what could neither be shown nor be written to XML."""
    odd = next((c for c in value if not c.isprintable() and c not in also), None)
    if odd is not None:
        raise wrong(f"holds a character that cannot be printed, U+{ord(odd):04X}")
    return value


def text(value: str) -> str:
    return printable(value, also="\t\n")


def not_negative(value: float) -> float:
    if value < 0:
        raise wrong(f"{value:g} is negative; it must be 0 or more")
    return value


def number_or_vector(value: Any) -> float | list[float]:
    """A number or [x, y, z], none of them negative."""
    if is_number(value):
        return not_negative(finite(value))
    if not isinstance(value, list) or len(value) != 3 or not all(map(is_number, value)):
        raise wrong(f"expected a number or [x, y, z], found {found(value)}")
    return [not_negative(finite(number)) for number in value]


def vector(value: Any) -> list[float]:
    if not isinstance(value, list) or len(value) != 3 or not all(map(is_number, value)):
        raise wrong(f"expected [x, y, z], found {found(value)}")
    return [finite(number) for number in value]


PORT_NAME = re.compile(r"[\w.:/ -]+")


def port(value: Any) -> dict:
    """The name of a set, or a table {name, nodes, at}; as a table with all three."""
    keys = ["name", "nodes", "at"]
    if isinstance(value, dict):
        unknown = next((key for key in value if key not in keys), None)
        if unknown is not None:
            raise wrong(f"unknown key '{unknown}'{suggestion(str(unknown), keys)}")
    elif not isinstance(value, str):
        raise wrong(f"expected the name of a set, or a table {{name, nodes, at}}, found {found(value)}")
    table = {"name": value} if isinstance(value, str) else value
    name = table.get("name")
    if not isinstance(name, str):
        raise wrong("name: is missing" if name is None else f"name: expected a text, found {found(name)}")
    if not PORT_NAME.fullmatch(name) or name != name.strip():
        cure = "; give the set as nodes, with another name" if isinstance(value, str) else ""
        raise wrong(f"{found(name)} cannot name a port: letters, digits, spaces and _ - . : / can{cure}")
    return {
        "name": name,
        "nodes": keyed("nodes", selection, table.get("nodes", name)),
        "at": keyed("at", vector, table["at"]) if "at" in table else None,
    }


def keyed(key: str, check, value: Any) -> Any:
    try:
        return check(value)
    except PydanticCustomError as error:
        raise wrong(f"{key}: {error.message()}") from None


def triangle(row: Any) -> Any:
    """The row of a segment; a fourth node that is 0 is none, as in crash decks."""
    return row[:4] if isinstance(row, list) and len(row) == 5 and type(row[4]) is int and row[4] == 0 else row


def two_nodes(value: Any) -> str | list[int]:
    if not isinstance(value, list) or len(value) != 2:
        raise wrong(f"expected two node ids, found {found(value)}")
    return selection(value)


Id = Annotated[int, Field(ge=1, le=2**63 - 1)]
Coordinate = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(le=LARGEST), AfterValidator(not_negative)]
Text = Annotated[str, AfterValidator(text)]
Name = Annotated[str, Field(min_length=1), AfterValidator(printable)]
NotNegativeVector = Annotated[Any, PlainValidator(number_or_vector)]
Vector = Annotated[Any, PlainValidator(vector)]
TwoNodes = Annotated[Any, PlainValidator(two_nodes)]
Selection = Annotated[Any, PlainValidator(selection)]
Port = Annotated[Any, PlainValidator(port)]


class Table(BaseModel):
    # strict: true is not a number, "1" is not one either
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class Units(Table):
    length: Literal["m", "cm", "mm", "um", "km", "in", "ft"] = "m"  # the keys of LENGTHS, MASSES, TIMES in units.py
    mass: Literal["kg", "g", "mg", "t", "lb"] = "kg"
    time: Literal["s", "ms", "us", "min"] = "s"


class Mesh(Table):
    file: Name | None = None
    properties: Name | None = None
    nodes: list[Annotated[tuple[Id, Coordinate, Coordinate, Coordinate], Field(strict=False)]] = []
    segments: list[Annotated[list[Id], BeforeValidator(triangle), Field(min_length=4, max_length=5)]] = []


class Node(Table):
    nodes: Selection
    motion: Literal["driven", "free", "fixed"] | None = None
    rotations: bool | None = None
    mass: NotNegative | None = None
    inertia: NotNegative | None = None
    stiffness: NotNegative | None = None
    rotational_stiffness: NotNegative | None = None


class Tie(Table):
    name: Name | None = None  # None: its number
    segments: Selection = "all"
    slaves: Selection
    formulation: Literal["default", "optimized"] = "default"
    search: Literal["box", "nearest-node"] = "box"
    search_distance: NotNegative = 0.0
    unresolved: Literal["error", "drop"] = "error"


class Spring(Table):
    nodes: TwoNodes | None = None
    ground: Selection | None = None
    kind: Literal["axial", "bushing", "beam"] = "axial"
    stiffness: NotNegativeVector = 0.0
    damping: NotNegativeVector = 0.0
    rotational_stiffness: NotNegativeVector = 0.0
    rotational_damping: NotNegativeVector = 0.0
    orientation: Vector | None = None

    @model_validator(mode="after")
    def ends(self):
        if (self.nodes is None) == (self.ground is None):
            raise wrong(
                "give either nodes = [a, b] or ground = [ids], " + ("not both" if self.nodes else "found neither")
            )
        if self.orientation is not None and (self.kind != "beam" or not any(self.orientation)):
            raise wrong(
                f"orientation: only a beam has one; found kind '{self.kind}'"
                if self.kind != "beam"
                else "orientation: [0, 0, 0] is no direction"
            )
        if self.kind != "axial":
            return self
        for key in ("rotational_stiffness", "rotational_damping"):
            if key in self.model_fields_set:
                raise wrong(f"{key}: an axial spring has none; use kind = 'bushing'")
        for key in ("stiffness", "damping"):
            if isinstance(getattr(self, key), list):
                raise wrong(f"{key}: an axial spring takes one number, found {found(getattr(self, key))}")
        return self


class Initial(Table):
    nodes: Selection
    v: Vector | None = None
    w: Vector | None = None

    @model_validator(mode="after")
    def something(self):
        if self.v is None and self.w is None:
            raise wrong("give v = [x, y, z] or w = [x, y, z]")
        return self


class Model(Table):
    inertia: Literal["lumped", "consistent"] = "lumped"
    solver_tolerance: Annotated[float, Field(ge=1e-13, le=1e-2)] = 1e-4
    reaction: Literal["loads", "full", "split"] = "loads"
    reaction_lead: Annotated[float, Field(ge=0, le=1)] = 0.0
    geometry: Literal["finite", "small"] = "finite"
    position: Literal["integrated", "input"] = "integrated"
    gravity: Vector = [0.0, 0.0, 0.0]


class Integrator(Table):
    method: Literal["central-difference", "symplectic-euler", "noh-bathe", "rk4"] = "central-difference"
    time_step: NotNegative = 0.0
    safety: Positive = 0.9
    threads: Annotated[int, Field(ge=1, le=256)] = 0  # not given: one, and no parameter of the FMU


class Interface(Table):
    names: Literal["structured", "flat"] = "structured"
    expose: list[str] = []
    hide: list[str] = []
    ports: list[Port] = []


File = TypeVar("File", bound=Table)


class SceneTables(Table):
    """A whole scene file."""

    title: Text = ""
    units: Units = Units()
    mesh: Mesh
    node: list[Node] = []
    tie: list[Tie] = []
    spring: list[Spring] = []
    initial: list[Initial] = []
    model: Model = Model()
    integrator: Integrator = Integrator()
    interface: Interface = Interface()


TABLES: dict[str, type[Table]] = {
    "units": Units,
    "mesh": Mesh,
    "node": Node,
    "tie": Tie,
    "spring": Spring,
    "initial": Initial,
    "model": Model,
    "integrator": Integrator,
    "interface": Interface,
}
ARRAYS = ("node", "tie", "spring", "initial")  # written [[node]]


def parse(raw: dict) -> SceneTables:
    """The tables of a scene; SceneError names the first thing that is wrong."""
    return parse_as(SceneTables, TABLES, ARRAYS, raw)


def parse_as(top: type[File], tables: dict[str, type[Table]], arrays: tuple[str, ...], raw: dict) -> File:
    """The tables of a file of the kind `top`; SceneError names the first thing that is wrong. tables: the kind of each;
    arrays: those of them that are written [[name]]."""
    try:
        return top.model_validate(raw)
    except ValidationError as error:
        found = dict(error.errors(include_url=False)[0])
        raise SceneError(describe(found, raw, top, tables, arrays)) from None


def table_name(key: str, number: int, table: Any) -> str:
    """How messages call the table `number` (from 1) of the array of tables `key`."""
    named = isinstance(table, dict) and isinstance(table.get("name"), str) and table["name"]
    if named and key not in ("node", "spring", "initial"):
        return f"{key} '{table['name']}'"
    return f"node table {number}" if key == "node" else f"{key} {number}"


def describe(error: dict, raw: dict, top: type[Table], tables: dict[str, type[Table]], arrays: tuple[str, ...]) -> str:
    """One line for an error of pydantic: table, key or id, what was found, what would be right."""
    location, kind = list(error["loc"]), error["type"]
    where: list[str] = []
    model: type[Table] = top
    if len(location) > 1 and location[0] in arrays:
        head, index = location[:2]
        where.append(table_name(head, index + 1, raw[head][index]))
        model, location = tables[head], location[2:]
    elif location[:1] == ["mesh"] and len(location) > 2 and isinstance(location[2], int):
        return ": ".join(["mesh", mesh_row(location[1], location[2:], raw["mesh"][location[1]], error)])
    elif len(location) > 1 and location[0] in tables:
        where.append(location[0])
        model, location = tables[location[0]], location[1:]

    if kind == "extra_forbidden":
        key = str(location[-1])
        return ": ".join([*where, f"unknown key '{key}'{suggestion(key, model.model_fields)}"])
    where += [f"entry {part + 1}" if isinstance(part, int) else str(part) for part in location]
    if kind == "list_type" and location[-1] in arrays:
        return ": ".join([*where, f"expected tables written [[{location[-1]}]], found {found(error['input'])}"])
    return ": ".join([*where, explain(error)])


def mesh_row(table: str, location: list, rows: list, error: dict) -> str:
    """A wrong row of mesh.nodes or mesh.segments; location: row and perhaps column."""
    row = rows[location[0]]
    shape = "[id, x, y, z]" if table == "nodes" else "[id, then three or four node ids]"
    named = isinstance(row, (list, tuple)) and len(row) > 0 and type(row[0]) is int
    where = f"{table[:-1]} {row[0]}" if named else f"{table}: row {location[0] + 1}"
    if len(location) == 1 or error["type"] == "missing":
        return f"{where}: expected {shape}, found {found(row)}"
    column = location[1]
    if column == 0 and named:
        where = f"{table}: row {location[0] + 1}"
    names = ["id", "x", "y", "z"] if table == "nodes" else ["id"] + [f"node {i}" for i in range(1, 5)]
    return f"{where}: {names[column]}: {explain(error)}"


EXPECTED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing_size": "a smaller number",
    "bool_type": "true or false",
    "string_type": "a text",
    "list_type": "a list",
    "tuple_type": "a list",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
}


def explain(error: dict) -> str:
    """What was found and what would be right."""
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    if kind == "scene":
        return error["msg"]
    if kind == "missing":
        return "is missing"
    if kind == "literal_error":
        return f"{found(value)} is not one of {context['expected'].replace(' or ', ', ')}"
    if kind == "finite_number":
        return f"{value} is not a finite number"
    if kind == "float_type" and type(value) is int:
        return f"{found(value)} is too large; it must be at most {LARGEST:g}"
    if kind in EXPECTED:
        return f"expected {EXPECTED[kind]}, found {found(value)}"
    if kind == "greater_than_equal":
        return f"{found(value)} is too small; it must be at least {context['ge']:g}"
    if kind == "greater_than":
        return f"{found(value)} is too small; it must be more than {context['gt']:g}"
    if kind == "less_than_equal":
        return f"{found(value)} is too large; it must be at most {context['le']:g}"
    if kind == "string_too_short":
        return "is empty"
    return f"{error['msg']}, found {found(value)}"
