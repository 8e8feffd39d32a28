"""Radioss starter decks (formats 4.1 to 2026): from the file to a Deck.

Column layouts follow the reader configuration of OpenRadioss; docs/decks_radioss.md lists the keywords.
"""

from pathlib import Path

import numpy as np

from ..choice import Choice
from ..model import Deck
from . import layers, loads, mesh, parameters_of_deck, tables, ties, units
from .cards import Block
from .cards import read as read_blocks
from .keywords import MATTERS, USED, encrypted, reason
from .sets import GROUPS, Sets

SET_KEYWORDS = {*GROUPS, "GRNOD", "GRPART", "SURF", "SET", "SUBSET", "BOX"}


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file is a Radioss starter deck, by its first bytes."""
    lines = [line.strip() for line in head.split(b"\n")]
    if lines and lines[0].upper().startswith(b"#RADIOSS"):
        return True
    first = next((line for line in lines if line and not line.startswith((b"#", b"$"))), b"")
    return first.startswith((b"/BEGIN", b"/TITLE", b"/VERS", b"/NODE")) or path.suffix.lower() == ".rad"


def read(path: Path, file: str, wanted: list[str] | None = None) -> Deck:
    """The deck, with the ties named in `wanted` (titles or ids), or all of them. SceneError on the first thing that is
    wrong: "FILE: line N: /KEYWORD: message"."""
    blocks = read_blocks(path, file)
    deck = Deck(file, "Radioss")
    by_name: dict[str, list[Block]] = {}
    for block in blocks:
        by_name.setdefault(block.key[0], []).append(block)

    def of(*names: str) -> list[Block]:
        return [block for name in names for block in by_name.get(name, [])]

    for block in blocks:
        if block.key[0] not in ("NODE", *mesh.ELEMENTS) and encrypted(block):
            block.fail("is encrypted and cannot be read")
    parameters_of_deck.define(blocks)
    begin = next(iter(of("BEGIN")), None)
    said = units.read(deck, begin, of("UNIT"))
    titles = of("TITLE")
    deck.title = titles[0].lines[0].decode("utf-8", "replace").strip() if titles and titles[0].lines else ""
    node_blocks = of("NODE", "CNODE")
    for block in of("NODE", "CNODE"):
        tables.refuse_unit(block, 1)
    node_block = mesh.read_nodes(deck, node_blocks)
    subsets = mesh.read_parts(deck, of("PART"))
    unknown = tables.read_properties(deck, of("PROP"), default_shell(of("DEF_SHELL")))
    unread = tables.read_materials(deck, [b for b in of("MAT") if len(b.key) > 1])
    layers.settle(deck)
    mesh.read_elements(deck, of(*mesh.ELEMENTS))
    mesh.check_references(deck)
    warn_of_tables(deck, unknown, unread)
    units.check(deck, begin, said)

    def in_submodel(number: int) -> np.ndarray:
        return np.array([number in block.offsets.inside for block in node_blocks])[node_block]

    sets = Sets(deck, of(*SET_KEYWORDS), subsets, in_submodel)
    mesh.transform(deck, of("TRANSFORM"), node_block, node_blocks, lambda number, block: sets.nodes(number, block))
    read_ties(deck, sets, of("INTER"), ties.defaults(of("DEFAULT")), wanted)
    for block in of("ADMAS"):
        loads.admas(deck, sets, block)
    for block in of("BCS"):
        loads.bcs(deck, sets, block)
    for block in of("IMPVEL", "IMPDISP", "IMPACC"):
        loads.imposed(deck, sets, block)
    for block in of("RBODY"):
        loads.rbody(deck, sets, block)
    for block in of("RBE2"):
        loads.rbe2(deck, sets, block)
    for block in of("INIVEL"):
        loads.inivel(deck, sets, block)
    functions = loads.functions_of(of("FUNCT")) if of("GRAV") else {}
    for block in of("GRAV"):
        loads.grav(deck, sets, block, functions)
    deck.frames = loads.skews_of(of("SKEW"))
    deck.lookup = lambda name: lookup(deck, sets, name)
    say_what_is_left(deck, blocks)
    return deck


def default_shell(blocks: list[Block]) -> tuple[int, int]:
    """Ishell and Ish3n of /DEF_SHELL."""
    for block in blocks:
        cards = block.cards()
        if len(cards):
            ishell, _, _, _, _, ish3n = cards.read(0, "iiiii..i")
            return ishell or 1, ish3n or 2
    return 1, 2


def warn_of_tables(deck: Deck, unknown: set[int], unread: set[int]):
    """Properties and materials of elements that are not understood."""
    for elements in deck.elements.values():
        for part, prop, material, members in deck.part_values(elements.part):
            if prop is not None and prop.id in unknown:
                deck.warn(
                    f"{prop.where}: this type is not understood; {len(members)} elements of part {part.id} add no mass "
                    "and no stiffness"
                )
            if material is not None and material.id in unread and elements.kind != "spring":
                deck.warn(
                    f"{material.where}: its elastic constants are not read; {len(members)} elements of part {part.id} "
                    "add mass and no stiffness"
                )


def read_ties(deck: Deck, sets: Sets, blocks: list[Block], default: ties.Defaults, wanted: list[str] | None):
    choice = Choice(deck, "/INTER/TYPE2", wanted)
    for block in blocks:
        words = block.key[1:3]
        if words[:1] == ["TYPE2"] or words[:1] == ["TYPE02"]:
            tie = ties.read(deck, sets, block, default, choice.wants)
            if tie is not None:
                choice.add(tie, block.id(2, "other"))
        elif words == ["LAGMUL", "TYPE2"]:
            deck.warn(f"{block.where}: ties by Lagrange multipliers are not imported")
        else:
            left(deck, block, "contacts are the host's")
    choice.finish()
    slaves = np.unique(np.concatenate([tie.slaves for tie in deck.ties]))
    for one in deck.elements.values():
        for part, prop, _, members in deck.part_values(one.part):
            if prop is not None and prop.values.get("connects") and np.isin(one.nodes[members], slaves).any():
                deck.warn(
                    f"{part.where}: {len(members)} connecting solids are at slaves: the scene has their masses, not "
                    "their forces, which the host gives to the slaves"
                )


def lookup(deck: Deck, sets: Sets, name: str) -> np.ndarray | None:
    """Node indices of a part, node group or set called `name` (title or id); None where there is none."""
    wanted = name.strip().lower()
    parts = {part.id for part in deck.parts.values() if wanted in (part.title.lower(), str(part.id))}
    if parts:
        mask = np.zeros(len(deck.node_id), bool)
        for elements in deck.elements.values():
            nodes = elements.nodes[np.isin(elements.part, sorted(parts))]
            mask[nodes[nodes >= 0]] = True
        return np.flatnonzero(mask)
    for (keyword, number), blocks in sets.blocks.items():
        if keyword in ("GRNOD", "SET") and wanted in (blocks[0].titled()[0].lower(), str(number)):
            return sets.nodes(number, blocks[0])
    return None


def left(deck: Deck, block: Block, why: str):
    entry = deck.ignored.setdefault(
        "/" + "/".join(block.key[:1] if block.key[0] != "INTER" else block.key[:2]), [why, 0]
    )
    entry[1] += 1


def say_what_is_left(deck: Deck, blocks: list[Block]):
    """Nothing is dropped in silence: a reason, or a warning with the line."""
    for block in blocks:
        name = block.key[0]
        if name == "SUBMODEL":
            deck.notes.append(f"{block.where}: offsets {vars(block.offsets)['node']} on nodes")
            continue
        if name in USED:
            continue
        why = reason(name)
        if why is not None:
            left(deck, block, why)
        elif name in MATTERS:
            deck.warn(f"{block.where}: is not read; {MATTERS[name]}")
        else:
            deck.warn(f"{block.where}: is not understood and is left aside")
