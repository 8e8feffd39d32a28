"""What weighs, holds, moves and loads nodes: point masses, *BOUNDARY, rigid bodies and couplings, *INITIAL CONDITIONS,
gravity."""

import numpy as np

from ...mesh.abaqus_assembly import Scope
from ...mesh.abaqus_cards import Block
from ..model import Fixed, Initial, RigidBody
from .source import NONE, Source, option_nodes
from .surfaces import nodes_of_rows, nodes_of_surface

# Degrees of freedom that names stand for.
NAMED = {
    "ENCASTRE": (1, 2, 3, 4, 5, 6), "PINNED": (1, 2, 3), "XSYMM": (1, 5, 6), "YSYMM": (2, 4, 6), "ZSYMM": (3, 4, 5),
    "XASYMM": (2, 3, 4), "YASYMM": (1, 3, 5), "ZASYMM": (1, 2, 6),
}  # fmt: skip


def masses(source: Source):
    deck = source.deck
    given: dict[str, list[np.ndarray]] = {}
    for scope, block in source.cards("MASS", "ROTARYINERTIA"):
        rows = source.rows(scope, block.need("ELSET"), block)
        nodes = nodes_of_rows(source, rows)
        given.setdefault(block.key, []).append(rows)
        values = block.data()
        if not values:
            block.fail("has no data")
        if block.key == "MASS":
            if len(values) > 1 and any(value != values[0] for value in values[:3] if value):
                deck.warn(f"{block.where}: its mass differs by direction; the mean of {values[:3]} is taken")
                values = [float(np.mean(values[:3]))]
            value, target = values[0], deck.added_mass
        else:
            moments = (values + [0.0] * 6)[:3]
            if any(moment != moments[0] for moment in moments) or any(values[3:6]):
                deck.warn(f"{block.where}: its inertia is not spherical; the mean of {moments} is taken")
            value, target = float(np.mean(moments)), deck.added_inertia
        if not 0 <= value < np.inf:
            block.fail(f"{value:g} is no mass", 0)
        for node in nodes:  # one element each; several may share a node
            target.append((np.array([node]), value))
    for first, block, card in zip(source.assembly.first_row, source.assembly.blocks, source.assembly.cards):
        key = {"MASS": "MASS", "ROTARYI": "ROTARYINERTIA"}.get(card.get("TYPE").upper())
        if key is None:
            continue
        lone = np.setdiff1d(first + np.arange(len(block.ids)), np.concatenate(given.get(key, [[]])))
        if len(lone):
            word = "mass" if key == "MASS" else "inertia"
            deck.warn(
                f"{card.where}: {len(lone)} elements of type {card.get('TYPE').upper()}, the first is "
                f"{source.element_id[int(lone[0])]}, have no {word} given"
            )


def boundaries(source: Source):
    """Model data and those of the first step."""
    deck = source.deck
    for scope, block in source.cards("BOUNDARY"):
        if block.step > 1:
            continue
        kind = block.get("TYPE", "DISPLACEMENT").upper()
        if kind not in ("DISPLACEMENT", "VELOCITY", "ACCELERATION"):
            block.fail(f"TYPE = {kind} is not understood")
        if block.get("LOAD CASE") == "2" or block.has("SUBMODEL"):
            deck.warn(f"{block.where}: is left aside; nodes that it moves are not known to be moved")
            continue
        for line, items in block.rows():
            if any(items):
                boundary(source, scope, block, line, items)


def boundary(source: Source, scope: Scope, block: Block, line: int, items: list[str]):
    deck = source.deck
    nodes = source.nodes(scope, items[0], block, line)
    word = items[1].upper() if len(items) > 1 else ""
    if word in NAMED:
        freedoms, moved = NAMED[word], False
    elif word.isdecimal():
        first = int(word)
        last = int(block.whole(line, [items[2]])[0]) if len(items) > 2 and items[2] else first
        if last < first or last - first > 100:
            block.fail(f"degrees of freedom {first} to {last} are none", line)
        freedoms = tuple(range(first, last + 1))
        value = float(block.numbers(line, [items[3]])[0]) if len(items) > 3 else 0.0
        moved = value != 0
    else:
        block.fail(f"expected a degree of freedom or a name such as ENCASTRE, found '{word}'", line)
    freedoms = tuple(dof for dof in freedoms if dof <= 6)
    if not freedoms:
        return
    if moved or block.has("USER"):
        deck.imposed = np.union1d(deck.imposed, nodes)
    else:
        x, y, z, about_x, about_y, about_z = (dof in freedoms for dof in range(1, 7))
        deck.fixed.append(Fixed(nodes, (x, y, z), (about_x, about_y, about_z), block.where))


def rigid_bodies(source: Source):
    """*RIGID BODY, *COUPLING with *KINEMATIC, *KINEMATIC COUPLING, *MPC of type BEAM."""
    deck, coupling = source.deck, None
    for scope, block in source.cards("RIGIDBODY", "COUPLING", "KINEMATIC", "DISTRIBUTING", "KINEMATICCOUPLING", "MPC"):
        if block.key == "COUPLING":
            coupling = scope, block
        elif block.key == "KINEMATIC":
            if coupling is None:
                block.fail("stands under no *COUPLING")
            kinematic(source, *coupling, block)
        elif block.key == "DISTRIBUTING":
            deck.warn(f"{block.where}: is not read; its nodes are treated as if it were not there")
        elif block.key == "RIGIDBODY":
            nodes = option_nodes(source, scope, block, "NSET", "PIN NSET", "TIE NSET")
            if block.get("ELSET"):
                nodes = np.union1d(nodes, nodes_of_rows(source, source.rows(scope, block.get("ELSET"), block)))
            if block.has("ANALYTICAL SURFACE") and not len(nodes):
                deck.warn(f"{block.where}: its analytical surface is not read")
            add(source, block, block.get("ELSET") or block.get("NSET"), reference(source, scope, block), nodes)
        elif block.key == "KINEMATICCOUPLING":
            sets = [source.nodes(scope, items[0], block, line) for line, items in block.rows() if items[0]]
            main = reference(source, scope, block)
            add(source, block, "", main, np.unique(np.concatenate([NONE, *sets])))
        else:
            multi_point(source, scope, block)


def reference(source: Source, scope: Scope, block: Block) -> int:
    nodes = source.nodes(scope, block.need("REF NODE"), block)
    if len(nodes) != 1:
        block.fail(f"REF NODE = {block.get('REF NODE')} holds {len(nodes)} nodes, not one")
    return int(nodes[0])


def kinematic(source: Source, scope: Scope, coupling: Block, block: Block):
    freedoms = set()
    for line, items in block.rows():
        span = [int(block.whole(line, [item])[0]) for item in items[:2] if item]
        freedoms |= set(range(span[0], span[-1] + 1)) if span and span[-1] <= 6 else set()
    if freedoms and not {1, 2, 3} <= freedoms:
        source.deck.warn(f"{block.where}: couples some directions only; its nodes are treated as if it were not there")
        return
    name = coupling.need("SURFACE")
    if source.has("surfaces", scope, name):
        nodes, _ = nodes_of_surface(source, scope, name, coupling, 0)
    else:
        nodes = source.nodes(scope, name, coupling)
    add(source, coupling, coupling.get("CONSTRAINT NAME"), reference(source, scope, coupling), np.unique(nodes))


def multi_point(source: Source, scope: Scope, block: Block):
    """BEAM: nodes that follow one node as a rigid body; the last of a line of nodes, or of two sets."""
    followers: dict[int, list] = {}
    for line, items in block.rows():
        items = [item for item in items if item]
        if not items:
            continue
        if items[0].upper() != "BEAM" or len(items) < 3:
            source.deck.warn(
                f"{block.at(line)}: type {items[0].upper()} is not read; its nodes are treated as if it were not there"
            )
            continue
        nodes = [source.nodes(scope, item, block, line) for item in items[1:]]
        if len(nodes[-1]) != 1:
            block.fail(f"expected one node that the others follow, '{items[-1]}' holds {len(nodes[-1])}", line)
        followers.setdefault(int(nodes[-1][0]), []).extend(nodes[:-1])
    for main, nodes in followers.items():
        add(source, block, "", main, np.unique(np.concatenate(nodes)))


def add(source: Source, block: Block, name: str, main: int, nodes: np.ndarray):
    """A rigid body. The nodes of a *RIGID BODY turn with it, also those of elements that have no rotations."""
    deck = source.deck
    nodes = nodes[nodes != main]
    if not len(nodes):
        return
    deck.rigid.append(RigidBody(name or f"rigid body {len(deck.rigid) + 1}", main, nodes, block.where))
    if block.key == "RIGIDBODY":
        deck.added_inertia.append((nodes, 0.0))


def initial(source: Source):
    """Start velocities; lines of several directions make one vector of a node."""
    deck = source.deck
    velocity = np.full((len(deck.node_id), 6), np.nan)
    where = ""
    for scope, block in source.cards("INITIALCONDITIONS"):
        kind = block.get("TYPE").upper()
        if kind != "VELOCITY":
            if kind == "ROTATING VELOCITY" or kind == "ROTATINGVELOCITY":
                deck.warn(f"{block.where}: its start velocities are not taken; give them as [[initial]]")
            continue
        where = where or block.where
        for line, items in block.rows():
            if not any(items):
                continue
            nodes = source.nodes(scope, items[0], block, line)
            values = block.numbers(line, (items + ["", ""])[1:3])
            if values[0] not in range(1, 7):
                block.fail(f"degree of freedom {values[0]:g} is none of 1 to 6", line)
            velocity[nodes, int(values[0]) - 1] = values[1]
    for part, key in ((velocity[:, :3], "v"), (velocity[:, 3:], "w")):
        given = np.flatnonzero(~np.isnan(part).all(axis=1))
        rows, inverse = np.unique(np.nan_to_num(part[given]), axis=0, return_inverse=True)
        for number, row in enumerate(rows):
            if row.any():
                deck.initial.append(Initial(given[inverse.ravel() == number], where=where, **{key: row}))


def gravity(source: Source):
    """*DLOAD of type GRAV without an amplitude, of the model or the first step."""
    deck = source.deck
    weighing = [part.id for part in deck.parts.values() if deck.properties[part.property].kind != "void"]
    body = np.isin(source.part_of_row, weighing)
    field, where = np.zeros((len(body), 3)), ""
    for scope, block in source.cards("DLOAD"):
        for line, items in block.rows():
            if len(items) < 2 or items[1].upper() != "GRAV" or block.step > 1:
                continue
            if block.has("AMPLITUDE"):
                deck.warn(f"{block.at(line)}: gravity changes with time ({block.get('AMPLITUDE')}) and is not taken")
                continue
            size, *direction = block.numbers(line, (items + [""] * 4)[2:6]).tolist()
            length = np.linalg.norm(direction)
            if not 0 < length < np.inf or not np.isfinite(size):
                block.fail("gravity has no direction", line)
            rows = source.rows(scope, items[0], block, line) if items[0] else slice(None)
            field[rows] += size * np.array(direction) / length
            where = where or block.at(line)
    if not where:
        return
    values, count = np.unique(field[body] if body.any() else field, axis=0, return_counts=True)
    deck.gravity = values[np.argmax(np.where(values.any(axis=1), count, 0))]
    if len(values) > 1:
        deck.warn(f"{where}: gravity is not the same everywhere; {deck.gravity.tolist()} is taken for all nodes")


def loaded_slaves(source: Source):
    """Says which slaves *CLOAD loads: their loads are inputs."""
    slaves = np.concatenate([NONE, *(tie.slaves for tie in source.deck.ties)])
    for scope, block in source.cards("CLOAD"):
        if block.step > 1:
            continue
        loaded = [source.nodes(scope, items[0], block, line) for line, items in block.rows() if items[0]]
        count = np.isin(slaves, np.concatenate([NONE, *loaded])).sum()
        if count:
            source.deck.warn(f"{block.where}: loads {count} slaves; their loads are inputs of the FMU, slave[j].f")
