"""The files of an imported scene: NAME.toml, NAME.mesh.npz and NAME.nodes.csv."""

import csv
import io
import os
import textwrap
from pathlib import Path

import numpy as np

from .._core import SceneError
from ..mesh import arrays
from ..scene_file import toml_text
from .model import Deck


def remarks(deck: Deck) -> list[str]:
    """What was decided and what was left aside, a line each."""
    return deck.notes + [f"{name} ({count}) left aside: {why}" for name, (why, count) in sorted(deck.ignored.items())]


def files(found, folder: Path, name: str, to_keep: bool = True) -> dict:
    """Writes mesh and node properties to `folder`; returns the tables of the scene, which name them. to_keep: small
    and to be read by people, else quickly."""
    written = found.scene
    mesh, nodes = f"{name}.mesh.npz", f"{name}.nodes.{'csv' if to_keep else 'npz'}"
    arrays.write(
        folder / mesh,
        written.node_id,
        written.position,
        written.segment_id,
        written.segments,
        written.node_sets,
        written.segment_sets,
        to_keep,
    )
    if to_keep:
        (folder / nodes).write_text(table(written.columns), encoding="utf-8")
    else:
        with (folder / nodes).open("wb") as file:
            np.savez(file, **written.columns)
    tables = dict(written.tables)
    head = {key: tables.pop(key) for key in ("title", "units") if key in tables}
    return head | {"mesh": {"file": mesh, "properties": nodes}} | tables


def table(columns: dict) -> str:
    """Columns as CSV; numbers in the shortest form that reads back to the same double, 0 as empty field."""
    rows = [
        ["" if item == 0 else item for item in column.tolist()] if column.dtype.kind == "f" else column.tolist()
        for column in columns.values()
    ]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*rows))
    return text.getvalue()


def scene(found, path: Path):
    """Writes the scene file, its mesh and its node properties."""
    try:
        tables = files(found, path.parent, path.stem)
        text = head(found.deck) + toml_text(tables)
        part = path.with_name(f".{path.name}.{os.getpid()}.part")
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror or error}") from None


def head(deck: Deck) -> str:
    """Comments: where the scene comes from, what was decided and why, what to look at."""
    name = Path(deck.file).name
    lines = [f"# Ties of {name} ({deck.language}), written by tiefmu import."]
    for title, entries in (("Decided", remarks(deck)), ("Look at", deck.warnings)):
        if entries:
            lines += ["#", f"# {title}:"]
        for entry in entries:
            entry = "".join(c if c.isprintable() else " " for c in entry.replace(deck.file, name))
            lines += textwrap.wrap(entry, 116, initial_indent="# - ", subsequent_indent="#   ", break_long_words=False)
    return "\n".join(lines) + "\n\n"
