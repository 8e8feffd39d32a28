"""What the tests of all deck languages ask of a deck, and how they damage one."""

import random
from collections.abc import Callable

from tiefmu.decks.element_properties import nodal
from tiefmu.decks.model import Deck

BITS = [b"", b"-1", b"x", b"\xff\xfe", b"1e400", b"nan", b"0", b"  ", b"\0", b"1_0"]


def by_node(deck: Deck) -> dict[int, dict]:
    """What the elements give: mass, inertia, stiffness, rotational stiffness, and whether the node rotates."""
    values = nodal(deck)
    return {
        int(number): {
            "m": values.mass[i],
            "j": values.inertia[i],
            "k": values.stiffness[i],
            "kr": values.rotational_stiffness[i],
            "rotates": bool(values.rotations[i]),
        }
        for i, number in enumerate(deck.node_id)
    }


def slaves(deck: Deck) -> list[int]:
    """Ids of the first tie's slaves."""
    return deck.node_id[deck.ties[0].slaves].tolist()


def faces(deck: Deck) -> set[frozenset[int]]:
    """Ids of the nodes of each face of the first tie's surface."""
    return {frozenset(deck.node_id[row[row >= 0]].tolist()) for row in deck.ties[0].faces.nodes}


def columns(width: int, bits: list[bytes]) -> Callable:
    """Damages one field of fixed columns."""

    def damage(line: bytes, chance: random.Random) -> bytes | None:
        if len(line) < width:
            return None
        start = chance.randrange(len(line) // width) * width
        return line[:start] + chance.choice(bits).rjust(width)[:width] + line[start + width :]

    return damage


def damaged(text: bytes, chance: random.Random, bits: list[bytes], own: list[Callable]) -> bytes:
    """One to three lines lost, doubled, cut, pierced, swapped, or damaged as the language's `own` do: each takes
    (line, chance) and returns the new line, or None where it has nothing to do."""
    lines = text.split(b"\n")
    for _ in range(chance.randrange(1, 4)):
        at = chance.randrange(len(lines))
        line = lines[at]
        kind = chance.randrange(5 + len(own))
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines.insert(at, lines[chance.randrange(len(lines))])
        elif kind == 2:
            lines[at] = line[: chance.randrange(len(line) + 1)]
        elif kind == 3:
            start = chance.randrange(len(line) + 1)
            lines[at] = line[:start] + chance.choice(bits) + line[start:]
        elif kind < 4 + len(own) and (new := own[kind - 4](line, chance)) is not None:
            lines[at] = new
        else:
            other = chance.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        lines = lines or [b""]
    return b"\n".join(lines)
