"""Finished cases on disk, so that an interrupted sweep can go on: lines of JSON, the first says of what sweep."""

import json
from pathlib import Path
from typing import Any

from ..errors import UsageError


class Journal:
    """Rows by case; numbers read back to the same doubles."""

    def __init__(self, path: Path, sweep: str, resume: bool):
        """sweep: a digest of all that decides on the results. Raises UsageError where it is of another sweep, or is
        damaged, or holds cases that would be lost as nobody asked to resume."""
        self.path, self.rows = path, {}
        lines = path.read_bytes().splitlines(keepends=True) if path.is_file() else []
        whole = [line for line in lines if line.endswith(b"\n")]  # the last one may be cut
        if not resume and len(whole) > 1:
            raise UsageError(
                f"{path}: holds {len(whole) - 1} finished cases of an interrupted sweep; --resume goes on with them, "
                "without this file it starts anew"
            )
        if resume and whole:
            for number, line in enumerate(whole, 1):
                try:
                    self._take(json.loads(line), sweep if number == 1 else None)
                except UsageError:
                    raise
                except (ValueError, TypeError):
                    raise UsageError(f"{path}: line {number}: is damaged; remove it to lose but its case") from None
            path.write_bytes(b"".join(whole))
        else:
            path.write_text(json.dumps({"sweep": sweep}) + "\n", encoding="utf-8")
        self._file: Any = open(path, "a", encoding="utf-8")  # noqa: SIM115

    def _take(self, entry: Any, sweep: str | None) -> None:
        """sweep: of the first line. Raises ValueError, TypeError of what was not written here; UsageError."""
        if sweep is None:
            number, row = entry
            self.rows[int(number)] = dict(row)
        elif not isinstance(entry, dict) or entry.get("sweep") != sweep:
            raise UsageError(f"{self.path}: is of another sweep; without this file it starts anew")

    def add(self, rows: list[tuple[int, dict]]) -> None:
        self._file.write("".join(json.dumps([number, row]) + "\n" for number, row in rows))
        self._file.flush()
        self.rows |= dict(rows)

    def close(self) -> None:
        self._file.close()
