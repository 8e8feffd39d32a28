"""*MATERIAL with what stands under it: density, and the modulus and Poisson's ratio that its stiffness is taken by."""

import numpy as np

from ...mesh.abaqus_cards import Block
from ..model import Deck, Material
from .source import Source

# Of materials that are not linear isotropic, the modulus bounds the wave speed from above.
STIFFNESS = {"ORTHOTROPIC": (0, 2, 5), "ANISOTROPIC": (0, 2, 5)}  # places of D1111, D2222, D3333
# What decides the elastic constants and is not understood.
UNREAD = {
    "HYPERFOAM", "USERMATERIAL", "HYPOELASTIC", "POROUSELASTIC", "EOS", "FABRIC", "LOWDENSITYFOAM", "MULLINSEFFECT",
    "ANISOTROPICHYPERELASTIC", "CAVITY", "ACOUSTICMEDIUM", "GASKETTHICKNESSBEHAVIOR",
}  # fmt: skip


def read(source: Source) -> dict[str, Material]:
    """Materials by name in capitals, also in deck.materials."""
    deck, found, material = source.deck, {}, None
    seen: set[int] = set()
    for _, block in source.cards():
        if id(block) in seen:  # of a part that is placed several times
            continue
        seen.add(id(block))
        if block.key == "MATERIAL":
            name = block.need("NAME")
            if name.upper() in found:
                block.fail(f"material '{name}' is repeated")
            material = Material(len(found) + 1, title=name, where=block.where)
            found[name.upper()] = deck.materials[material.id] = material
        elif block.key == "DENSITY":
            if material is None:
                block.fail("stands under no *MATERIAL")
            density(deck, material, block)
        elif block.key == "ELASTIC" and material is not None:
            elastic(deck, material, block)
        elif block.key == "HYPERELASTIC" and material is not None:
            hyperelastic(deck, material, block)
        elif block.key in UNREAD and material is not None and not material.young:
            material.void = True
            deck.warn(
                f"{block.where}: material '{material.title}': its elastic constants are not read; it has mass only"
            )
    return found


def density(deck: Deck, material: Material, block: Block):
    values = block.data()
    if not values or not values[0] >= 0 or not np.isfinite(values[0]):
        block.fail(f"material '{material.title}': expected a density", 0 if block.lines else None)
    material.density = values[0]
    if len(block.lines) > 1:
        deck.warn(f"{block.where}: material '{material.title}': of its densities the first, {values[0]:g}, is taken")


def elastic(deck: Deck, material: Material, block: Block):
    kind, values = block.get("TYPE", "ISOTROPIC").upper(), block.data()
    if not values:
        block.fail(f"material '{material.title}': has no constants")
    name = f"material '{material.title}'"
    if kind == "ISOTROPIC":
        young, poisson = (values + [0.0, 0.0])[:2]
        if len(block.lines) > 1:
            deck.warn(f"{block.where}: {name}: of its moduli the first, {young:g}, is taken")
    else:
        if kind in STIFFNESS:
            young, poisson = max((values + [0.0] * 6)[place] for place in STIFFNESS[kind]), 0.0
        elif kind in ("ENGINEERINGCONSTANTS", "ENGINEERING CONSTANTS"):
            young, poisson = max(values[:3]), max((values + [0.0] * 6)[3:6])
        elif kind == "LAMINA":
            young, poisson = max(values[:2]), (values + [0.0] * 3)[2]
        else:
            material.void = True
            deck.warn(f"{block.where}: {name}: TYPE = {kind} is not understood; it has mass only")
            return
        poisson = min(max(poisson, 0.0), 0.45)
        deck.warn(
            f"{block.where}: {name} is not isotropic; its stiffness is taken by the modulus {young:g} and Poisson's "
            f"ratio {poisson:g}"
        )
    if not (young >= 0 and np.isfinite(young) and -1 < poisson <= 0.5):
        block.fail(f"{name}: a modulus of {young:g} with a Poisson's ratio of {poisson:g} is none", 0)
    material.young, material.poisson, material.void = young, min(poisson, 0.4999), material.void or young == 0


def hyperelastic(deck: Deck, material: Material, block: Block):
    """Small-strain moduli: G = 2 (C10 + C01), K = 2 / D1."""
    values = (block.data() + [0.0] * 3)[:3]
    if block.has("NEOHOOKE"):
        c, d = values[0], values[1]
    elif block.has("MOONEY-RIVLIN"):
        c, d = values[0] + values[1], values[2]
    else:
        c = d = 0.0
    if block.has("TESTDATAINPUT") or not c > 0:
        material.void = True
        deck.warn(f"{block.where}: material '{material.title}': its elastic constants are not read; it has mass only")
        return
    shear = 2 * c
    bulk = 2 / d if d > 0 else 1e3 * shear
    material.young = 9 * bulk * shear / (3 * bulk + shear)
    material.poisson = (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear))
