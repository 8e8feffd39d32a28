"""Layered shells of a Radioss deck: /PROP of types 11 and 16 with layers, 17 and 51 with plies (type 19).

The mass is that of the layers' materials (cinmas.F); the part's own material stands for stiffness and time step.
"""

import dataclasses

from ..._core import SceneError
from ..model import Deck
from .cards import Block, Cards

PLIES = (17, 51)


def read(block: Block, cards: Cards, kind: int, values: dict):
    """Adds to the values of a property: layers [(material, thickness)], or plies [id of a property]."""
    if kind in (11, 16):
        layout = "rrri" if kind == 11 else "rrrri"
        count = cards.read(2, "i")[0] or 1
        rows = [cards.read(4 + layer, layout) for layer in range(count)]
        values["layers"] = [(row[-1] + block.offsets.material if row[-1] else 0, row[-3]) for row in rows]
    elif kind in PLIES:
        values["plies"] = [number + block.offsets.property for number in plies(block, cards)]


def plies(block: Block, cards: Cards) -> list[int]:
    """Ids of plies: each has a card and one behind it; a substack has two of its own, an interface one."""
    found, card = [], 4
    while card < len(cards):
        line = cards.need(card).strip().upper()
        if line.startswith(b"INT") or not line:
            card += 1
            continue
        if not line.startswith(b"SUB"):
            found.append(cards.read(card, "i")[0])
        card += 2
    if not found or min(found) < 1:
        block.fail("names no plies")
    return found


def settle(deck: Deck):
    """Gives each part with layers a material of their mean density."""
    for part in deck.parts.values():
        prop = deck.properties.get(part.property)
        if prop is None or not ("layers" in prop.values or "plies" in prop.values):
            continue
        layers = prop.values.get("layers")
        if layers is None:
            layers = []
            for number in prop.values["plies"]:
                ply = deck.properties.get(number)
                if ply is None or ply.kind != "ply":
                    raise SceneError(f"{prop.where}: ply {number} is not in the deck")
                layers.append((ply.values["material"], ply.values["thickness"]))
        whole = sum(thickness for _, thickness in layers)
        own = deck.materials.get(part.material)
        if own is None and "plies" in prop.values and layers:
            own = deck.materials.get(layers[0][0])
        if own is None or not whole > 0:
            continue
        density = 0.0
        for number, thickness in layers:
            if number and number not in deck.materials:
                raise SceneError(f"{prop.where}: material {number} of a layer is not in the deck")
            density += thickness / whole * (deck.materials[number] if number else own).density
        if not prop.values["thickness"] or "plies" in prop.values:
            prop.values["thickness"] = whole
        fresh = min([0, *deck.materials]) - 1
        deck.materials[fresh] = dataclasses.replace(own, id=fresh, density=density)
        part.material = fresh
        deck.warn(
            f"{prop.where}: the {len(layers)} layers of part {part.id} are taken as one of their mean density and the "
            "stiffness of the part's material"
        )
