"""/INTER/TYPE2 of a Radioss deck."""

from dataclasses import dataclass

import numpy as np

from ..model import Deck, Tie
from .cards import Block
from .sets import Sets

FORMULATIONS = {0: "default", 2: "default", 5: "default", 4: "default", 27: "default", 1: "optimized", 28: "optimized"}
REFUSED = {
    20: "has rupture",
    21: "has rupture",
    22: "has rupture",
    25: "is a penalty formulation",
    26: "is a penalty formulation",
    30: "curves the main segment cubically",
}
PAIRWISE = (0.05, 0.6)  # of the shorter diagonal, of the summed thicknesses


@dataclass
class Defaults:
    """/DEFAULT/INTER/TYPE2."""

    ignore: int = 0
    spotflag: int = 0
    search: int = 0


def defaults(blocks: list[Block]) -> Defaults:
    found = Defaults()
    for block in blocks:
        if block.key[1:3] == ["INTER", "TYPE2"]:
            cards = block.cards()
            given = [card for card in range(len(cards)) if cards.need(card).strip()]
            if given:
                found = Defaults(*cards.read(given[0], "..ii.i"))
    return found


def read(deck: Deck, sets: Sets, block: Block, default: Defaults, wanted) -> Tie | None:
    """One /INTER/TYPE2; None where `wanted(name, number)` is false."""
    number = block.id(2, "other")
    title, cards = block.titled()
    name = title or f"tie {number}"
    if not wanted(name, number):
        return None
    group, surface, ignore, spotflag, level, search, idel, other, distance = cards.read(0, "iiiiiiisr")
    ignore, spotflag, search = ignore or default.ignore, spotflag or default.spotflag, search or default.search
    where = f"tie '{name}': Spotflag {spotflag}"
    if spotflag in REFUSED:
        block.fail(f"{where} {REFUSED[spotflag]}; only kinematic ties can be imported", cards.first)
    if spotflag not in FORMULATIONS:
        block.fail(f"{where} is not understood", cards.first)
    if search not in (0, 1, 2):
        block.fail(f"tie '{name}': Isearch {search} is not understood", cards.first)
    if ignore not in (0, 1, 2, 3, 1000):
        block.fail(f"tie '{name}': Ignore {ignore} is not understood", cards.first)
    if not group or not surface:
        block.fail(f"tie '{name}': names no {'node group' if not group else 'surface'}", cards.first)
    if spotflag in (27, 28):
        deck.warn(
            f"{block.where}: {where} turns slaves that are constrained twice into penalty ones; it is taken as "
            f"{FORMULATIONS[spotflag]}, kinematic"
        )
    tie = Tie(
        name,
        sets.nodes(group + block.offsets.other, block),
        sets.faces(surface + block.offsets.other, block),
        FORMULATIONS[spotflag],
        "nearest-node" if search == 1 else "box",
        unresolved="drop" if ignore in (1, 2, 3) else "error",
        hand_on_rotations=spotflag != 4,
        where=block.where,
    )
    if not len(tie.slaves):
        block.fail(f"tie '{name}': node group {group} is empty", cards.first)
    if not len(tie.faces):
        block.fail(f"tie '{name}': surface {surface} holds no segments", cards.first)
    if distance < 0 or not np.isfinite(distance):
        block.fail(f"tie '{name}': dsearch {distance:g} is not a distance", cards.first)
    said = [f"Spotflag {spotflag}: {tie.formulation}"]
    if spotflag == 4:
        said.append("rotations are not handed on")
    said.append(f"Isearch {search or '2 (default)'}: {tie.search}")
    said.append(f"Ignore {ignore % 1000}: a slave that finds nothing is {'dropped' if ignore % 1000 else 'an error'}")
    if level or idel:
        said.append("Level and Idel left aside: ties of a scene have no order, and its elements do not fail")
    if other.strip("0"):
        deck.warn(f"{block.at(cards.first)}: tie '{name}': columns 71 to 80, '{other}', are not understood")
    if distance:
        tie.search_distance = distance
        said.append(f"dsearch {distance:g}")
    elif ignore in (2, 3):
        tie.pairwise = PAIRWISE
        said.append("dsearch: per pair, the larger of 0.05 shorter diagonals and 0.6 (t_s + t_m)")
    else:
        tie.search_distance = rms_side(deck, tie.faces.nodes)
        said.append(f"dsearch: root mean square of the sides, {tie.search_distance:.6g}")
    deck.notes.append(f"tie '{name}' ({block.where}): " + "; ".join(said))
    return tie


def rms_side(deck: Deck, nodes: np.ndarray) -> float:
    """sqrt(sum of four squared sides / 4 n) over the surface; a triangle's fourth side is 0."""
    four = np.where(nodes < 0, nodes[:, [2]], nodes)
    x = deck.position[four]
    sides = ((x - np.roll(x, -1, axis=1)) ** 2).sum(axis=(1, 2))
    return float(np.sqrt(sides.sum() / (4 * len(nodes))))
