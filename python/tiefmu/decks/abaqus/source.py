"""An input file with its parts in place: names of sets, instances and nodes as its keywords use them."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..._core import SceneError
from ...mesh.abaqus import InputFile, SetLine
from ...mesh.abaqus_assembly import Assembly, Scope
from ...mesh.abaqus_cards import Block
from ..model import Deck

NONE = np.empty(0, np.int64)


class Source:
    """deck: with nodes; rows count the elements through all blocks of the assembly."""

    def __init__(self, path: Path, file: str):
        try:
            self.input = InputFile(path, file)
            self.assembly = Assembly(self.input)
            self.mesh = self.assembly.mesh_file()
        except OSError as error:
            raise SceneError(f"{file}: {error.strerror or error}") from None
        except SceneError as error:
            words = str(error)
            raise error if "line " in words.split(": *")[0] else SceneError(f"{file}: {words}") from None
        self.deck = Deck(file, "Abaqus", shape_lumping=True)
        self.deck.node_id, self.deck.position = self.mesh.node_id, self.mesh.position
        self.deck.notes += self.mesh.notes
        self.element_id = self.assembly.element_id
        # by elements.py: node indices of each block; part and thickness of each row
        self.nodes_of_block: list[np.ndarray] = []
        self.part_of_row = np.zeros(len(self.element_id), np.int64)
        self.thickness_of_row = np.zeros(len(self.element_id))

    def cards(self, *keys: str) -> Iterator[tuple[Scope, Block]]:
        """Blocks of these keywords (without blanks; all where none is given), once for each instance of their part."""
        for scope in self.assembly.scopes:
            for part in scope.content:
                for block in part.other_cards:
                    if not keys or block.key in keys:
                        yield scope, block

    def steps(self) -> int:
        return max((block.step for block in self.input.root.other_cards), default=0)

    def nodes(self, scope: Scope, word: str, block: Block, line: int | None = None) -> np.ndarray:
        """Node indices of an id, a set, INSTANCE.SET or INSTANCE.17."""
        ids = self.members("node_sets", scope, word, block, line)
        return self.deck.nodes(ids, block.where if line is None else block.at(line))

    def rows(self, scope: Scope, word: str, block: Block, line: int | None = None) -> np.ndarray:
        """Rows of the elements of an id, a set or INSTANCE.SET."""
        ids = self.members("element_sets", scope, word, block, line)
        try:
            return self.assembly.rows_of(ids)
        except SceneError as error:
            block.fail(str(error), line)

    def members(self, which: str, scope: Scope, word: str, block: Block, line: int | None) -> np.ndarray:
        if not word:
            block.fail("a name is missing", line)
        number = word.isdecimal() and len(word) <= 18
        wanted = SetLine(np.array([int(word)]) if number else NONE, [] if number else [word])
        try:
            return self.assembly.members(which, scope, wanted)
        except LookupError:
            block.fail(f"there is no set '{word}'", line)
        except SceneError as error:
            block.fail(f"set '{word}': {error}" if f"'{word}'" not in str(error) else str(error), line)

    def has(self, which: str, scope: Scope, name: str) -> bool:
        """Whether there is such a set or surface."""
        try:
            self.assembly.defined(which, scope, name)
        except LookupError:
            return False
        return True


def option_nodes(source: Source, scope: Scope, block: Block, *options: str) -> np.ndarray:
    """Nodes of the sets that the options name."""
    found = [NONE]
    for option in options:
        if block.get(option):
            found.append(source.nodes(scope, block.get(option), block))
    return np.unique(np.concatenate(found))
