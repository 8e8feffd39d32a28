"""A table of node properties beside the scene: what [[node]] tables say, for thousands of nodes, one row each.

CSV: a first line with the names of the columns, then one line a node; commas between, an empty field sets nothing,
lines that start with # are comments. npz (numpy.savez): one array of n entries per column, of the same names; nan in
an array of numbers and '' in one of texts set nothing. Columns, in any order: id, and what there is of mass, inertia,
stiffness, rotational_stiffness (numbers in the scene's units, 0 or more), motion (driven, free, fixed) and rotations
(true or false, also 1 or 0).
"""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .._core import Motion, SceneError
from ..schema import LARGEST, found, shortened, suggestion
from .arrays import load_npz
from .data import find, span

NUMBERS = ("mass", "inertia", "stiffness", "rotational_stiffness")
MOTIONS = tuple(motion.name for motion in Motion)
COLUMNS = ("id", *NUMBERS, "motion", "rotations")
WORDS: dict[str, dict[str, Any]] = {
    "motion": {name: number for number, name in enumerate(MOTIONS)},
    "rotations": {"true": True, "false": False, "1": True, "0": False},
}
EXPECTED = {"motion": "driven, free or fixed", "rotations": "true or false"}


@dataclass
class Column:
    """One property: of which nodes (indices in the mesh), and its values, in the units of the scene; motion as index
    in MOTIONS, rotations as bool."""

    nodes: np.ndarray
    values: np.ndarray


def read(path: Path, name: str, node_id: np.ndarray) -> dict[str, Column]:
    """Column name -> what it sets of the nodes `node_id`; `name` is how messages call the file."""
    try:
        table = read_npz(path) if path.suffix.lower() == ".npz" else read_csv(path)
        return table.columns(node_id)
    except SceneError as error:
        raise SceneError(f"mesh: properties: {name}: {error}") from None
    except OSError as error:
        raise SceneError(f"mesh: properties: {name}: {error.strerror or error}") from None


@dataclass
class Table:
    """Columns as they stand in the file: lists of texts, or arrays, of one length."""

    raw: dict
    lines: list[int] | None  # of a CSV file

    def where(self, row: int, column: str) -> str:
        return (
            f"{'row' if self.lines is None else 'line'} {row + 1 if self.lines is None else self.lines[row]}: {column}"
        )

    def columns(self, node_id: np.ndarray) -> dict[str, Column]:
        unknown = next((key for key in self.raw if key not in COLUMNS), None)
        if unknown is not None:
            raise SceneError(f"unknown column '{shortened(unknown)}'{suggestion(unknown, COLUMNS)}")
        if "id" not in self.raw:
            raise SceneError("has no column 'id'")
        ids = self.ids(self.raw["id"])
        nodes = find(node_id, ids)
        missing = np.flatnonzero(nodes < 0)
        if len(missing):
            row = int(missing[0])
            raise SceneError(f"{self.where(row, 'id')}: node {ids[row]} is not in the mesh{span(node_id)}")
        order = np.argsort(nodes, kind="stable")
        twice = order[1:][nodes[order][1:] == nodes[order][:-1]]
        if len(twice):
            row = int(twice.min())
            raise SceneError(f"{self.where(row, 'id')}: node {ids[row]} is repeated")
        found_columns = {}
        for key, column in self.raw.items():
            if key != "id":
                given, values = (self.numbers if key in NUMBERS else self.words)(key, column)
                found_columns[key] = Column(nodes[given], values)
        return found_columns

    def ids(self, column) -> np.ndarray:
        try:
            if isinstance(column, np.ndarray) and column.dtype.kind not in "iu":
                raise ValueError
            ids = np.array(list(map(int, column)), np.int64)
            if ids.min(initial=1) < 1:
                raise ValueError
        except (ValueError, OverflowError):
            row, item = next((row, item) for row, item in enumerate(column) if not is_id(item))
            raise SceneError(
                f"{self.where(row, 'id')}: expected an id (a whole number from 1), found {found(plain(item))}"
            ) from None
        return ids

    def numbers(self, key: str, column) -> tuple[np.ndarray, np.ndarray]:
        """Rows that set the property, and its values there."""
        if isinstance(column, np.ndarray):
            if column.dtype.kind not in "iuf":
                raise SceneError(f"{key}: expected numbers, found an array of type {column.dtype}")
            values = column.astype(float)
            given = np.flatnonzero(~np.isnan(values))
            values = values[given]
        else:
            given = np.array([row for row, item in enumerate(column) if item], int)
            items = [item for item in column if item]
            try:
                values = np.array(list(map(float, items)), float)
            except ValueError:
                row = next(row for row in given.tolist() if not is_float(column[row]))
                raise SceneError(f"{self.where(row, key)}: expected a number, found {found(column[row])}") from None
        for bad, words in (
            (~np.isfinite(values), "is not a finite number"),
            (values < 0, "is negative; it must be 0 or more"),
            (values > LARGEST, f"is too large; it must be at most {LARGEST:g}"),
        ):
            if bad.any():
                first = int(np.argmax(bad))
                raise SceneError(f"{self.where(given[first], key)}: {values[first]:g} {words}")
        return given, values

    def words(self, key: str, column) -> tuple[np.ndarray, np.ndarray]:
        """The same for columns of words."""
        if isinstance(column, np.ndarray):
            column = list(map(str, column.tolist()))
        known = WORDS[key]
        items = [item.strip().lower() for item in column]
        given = [row for row, item in enumerate(items) if item]
        try:
            return np.array(given, int), np.array([known[items[row]] for row in given])
        except KeyError:
            row = next(row for row in given if items[row] not in known)
            raise SceneError(f"{self.where(row, key)}: expected {EXPECTED[key]}, found {found(column[row])}") from None


def read_csv(path: Path) -> Table:
    lines, rows, header = [], [], None
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file, skipinitialspace=True)
        try:
            for row in reader:
                if not row or row[0].startswith("#") or not any(row):
                    continue
                if header is None:
                    header = [item.strip() for item in row]
                    continue
                if len(row) != len(header):
                    raise SceneError(
                        f"line {reader.line_num}: has {len(row)} fields, the first line names {len(header)}"
                    )
                rows.append(row)
                lines.append(reader.line_num)
        except UnicodeDecodeError as error:
            raise SceneError(f"not a text file (byte {error.start} is not UTF-8)") from None
        except csv.Error as error:
            raise SceneError(f"line {reader.line_num}: {error}") from None
    if header is None:
        raise SceneError("is empty; its first line names the columns: id, mass, ...")
    twice = next((key for number, key in enumerate(header) if key in header[:number]), None)
    if twice is not None:
        raise SceneError(f"column '{shortened(twice)}' is repeated")
    columns = [[item.strip() for item in column] for column in zip(*rows)] or [[] for _ in header]
    return Table(dict(zip(header, columns)), lines)


def read_npz(path: Path) -> Table:
    arrays = load_npz(path)
    rows = {array.shape for array in arrays.values()}
    if len(rows) > 1 or any(len(shape) != 1 for shape in rows):
        raise SceneError("its columns are no arrays of one length")
    return Table(arrays, None)


def is_float(item: str) -> bool:
    try:
        float(item)
    except ValueError:
        return False
    return True


def is_id(item) -> bool:
    try:
        return not isinstance(item, (float, np.floating, bool, np.bool_)) and 1 <= int(item) < 2**63
    except (ValueError, OverflowError):
        return False


def plain(item):
    return item.item() if isinstance(item, np.generic) else item
