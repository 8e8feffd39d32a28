"""Puts the parts of an Abaqus file in their places and resolves its sets and surfaces.

Ids: those of the file, where they are unique through all instances; else instance k (from 0, in order) has k times a
power of ten added to its ids of nodes and elements, and what belongs to no instance the next multiple; a note says so.
Sets: those of the assembly by their names, those of an instance as INSTANCE.SET; where the assembly has no such set,
SET means that of all instances together.
"""

from pathlib import Path

import numpy as np

from .._core import SceneError
from ..schema import shortened
from . import abaqus_cards as cards
from .abaqus import InputFile, Instance, Part, SetLine, Surface
from .data import Block, MeshFile, Sets, find, refuse_repeated
from .faces import FACES

NONE = np.empty(0, np.int64)


def read(path: Path) -> MeshFile:
    return Assembly(InputFile(path)).mesh_file()


class Scope:
    """A part in its place: its content, what is added to its ids, and where it lies."""

    def __init__(self, name: str, content: list[Part], instance: Instance | None = None):
        self.name, self.content, self.instance, self.offset = name, content, instance, 0

    def node_ids(self) -> np.ndarray:
        return np.concatenate([NONE, *(ids for part in self.content for ids, *_ in part.nodes)])

    def element_ids(self) -> np.ndarray:
        return np.concatenate([NONE, *(block.ids for part in self.content for block in part.blocks)])

    def second_place(self, what: str) -> str:
        """How messages call the line that repeats an id."""
        if what == "node":
            pieces = [(ids, card) for part in self.content for ids, _, card in part.nodes]
        else:
            pieces = [(b.ids, card) for part in self.content for b, card in zip(part.blocks, part.element_cards)]
        known = NONE
        for ids, card in pieces:
            first = np.zeros(len(ids), bool)
            first[np.unique(ids, return_index=True)[1]] = True
            again = ~first | np.isin(ids, known)
            if again.any():
                row = int(np.argmax(again))
                return card.at(row) if len(card.lines) == len(ids) else card.where
            known = np.concatenate([known, ids])
        return ""

    def definitions(self, which: str) -> list[Sets]:
        return [getattr(part, which) for part in self.content]

    def names(self, which: str) -> list[str]:
        return [name for sets in self.definitions(which) for name in sets]


class Assembly:
    def __init__(self, file: InputFile):
        self.scopes, self.notes = [], []
        for instance in file.instances:
            part = file.parts.get(instance.part.upper())
            if part is None:
                raise SceneError(
                    f"{instance.where}: instance '{instance.own.name}': there is no part '{shortened(instance.part)}'"
                )
            self.scopes.append(Scope(instance.own.name, [part, instance.own], instance))
        if not file.instances:  # parts that no assembly places stand where they are
            self.scopes += [Scope(part.name, [part]) for part in file.parts.values()]
        self.by_name = {scope.name.upper(): scope for scope in self.scopes}
        if len(self.by_name) < len(self.scopes):
            names = [scope.name.upper() for scope in self.scopes]
            again = next(k for k, name in enumerate(names) if name in names[:k])
            where = file.instances[again].where if file.instances else ""
            raise SceneError(f"{where}: instance '{names[again]}' is repeated")
        self.root = Scope("", [file.root])
        self.scopes.append(self.root)
        self.make_unique()
        self.element_id, self.blocks = NONE, []
        self.order = NONE  # of element_id
        self.cards: list[cards.Block] = []  # of the blocks
        self.scope_of_block: list[Scope] = []
        self.busy: set[tuple] = set()  # sets being resolved, to find those that hold themselves
        self.known: dict[tuple, object] = {}

    def make_unique(self):
        nodes = [scope.node_ids() for scope in self.scopes]
        elements = [scope.element_ids() for scope in self.scopes]
        for what, lists in (("node", nodes), ("element", elements)):
            for ids, scope in zip(lists, self.scopes):
                try:
                    refuse_repeated(what, ids)
                except SceneError as error:
                    raise SceneError(f"{scope.second_place(what)}: {error}") from None
        if not any(repeats(np.concatenate(ids)) for ids in (nodes, elements)):
            return
        step = 10 ** len(str(max(int(ids.max(initial=0)) for ids in nodes + elements)))
        if step * len(self.scopes) >= 2**63:
            raise SceneError("ids of its instances are not unique, and too large to add something to them")
        told = []
        for number, scope in enumerate(self.scopes):
            scope.offset = number * step
            if number and (len(nodes[number]) or len(elements[number])):
                whose = f"'{scope.name}'" if scope.name else "the assembly itself"
                told.append(f"{scope.offset} to those of {whose}")
        self.notes.append(f"ids of its instances are not unique: added {', '.join(told)}")

    def mesh_file(self) -> MeshFile:
        position = [np.empty((0, 3))]
        for scope in self.scopes:
            for part in scope.content:
                position += [placed(x, scope.instance) for _, x, _ in part.nodes]
                for block in part.blocks:
                    nodes = np.where(block.nodes > 0, block.nodes + scope.offset, 0)
                    self.blocks.append(Block(block.shape, block.ids + scope.offset, nodes))
                    self.scope_of_block.append(scope)
                self.cards += part.element_cards
        self.element_id = np.concatenate([NONE, *(block.ids for block in self.blocks)])
        self.block_of = np.repeat(np.arange(len(self.blocks)), [len(block.ids) for block in self.blocks])
        first_row = np.cumsum([0, *(len(block.ids) for block in self.blocks)])
        self.first_row = first_row
        file = MeshFile(
            np.concatenate([scope.node_ids() + scope.offset for scope in self.scopes]),
            np.concatenate(position),
            self.blocks,
            notes=self.notes,
            instances={name: scope.offset for name, scope in self.by_name.items()},
        )
        file.node_sets = self.all_sets("node_sets", self.node_set)
        file.element_sets = self.all_sets("element_sets", self.rows)
        surfaces = self.all_sets("surfaces", self.surface)
        file.face_sets = Sets(any_case=True)
        for name in surfaces:
            try:
                kind, *value = surfaces[name]
            except SceneError as error:
                file.face_sets[name] = error
                continue
            if kind == "faces":
                file.face_sets[name] = tuple(value)
            elif name not in file.node_sets:
                file.node_sets[name] = value[0]
        return file

    def all_sets(self, which: str, resolve) -> Sets:
        """Every set of a kind by its names; those that cannot be resolved as their error."""
        sets = Sets(any_case=True)

        def put(name: str, values):
            try:
                sets[name] = values()
            except SceneError as error:
                sets[name] = error

        for name in self.root.names(which):
            put(name, lambda name=name: resolve(self.root, name))
        together = Sets(any_case=True)
        for scope in self.scopes[:-1]:
            for name in dict.fromkeys(map(str.upper, scope.names(which))):
                put(f"{scope.name}.{name}", lambda scope=scope, name=name: resolve(scope, name))
            for name in scope.names(which):
                if name not in sets:
                    if name not in together:
                        together[name] = []
                    if scope not in together[name]:
                        together[name].append(scope)
        for name in together:
            put(name, lambda name=name: combined([resolve(scope, name) for scope in together[name]]))
        return sets

    # definitions: in a scope, by name

    def defined(self, which: str, scope: Scope, name: str) -> tuple[Scope, list]:
        """The scope that has the set, and its definitions there; name may be INSTANCE.SET."""
        for place in (scope, self.root):
            lines = [sets[name] for sets in place.definitions(which) if name in sets]
            if lines:
                return place, lines
        instance, _, inner = name.partition(".")
        if inner and instance.upper() in self.by_name:
            return self.defined_in(which, self.by_name[instance.upper()], inner, name)
        raise LookupError(name)

    def defined_in(self, which: str, scope: Scope, inner: str, name: str) -> tuple[Scope, list]:
        lines = [sets[inner] for sets in scope.definitions(which) if inner in sets]
        if not lines:
            raise LookupError(name)
        return scope, lines

    def scope_of(self, scope: Scope, line: SetLine) -> Scope:
        if not line.instance:
            return scope
        if line.instance.upper() not in self.by_name:
            raise SceneError(f"there is no instance '{shortened(line.instance)}'")
        return self.by_name[line.instance.upper()]

    def resolve(self, which: str, scope: Scope, name: str, work):
        """work(place, definitions), kept, and never within itself."""
        key = which, scope.name, name.upper()
        if key not in self.known:
            if key in self.busy:
                raise SceneError(f"'{name}' holds itself")
            self.busy.add(key)
            try:
                self.known[key] = work(*self.defined(which, scope, name))
            finally:
                self.busy.discard(key)
        return self.known[key]

    def members(self, which: str, scope: Scope, line: SetLine) -> np.ndarray:
        """Ids, of nodes or elements, that a line of a set means."""
        scope = self.scope_of(scope, line)
        ids = [line.members + scope.offset]
        for name in line.names:
            if line.elements:
                ids.append(self.nodes_of(self.rows(scope, name)))
                continue
            try:
                ids.append(self.ids(which, scope, name))
            except LookupError:
                instance, _, number = name.partition(".")
                if instance.upper() not in self.by_name or not number.isdecimal() or len(number) > 18:
                    raise SceneError(f"'{name}' is neither an id nor a set") from None
                ids.append(np.array([int(number) + self.by_name[instance.upper()].offset]))
        return np.concatenate(ids)

    def ids(self, which: str, scope: Scope, name: str) -> np.ndarray:
        def work(place: Scope, definitions: list) -> np.ndarray:
            lines = [line for definition in definitions for line in definition]
            return np.unique(np.concatenate([NONE, *(self.members(which, place, line) for line in lines)]))

        return self.resolve(which, scope, name, work)

    def node_set(self, scope: Scope, name: str) -> np.ndarray:
        return self.ids("node_sets", scope, name)

    def rows(self, scope: Scope, name: str) -> np.ndarray:
        """Rows of the elements of a set."""
        try:
            return self.rows_of(self.ids("element_sets", scope, name))
        except LookupError:
            raise SceneError(f"there is no element set '{name}'") from None

    def rows_of(self, ids: np.ndarray) -> np.ndarray:
        if len(self.order) != len(self.element_id):
            self.order = np.argsort(self.element_id, kind="stable")
        rows = find(self.element_id, ids, self.order)
        if (rows < 0).any():
            raise SceneError(f"element {ids[rows < 0][0]} is not in the file")
        return rows

    def nodes_of(self, rows: np.ndarray) -> np.ndarray:
        found = [NONE]
        for number, block in enumerate(self.blocks):
            found.append(block.nodes[rows[self.block_of[rows] == number] - self.first_row[number]].ravel())
        nodes = np.unique(np.concatenate(found))
        return nodes[nodes != 0]

    def surface(self, scope: Scope, name: str) -> tuple:
        """("faces", rows, faces) as MeshFile.face_sets has them, or ("nodes", ids)."""

        def work(place: Scope, definitions: list[Surface]) -> tuple:
            parts = [self.one_surface(place, definition) for definition in definitions]
            return parts[0] if len(parts) == 1 else combined(parts)

        try:
            return self.resolve("surfaces", scope, name, work)
        except LookupError:
            raise SceneError(f"there is no surface '{name}'") from None

    def one_surface(self, scope: Scope, surface: Surface) -> tuple:
        if surface.unknown:
            raise SceneError(f"is a *SURFACE of type {shortened(surface.unknown)}, which is not read")
        if surface.combine:
            if surface.combine != "UNION" or not surface.lines:
                raise SceneError(f"is a *SURFACE with COMBINE = {shortened(surface.combine)}, which is not read")
            return combined([self.surface(scope, name) for line in surface.lines for name in line.names])
        if surface.of_nodes:
            return "nodes", np.unique(
                np.concatenate([NONE, *(self.members("node_sets", scope, line) for line in surface.lines)])
            )
        rows, numbers = [NONE], [NONE]
        for line in surface.lines:
            rows.append(self.rows_of(self.members("element_sets", scope, line)))
            numbers.append(self.face_numbers(rows[-1], line.label))
        return "faces", np.concatenate(rows), np.concatenate(numbers)

    def face_numbers(self, rows: np.ndarray, label: str) -> np.ndarray:
        solid = np.array([self.blocks[number].shape in FACES for number in self.block_of[rows]], bool)
        if not label:
            number = 0
        elif label[0] == "S" and label[1:].isdecimal() and len(label) == 2:
            number = int(label[1])
        elif label in ("SPOS", "SNEG"):
            number = 1 if label == "SNEG" else 2  # bottom and top face of a continuum shell
        else:
            raise SceneError(f"'{shortened(label)}' names no face of an element")
        return np.where(solid, number, 1)


def combined(values: list):
    """All of several sets, or surfaces, of one name."""
    if isinstance(values[0], np.ndarray):
        return np.unique(np.concatenate(values))
    if len({value[0] for value in values}) > 1:
        raise SceneError("is a surface of nodes in one place and of faces in another")
    return values[0][0], *(np.concatenate(column) for column in list(zip(*values))[1:])


def repeats(ids: np.ndarray) -> bool:
    ordered = np.sort(ids)
    return bool((ordered[1:] == ordered[:-1]).any())


def placed(position: np.ndarray, instance: Instance | None) -> np.ndarray:
    """Positions (n, 3) of a part where its instance puts it: moved, then turned."""
    if instance is None:
        return position
    position = position + instance.translation
    if instance.rotation is None:
        return position
    a, b, angle = instance.rotation[:3], instance.rotation[3:6], np.radians(instance.rotation[6])
    length = np.linalg.norm(b - a)
    if not 0 < length < np.inf:
        raise SceneError(f"{instance.where}: instance '{instance.own.name}': the axis of its rotation has no direction")
    axis, arm = (b - a) / length, position - a
    along = np.outer(arm @ axis, axis)
    return a + along + (arm - along) * np.cos(angle) + np.cross(axis, arm) * np.sin(angle)
