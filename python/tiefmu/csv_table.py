"""CSV files as loggers, spreadsheets and test systems write them."""

import csv
import io
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .errors import RunError, one_line

DELIMITERS = (",", ";", "\t")
PREAMBLE = 100  # lines at most that may stand above the header
SECONDS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "min": 60.0}


@dataclass
class CsvTable:
    """names: of the columns; values: (rows, columns); unit: that the file gives its times, a key of SECONDS or ''."""

    names: list[str]
    values: np.ndarray
    unit: str


def read_table(
    path: Path,
    check: Callable[[list[str]], Any],
    wanted: Sequence[str] | None = None,
    clock: str = "time",
    cure: str = "",
) -> CsvTable:
    """Finite numbers over times that do not decrease, in the order of the file.

    Cells are parted by commas, semicolons or tabs; where those are no commas, a comma may stand for the point of a
    number. The header is the first line that has a cell `clock`, the column of times; a line of units may follow it.
    check(header) may refuse it. wanted: columns to read besides, of which an empty cell leaves out the row; None: all,
    without a gap. cure: what a missing clock is answered with. Raises RunError, which names the line.
    """
    lines = text_lines(path)
    header, first, delimiter = header_of(path, lines, clock, cure)
    repeated = next((name for name in header if name and header.count(name) > 1), None)
    if repeated is not None:
        raise RunError(f"{path}: column '{repeated}' is repeated")
    check(header)
    reader = csv.reader(lines[first + 1 :], delimiter=delimiter, skipinitialspace=True)
    try:
        rows = [(first + 1 + reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except csv.Error as error:
        raise RunError(f"{path}: not a CSV file: {one_line(error)}") from None
    unit = unit_in(clock)
    if rows and are_units(rows[0][1], header.index(clock), delimiter):
        unit = unit_in(rows.pop(0)[1][header.index(clock)], alone=True) or unit
    if not rows:
        raise RunError(f"{path}: has no values below its header")

    names = header if wanted is None else [name for name in header if name in {clock, *wanted}]
    columns = [header.index(name) for name in names]
    table, kept = [], []
    for line, row in rows:
        while len(row) > len(header) and not row[-1].strip():
            row.pop()
        if len(row) != len(header):
            raise RunError(f"{path}: line {line}: expected {len(header)} values, found {len(row)}")
        if wanted is not None and not all(row[column].strip() for column in columns):
            continue
        table.append([finite(path, line, header[column], row[column], delimiter) for column in columns])
        kept.append(line)
    if not table:
        raise RunError(f"{path}: no line has values of {' and '.join(names)}")
    values = np.array(table)
    time = values[:, names.index(clock)]
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        raise RunError(
            f"{path}: line {kept[back[0] + 1]}: time goes back from {time[back[0]]:g} to "
            f"{time[back[0] + 1]:g} s; times must not decrease"
        )
    return CsvTable(names, values, unit)


def text_lines(path: str | Path) -> list[str]:
    """Of UTF-8, of UTF-16 with its mark, or of the Western code page of Windows. Raises RunError."""
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise RunError(f"{path}: no such file") from None
    except OSError as error:
        raise RunError(f"{path}: {error.strerror}") from None
    marked = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    if b"\0" in data and not marked:
        raise RunError(f"{path}: not a CSV file: holds zero bytes, as binary files do")
    try:
        text = data.decode("utf-16" if marked else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    return io.StringIO(text, newline="").readlines()


def header_of(path: Path, lines: list[str], clock: str, cure: str) -> tuple[list[str], int, str]:
    """Names of the columns, place of their line, what parts them. Raises RunError."""
    full = [k for k, line in enumerate(lines) if line.strip()]
    if not full:
        raise RunError(f"{path}: is empty; expected a header with '{clock}' and names of columns")
    for k in full[:PREAMBLE]:
        for delimiter in DELIMITERS:
            names = cells(path, lines[k], delimiter)
            if clock in names:
                while not names[-1]:  # of a delimiter at the end of the line
                    names.pop()
                return names, k, delimiter
    lists = [cells(path, lines[k], delimiter) for k in full[:PREAMBLE] for delimiter in DELIMITERS]
    names = max(lists, key=lambda names: sum(map(bool, names)))  # the first of the longest
    raise RunError(f"{path}: has no column '{clock}'; found {', '.join(names[:6])}{cure}")


def cells(path: Path, line: str, delimiter: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
    except csv.Error as error:
        raise RunError(f"{path}: not a CSV file: {one_line(error)}") from None


def are_units(row: list[str], clock: int, delimiter: str) -> bool:
    """Whether a row holds units and no values: no number at all, or a unit in place of the time."""
    if clock < len(row) and unit_in(row[clock], alone=True):
        return True
    return all(number(cell, delimiter) is None for cell in row)


def unit_in(text: str, alone: bool = False) -> str:
    """The unit of time in a text: 's', '[ms]', and, unless it stands alone, 'Time [ms]', 'time_ms', 'Zeit / s'."""
    pattern = r"[\[(]?([A-Za-zµμ]+)[\])]?" if alone else r".*(?:[\[(]|/ ?|_)([A-Za-zµμ]+)[\])]?"
    match = re.fullmatch(pattern, text.strip())
    return match[1] if match and match[1] in SECONDS else ""


def number(cell: str, delimiter: str) -> float | None:
    try:
        return float(cell if delimiter == "," else cell.replace(",", "."))
    except ValueError:
        return None


def finite(path: Path, line: int, name: str, cell: str, delimiter: str) -> float:
    value = number(cell, delimiter)
    if value is None:
        raise RunError(f"{path}: line {line}: {name}: expected a number, found '{cell}'")
    if not math.isfinite(value):
        raise RunError(f"{path}: line {line}: {name}: {cell} is not a finite number")
    return value
