"""Loading what stands for a scene: a TOML file, a deck or a dict."""

import os
from collections.abc import Sequence
from pathlib import Path

from . import decks, schema
from ._core import SceneError
from .scene import Scene, escaped, plain, read_toml


def load(source, expose: Sequence[str] = (), folder: Path | None = None, positions: bool = False) -> Scene:
    """Reads, checks and compiles a scene.

    source: path of a TOML file or of a deck (decks/), or a dict of the same shape (NumPy arrays may stand for lists;
    messages call it "scene"; a mesh file is taken relative to `folder`, by default the current one). expose: added to
    [interface] expose of a TOML file or a dict. positions: the FMU shows where all nodes are that have variables of
    their own. Raises SceneError, one line "FILE: table: id: message", on the first thing that is wrong.
    """
    if isinstance(source, dict):
        file, name, folder = "scene", "scene", folder or Path(".")
    else:
        file, name, folder = os.fspath(source), Path(source).stem, Path(source).parent
        if decks.is_deck(Path(source)):
            return decks.load(Path(source), positions=positions)
    try:
        raw = plain(source) if isinstance(source, dict) else read_toml(Path(source))
        tables = schema.parse(raw)
        tables.interface.expose += [name for name in expose if name not in tables.interface.expose]
        again = tables.model_copy(deep=True)
        scene = Scene(file, name, tables, folder)
        if positions and scene.hidden_positions():
            again.interface.expose += scene.hidden_positions()
            scene = Scene(file, name, again, folder)
        return scene
    except SceneError as error:
        raise SceneError(escaped(f"{file}: {error}")) from None
