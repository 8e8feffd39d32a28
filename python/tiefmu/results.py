"""What a run leaves: rows in memory as far as they fit, extremes, and files that are written while it goes on."""

import contextlib
import importlib.util
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .errors import UsageError

MOST_KEPT = 2**29  # bytes of rows kept in memory; of longer runs every k-th row


@dataclass
class Result:
    """Outputs of a run over time.

    names, units: of the outputs; rows: (kept, 1 + outputs), time first; every: one row in how many is kept (and the
    last one); steps: made; low, high, last: over all rows, (1 + outputs,); seconds: of wall time, in the stepping.
    """

    names: list[str]
    units: dict[str, str]
    rows: np.ndarray
    steps: int
    every: int = 1
    low: np.ndarray = field(default_factory=lambda: np.empty(0))
    high: np.ndarray = field(default_factory=lambda: np.empty(0))
    last: np.ndarray = field(default_factory=lambda: np.empty(0))
    seconds: float = 0.0

    def __post_init__(self):
        self.columns = {name: 1 + k for k, name in enumerate(self.names)} | {"time": 0}

    def __getitem__(self, name: str) -> np.ndarray:
        """Kept values of an output, or of `time`."""
        return self.rows[:, self.columns[name]]

    def largest(self, name: str) -> float:
        """Largest magnitude over all rows; nan if one is."""
        k = self.columns[name]
        return float(np.maximum(abs(self.low[k]), abs(self.high[k])))


class Kept:
    """Collects a Result from blocks of rows."""

    def __init__(self, names: list[str], units: dict[str, str], rows: float):
        """rows: expected, about."""
        self.names, self.units = names, units
        self.every = max(1, int(np.ceil(rows * 8 * (1 + len(names)) / MOST_KEPT)))
        self.count, self.kept = 0, []
        self.low = np.full(1 + len(names), np.inf)
        self.high = -self.low
        self.last = np.empty((1, 1 + len(names)))

    def write(self, block: np.ndarray) -> None:
        self.low = np.minimum(self.low, block.min(axis=0))
        self.high = np.maximum(self.high, block.max(axis=0))
        first = -self.count % self.every
        self.kept.append(block if self.every == 1 else block[first :: self.every].copy())
        self.count += len(block)
        self.last = block[-1:].copy()

    def result(self, seconds: float) -> Result:
        if self.every > 1 and (self.count - 1) % self.every:
            self.kept.append(self.last)
        rows = self.kept[0] if len(self.kept) == 1 else np.concatenate(self.kept)
        return Result(
            self.names, self.units, rows, self.count - 1, self.every, self.low, self.high, self.last[0], seconds
        )


# --------------------------------------------------------------------------------------------------------------- files


class CsvFile:
    """A header of names, then a line a row; every number reads back to the same double."""

    def __init__(self, path: Path, names: list[str], units: dict[str, str]):
        self.file = open(path, "w", newline="", encoding="utf-8")  # noqa: SIM115
        self.file.write(",".join(["time", *names]) + "\n")

    def write(self, block: np.ndarray) -> None:
        for row in block:
            self.file.write(",".join(map(repr, row.tolist())) + "\n")

    def close(self) -> None:
        self.file.close()


class ParquetFile:
    """A column of doubles each for `time` and the outputs; metadata of a column: its unit."""

    def __init__(self, path: Path, names: list[str], units: dict[str, str]):
        import pyarrow
        import pyarrow.parquet

        self.arrow = pyarrow
        self.schema = pyarrow.schema(
            [pyarrow.field("time", pyarrow.float64(), metadata={"unit": "s"})]
            + [pyarrow.field(name, pyarrow.float64(), metadata={"unit": units[name]}) for name in names]
        )
        self.file = pyarrow.parquet.ParquetWriter(path, self.schema)

    def write(self, block: np.ndarray) -> None:
        columns = [self.arrow.array(column) for column in np.ascontiguousarray(block.T)]
        self.file.write_table(self.arrow.Table.from_arrays(columns, schema=self.schema))

    def close(self) -> None:
        self.file.close()


class Hdf5File:
    """Datasets `time` (rows,), `values` (rows, outputs), `names` and `units` (outputs,), compressed."""

    def __init__(self, path: Path, names: list[str], units: dict[str, str]):
        import h5py

        self.file = h5py.File(path, "w")
        text = h5py.string_dtype()
        self.file.create_dataset("names", data=names, dtype=text)
        self.file.create_dataset("units", data=[units[name] for name in names], dtype=text)
        rows = max(1, min(256, 2**20 // (8 * max(len(names), 1))))
        chunk = (rows, max(1, min(len(names), 2**17)))
        packed: Any = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        self.time = self.file.create_dataset("time", (0,), float, maxshape=(None,), chunks=(4096,), **packed)
        self.values = self.file.create_dataset(
            "values", (0, len(names)), float, maxshape=(None, len(names)), chunks=chunk if names else None, **packed
        )

    def write(self, block: np.ndarray) -> None:
        first = len(self.time)
        self.time.resize(first + len(block), axis=0)
        self.values.resize(first + len(block), axis=0)
        self.time[first:] = block[:, 0]
        self.values[first:] = block[:, 1:]

    def close(self) -> None:
        self.file.close()


# ending -> (class, module it needs, extra of tiefmu that brings it)
FORMATS: dict[str, tuple[Any, str | None, str | None]] = {
    ".csv": (CsvFile, None, None),
    ".parquet": (ParquetFile, "pyarrow", "parquet"),
    ".h5": (Hdf5File, "h5py", "hdf5"),
    ".hdf5": (Hdf5File, "h5py", "hdf5"),
}


def check_format(path: Path) -> None:
    """Raises UsageError where the ending says no format, or one that needs what is not installed."""
    if path.suffix.lower() not in FORMATS:
        raise UsageError(f"{path}: results are written as {', '.join(FORMATS)}; the ending chooses")
    _, module, extra = FORMATS[path.suffix.lower()]
    if module:
        needed(module, extra, path)


def needed(module: str, extra: str | None, what) -> None:
    """Raises UsageError where an optional package is missing: names it and the extra that brings it."""
    if importlib.util.find_spec(module) is None:
        raise UsageError(f"{what}: needs the package {module}: pip install 'tiefmu[{extra}]'")


@contextlib.contextmanager
def writer(path: Path, names: list[str], units: dict[str, str]) -> Iterator[Any]:
    """A file to write blocks to. It appears under its name when all is written; nothing is left when that fails.
    Raises UsageError, OSError."""
    check_format(path)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        file = FORMATS[path.suffix.lower()][0](part, names, units)
        try:
            yield file
        finally:
            file.close()
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
