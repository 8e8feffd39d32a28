"""Reads what a tie needs from a Nastran or OptiStruct bulk data file: grids, elements, coordinate systems, sets.

meshio reads the format too, without ids. Fields may be small (8 columns), large (16) or free (commas). Sets: "pid 7"
holds the elements of property 7; "set 7" what SET 7 of the case control, SET1, SET3 or OptiStruct's SET lists, as nodes
where nodes are asked for and as elements where segments are.
"""

import re
from pathlib import Path

import numpy as np

from .._core import SceneError
from ..schema import shortened
from .data import Block, MeshFile, Sets, find
from .faces import CORNERS
from .fortran_numbers import FieldError
from .fortran_numbers import numbers as fortran_numbers
from .fortran_numbers import whole as fortran_whole

# card: shape, most nodes, field of the first node, field of the property or None (fields behind the name, from 0)
ELEMENTS = {
    "CTRIA3": ("triangle", 3, 2, 1),
    "CTRIAR": ("triangle", 3, 2, 1),
    "CTRIA6": ("triangle", 6, 2, 1),
    "CQUAD4": ("quad", 4, 2, 1),
    "CQUADR": ("quad", 4, 2, 1),
    "CQUAD8": ("quad", 8, 2, 1),
    "CQUAD": ("quad", 9, 2, 1),
    "CSHEAR": ("quad", 4, 2, 1),
    "CTETRA": ("tetra", 10, 2, 1),
    "CPYRAM": ("pyramid", 13, 2, 1),
    "CPYRA": ("pyramid", 13, 2, 1),
    "CPENTA": ("wedge", 15, 2, 1),
    "CHEXA": ("hexahedron", 20, 2, 1),
    "CBAR": ("line", 2, 2, 1),
    "CBEAM": ("line", 2, 2, 1),
    "CROD": ("line", 2, 2, 1),
    "CTUBE": ("line", 2, 2, 1),
    "CBUSH": ("line", 2, 2, 1),
    "CONROD": ("line", 2, 1, None),
    "CONM2": ("vertex", 1, 1, None),
}
SYSTEMS = {"CORD2R", "CORD2C", "CORD2S"}
WANTED = {*ELEMENTS, *SYSTEMS, "GRID", "GRDSET", "SET1", "SET3", "SET"}
MOST = 10**8  # ids in a set
LOOKS = re.compile(rb"(?mi)^(GRID[ *,\t]|BEGIN\s+BULK|CEND\b|CQUAD4[ *,\t]|CTRIA3[ *,\t])")


def looks_so(path: Path) -> bool:
    """Whether a .dat file is Nastran's (other programs use the ending too)."""
    with path.open("rb") as file:
        return LOOKS.search(file.read(2**20)) is not None


def read(path: Path) -> MeshFile:
    lines = included(path, ())
    begin = next((n for n, line in enumerate(lines) if re.match(r"(?i)BEGIN\s+BULK", line)), -1)
    cards = bulk(lines[begin + 1 :])
    try:
        ids, position = grids(cards)
        file = MeshFile(ids, position, [], Sets(True), Sets(True), Sets(True))
        elements(file, cards)
        sets(file, cards, lines[: max(begin, 0)])
    except (ValueError, IndexError, OverflowError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"cannot be read ({error})") from None
    return file


def included(path: Path, above: tuple[Path, ...]) -> list[str]:
    """Lines of the file and those that it includes, without comments."""
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        if not above:
            raise
        raise SceneError(f"INCLUDE: {path}: {error.strerror}") from None
    lines = []
    source = iter(text.splitlines())
    for line in source:
        if "$" in line:
            line = line[: line.index("$")]
        if line[:7].upper() == "INCLUDE":
            name = line[7:].strip()
            while name[:1] in ("'", '"') and name.count(name[0]) < 2:  # a long name goes on over lines
                rest = next(source, None)
                if rest is None:
                    raise SceneError(f"INCLUDE: {shortened(name)}: its name does not end")
                name += rest.strip()
            inner = path.parent / name.strip("'\" ")
            if inner.resolve() in (*above, path.resolve()):
                raise SceneError(f"INCLUDE: {inner.name} includes itself")
            lines += included(inner, (*above, path.resolve()))
        elif line and not line.isspace():
            lines.append(line)
    return lines


def bulk(lines: list[str]) -> dict[str, list[list[str]]]:
    """Cards by name, each with its fields behind the name, those of continuations appended."""
    cards: dict[str, list[list[str]]] = {name: [] for name in WANTED}
    fields: list[str] | None = None  # of the card that continuations belong to; None: of one that is not read
    for line in lines:
        if "\t" in line:
            line = line.expandtabs(8)
        free = "," in line
        name = (line.partition(",")[0] if free else line[:8]).strip().upper()
        large = name[-1:] == "*"
        if free:
            items = line.split(",")[1 : 5 if large else 9]
        elif large:
            items = [line[8:24], line[24:40], line[40:56], line[56:72]]
        else:
            items = [line[k : k + 8] for k in range(8, 72, 8)]
        if not name or name[0] in "+*":
            if fields is not None:
                fields += items + [""] * ((4 if large else 8) - len(items))
            continue
        if large:
            name = name[:-1].rstrip()
        if name == "ENDDATA":
            break
        if name not in WANTED:
            fields = None
            continue
        fields = items + [""] * ((4 if large else 8) - len(items))
        cards[name].append(fields)
    return cards


def grids(cards) -> tuple[np.ndarray, np.ndarray]:
    rows = cards["GRID"]
    ids = whole([row[0] for row in rows], "GRID")
    if ids.min(initial=1) < 1:
        raise SceneError(f"GRID {ids.min()}: ids start at 1")
    position = np.column_stack([numbers([row[k] for row in rows], "GRID", ids) for k in (2, 3, 4)]).reshape(-1, 3)
    default = (cards["GRDSET"][0][1].strip() if cards["GRDSET"] else "") or "0"
    system = whole([row[1] if row[1].strip() else default for row in rows], "GRID", ids=ids)
    for number in np.unique(system[system != 0]).tolist():
        mine = system == number
        position[mine] = in_basic(cards, number, position[mine], ())
    if len(np.unique(ids)) < len(ids):  # Nastran takes a GRID that is written twice, in the same place
        _, first = np.unique(np.column_stack([ids, position.view(np.int64)]), axis=0, return_index=True)
        ids, position = ids[np.sort(first)], position[np.sort(first)]
    return ids, position


def in_basic(cards, number: int, position: np.ndarray, below: tuple[int, ...]) -> np.ndarray:
    """Positions (n, 3) given in the coordinate system `number`, in the basic one."""
    if number == 0:
        return position
    found = [(name, row) for name in sorted(SYSTEMS) for row in cards[name] if row[0].strip() == str(number)]
    if not found:
        raise SceneError(f"coordinate system {number} is not in the file as CORD2R, CORD2C or CORD2S")
    if number in below:
        raise SceneError(f"coordinate system {number} is defined by itself")
    name, row = found[0]
    points = numbers([*row, *[""] * 4][2:11], f"{name} {number}").reshape(3, 3)
    parent = whole([row[1] if row[1].strip() else "0"], f"{name} {number}")[0]
    origin, on_z, in_xz = in_basic(cards, int(parent), points, (*below, number))
    z = on_z - origin
    y = np.cross(z, in_xz - origin)
    x = np.cross(y, z)
    axes = np.array([x, y, z])
    size = np.linalg.norm(axes, axis=1, keepdims=True)
    if not (size > 0).all():
        raise SceneError(f"{name} {number}: its three points lie on a line")
    first, angle = position[:, 0], np.radians(position[:, 1:])
    if name == "CORD2C":
        position = np.column_stack([first * np.cos(angle[:, 0]), first * np.sin(angle[:, 0]), position[:, 2]])
    elif name == "CORD2S":
        radius = first * np.sin(angle[:, 0])
        position = np.column_stack(
            [radius * np.cos(angle[:, 1]), radius * np.sin(angle[:, 1]), first * np.cos(angle[:, 0])]
        )
    return origin + position @ (axes / size)


def elements(file: MeshFile, cards):
    ids, row, of_property = [np.empty(0, np.int64)], 0, {}
    for name, (shape, most, first, field) in ELEMENTS.items():
        rows = cards[name]
        if not rows:
            continue
        number = whole([fields[0] for fields in rows], name)
        if number.min() < 1:
            raise SceneError(f"{name} {number.min()}: ids start at 1")
        nodes = np.zeros((len(rows), most), np.int64)
        for k in range(most):
            column = [fields[first + k] if len(fields) > first + k else "" for fields in rows]
            nodes[:, k] = whole(column, name, blank="0", ids=number)
        properties = whole([fields[field] for fields in rows], name, "0", number) if field else None
        corners = CORNERS.get(shape, most)
        second = (nodes[:, corners:] != 0).any(axis=1)
        for mask, width in ((~second, corners), (second, most)):
            if not mask.any():
                continue
            file.blocks.append(Block(shape, number[mask], nodes[mask, :width]))
            ids.append(number[mask])
            if properties is not None:
                mine = properties[mask]
                for value in np.unique(mine).tolist():
                    of_property.setdefault(value, []).append(row + np.flatnonzero(mine == value))
            row += int(mask.sum())
    for value, parts in sorted(of_property.items()):
        file.element_sets[f"pid {value}"] = np.unique(np.concatenate(parts))
    file_ids = np.concatenate(ids)
    ordered = np.sort(file_ids)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    if len(twice):
        raise SceneError(f"element {twice[0]} is repeated")


def sets(file: MeshFile, cards, control: list[str]):
    nodes: dict[str, list[np.ndarray]] = {}
    members: dict[str, list[np.ndarray]] = {}
    text = "\n".join(control)
    for match in re.finditer(r"(?im)^\s*SET\s+(\d+)\s*=((?:.*,\s*\n)*.*)", text):
        ids = listed(re.sub(r"[,\s]+", " ", match[2]).split(), f"SET {match[1]}")
        nodes.setdefault(match[1], []).append(ids)
        members.setdefault(match[1], []).append(ids)
    for fields in cards["SET1"]:
        ids = listed(filled(fields[1:]), f"SET1 {fields[0].strip()}")
        nodes.setdefault(fields[0].strip(), []).append(ids)
        members.setdefault(fields[0].strip(), []).append(ids)
    for name, first in (("SET3", 2), ("SET", 3)):
        for fields in cards[name]:
            kind = fields[1].strip().upper()
            target = nodes if kind in ("GRID", "POINT", "NODE") else members if kind.startswith("ELEM") else None
            # OptiStruct's SET lists ids behind the line that names it
            rest = fields[8:] if name == "SET" and not "".join(fields[3:8]).strip() else fields[first:]
            if target is not None and fields[0].strip():
                ids = listed(filled(rest), f"{name} {fields[0].strip()}")
                target.setdefault(fields[0].strip(), []).append(ids)
    element_id = np.concatenate([np.empty(0, np.int64), *(block.ids for block in file.blocks)])
    for number, parts in nodes.items():
        file.node_sets[f"set {number}"] = np.unique(np.concatenate(parts))
    for number, parts in members.items():
        ids = np.unique(np.concatenate(parts))
        rows = find(element_id, ids)
        if (rows < 0).any():
            file.element_sets[f"set {number}"] = SceneError(f"element {ids[rows < 0][0]} is not in the file")
        else:
            file.element_sets[f"set {number}"] = rows


def filled(fields: list[str]) -> list[str]:
    return [item.strip().upper() for item in fields if item.strip()]


def listed(words: list[str], name: str) -> np.ndarray:
    """Ids of "1 2 5 THRU 9 EXCEPT 7 8 12": what follows EXCEPT and lies in the range is left out."""
    ids: list[np.ndarray] = []
    left_out: set[int] = set()
    k, in_range = 0, None
    words = [word.upper() for word in words]
    while k < len(words):
        word = words[k]
        if word in ("THRU", "EXCEPT", "BY", "ALL") and not (word == "THRU" and ids and k + 1 < len(words)):
            raise SceneError(f"{name}: '{word}' where an id was expected")
        if word != "THRU":
            ids.append(whole([word], name))
            k += 1
            continue
        first, last = int(ids.pop()[-1]), int(whole([words[k + 1]], name)[0])
        if last - first > MOST:
            raise SceneError(f"{name}: {first} to {last} is more than a file can hold")
        k += 2
        step = 1
        if words[k : k + 1] == ["BY"] and k + 1 < len(words):
            step = max(int(whole([words[k + 1]], name)[0]), 1)
            k += 2
        in_range = np.arange(first, last + 1, step)
        if words[k : k + 1] == ["EXCEPT"]:
            k += 1
            while k < len(words) and words[k].isdecimal() and first <= int(words[k]) <= last:
                left_out.add(int(words[k]))
                k += 1
            in_range = np.setdiff1d(in_range, list(left_out))
        ids.append(in_range)
    return np.concatenate([np.empty(0, np.int64), *ids])


def whole(items: list[str], name: str, blank: str = "", ids: np.ndarray | None = None) -> np.ndarray:
    """name: of the card, ids: of the cards that the items stand in; for messages."""
    try:
        return fortran_whole(items, blank)
    except FieldError as error:
        raise in_card(error, name, ids) from None


def numbers(items: list[str], name: str, ids: np.ndarray | None = None) -> np.ndarray:
    """Numbers as Nastran writes them (1.5-3 and 1.D0); blank: 0."""
    try:
        return fortran_numbers(items)
    except FieldError as error:
        raise in_card(error, name, ids) from None


def in_card(error: FieldError, name: str, ids: np.ndarray | None) -> SceneError:
    return SceneError(f"{name if ids is None else f'{name} {ids[error.index]}'}: {error}")
