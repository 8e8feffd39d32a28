"""The table of a sweep: a row a case, in the order of the cases."""

import csv
import json
from pathlib import Path

from ..errors import UsageError
from ..results import needed

FORMATS = (".parquet", ".csv")


def check(path: Path, signals: bool) -> None:
    """Raises UsageError where it cannot be written."""
    if path.suffix.lower() not in FORMATS:
        raise UsageError(f"{path}: a sweep is written as {', '.join(FORMATS)}; the ending chooses")
    if path.suffix.lower() == ".csv" and signals:
        raise UsageError(f"{path}: signals over time need .parquet")
    if path.suffix.lower() == ".parquet":
        needed("pyarrow", "sweep", path)


def alike(values: list) -> list:
    """A column has one type: values of several become their text, as JSON has it."""
    kinds = {float if type(value) is int else type(value) for value in values}
    return values if len(kinds) < 2 and not kinds & {list, dict} else [json.dumps(value) for value in values]


def write(path: Path, parameters: dict[str, list], rows: list[dict]) -> None:
    """parameters: title -> a value a case; rows: what a case gave; a number that it did not give is missing."""
    parameters = {name: alike(values) for name, values in parameters.items()}
    names = list(dict.fromkeys(name for row in rows for name in row if name not in ("message", "passed")))
    columns: dict[str, list] = {"case": list(range(len(rows))), **parameters}
    if any("passed" in row for row in rows):
        columns["passed"] = [row.get("passed") for row in rows]
    columns |= {name: [row.get(name) for row in rows] for name in names}
    columns["message"] = [row["message"] for row in rows]
    part = path.with_name(f".{path.name}.part")
    if path.suffix.lower() == ".csv":
        with open(part, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*columns.values()))
    else:
        import pyarrow
        import pyarrow.parquet

        pyarrow.parquet.write_table(pyarrow.table(columns), part)
    part.replace(path)
