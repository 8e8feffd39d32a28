"""Finished cases on disk, so that an interrupted sweep can go on: lines of JSON, the first says of what sweep."""

import json
from pathlib import Path
from typing import Any

from ..errors import UsageError


class Journal:
    """Rows by case; numbers read back to the same doubles."""

    def __init__(self, path: Path, sweep: str, resume: bool):
        """sweep: a digest of all that decides on the results. Raises UsageError where it is of another sweep."""
        self.path, self.rows = path, {}
        if resume and path.is_file():
            lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
            if not lines or json.loads(lines[0]).get("sweep") != sweep:
                raise UsageError(f"{path}: is of another sweep; leave --resume out, and it starts anew")
            for line in lines[1:]:
                if line.endswith("\n"):  # the last one may be cut
                    number, row = json.loads(line)
                    self.rows[number] = row
            whole = [line for line in lines if line.endswith("\n")]
            path.write_text("".join(whole), encoding="utf-8")
        else:
            path.write_text(json.dumps({"sweep": sweep}) + "\n", encoding="utf-8")
        self._file: Any = open(path, "a", encoding="utf-8")  # noqa: SIM115

    def add(self, rows: list[tuple[int, dict]]) -> None:
        for number, row in rows:
            self.rows[number] = row
            self._file.write(json.dumps([number, row]) + "\n")
        self._file.flush()

    def close(self) -> None:
        self._file.close()
