"""Sections: which element has which thickness, area and material. Each section, and each kind of element in it, is a
part of the deck."""

from dataclasses import dataclass

import numpy as np

from ...mesh.abaqus_assembly import Scope
from ...mesh.abaqus_cards import Block
from ..model import Material, Part, Property
from . import beams, materials
from .source import Source

# Keyword without blanks -> what its elements are.
SECTIONS = {
    "SHELLSECTION": "shell", "SHELLGENERALSECTION": "shell", "MEMBRANESECTION": "shell", "SOLIDSECTION": "solid",
    "BEAMSECTION": "beam", "BEAMGENERALSECTION": "beam",
}  # fmt: skip
FITS = {"shell": ("shell", "membrane", "solid"), "solid": ("solid", "truss"), "beam": ("beam",)}


@dataclass
class Section:
    block: Block
    scope: Scope
    name: str


def group(kind: str) -> str:
    for name in ("shell", "membrane", "truss", "beam"):
        if kind.startswith(name):
            return name
    return "solid"


class Sections:
    """All sections; parts are made as elements ask for them."""

    def __init__(self, source: Source):
        self.source, self.deck = source, source.deck
        self.materials = materials.read(source)
        self.section_of_row = np.full(len(source.element_id), -1)
        self.sections: list[Section] = []
        self.known: dict[tuple, int] = {}
        self.without: dict[str, list] = {}
        for scope, block in source.cards(*SECTIONS):
            name = block.need("ELSET")
            rows = source.rows(scope, name, block)
            taken = self.section_of_row[rows]
            if (taken >= 0).any():
                other = self.sections[taken[taken >= 0][0]].block.where
                self.deck.warn(
                    f"{block.where}: set '{name}': {(taken >= 0).sum()} of its elements have a section already, in "
                    f"{other}; this one counts"
                )
            self.section_of_row[rows] = len(self.sections)
            whole = f"{scope.name}.{name}" if scope.name else name
            self.sections.append(Section(block, scope, whole))
        self.void = self.deck.materials.setdefault(0, Material(0, void=True))

    def parts(self, card: Block, family, rows: np.ndarray) -> np.ndarray:
        """Part ids of the elements `rows`, of one family."""
        numbers, inverse = np.unique(self.section_of_row[rows], return_inverse=True)
        ids = [self.part(card, family, int(number), int((inverse == k).sum())) for k, number in enumerate(numbers)]
        return np.array(ids, np.int64)[inverse.ravel()] if ids else np.empty(0, np.int64)

    def part(self, card: Block, family, number: int, count: int) -> int:
        what = group(family.kind)
        if family.massless or number < 0:
            key: tuple = (-1, family.kind)
            if not family.massless:
                self.without.setdefault(card.get("TYPE").upper(), [card, 0])[1] += count
        else:
            key = (number, family.kind, family.full)
            section = self.sections[number]
            if what not in FITS[SECTIONS[section.block.key]]:
                section.block.fail(
                    f"set '{section.name}' holds elements of type {card.get('TYPE')}, which it does not fit"
                )
        if key not in self.known:
            self.known[key] = self.make(key, family, what)
        return self.known[key]

    def make(self, key: tuple, family, what: str) -> int:
        id = len(self.deck.parts) + 1
        if key[0] < 0:
            part, prop = Part(id, property=id, material=0, where=self.deck.file), Property(id, "void")
        else:
            section = self.sections[key[0]]
            prop, material = self.property(id, section, family, what)
            name = f"section '{section.name}'"
            part = Part(id, section.name, id, material, where=section.block.where, name=name)
        self.deck.parts[id], self.deck.properties[id] = part, prop
        return id

    def property(self, id: int, section: Section, family, what: str) -> tuple[Property, int]:
        """The property and the material's id."""
        block, values = section.block, {}
        if what in ("shell", "membrane"):
            values, material = self.shell(section, family)
        elif what == "beam":
            values, material = beams.read(self, block)
        else:
            material = self.material(block, block.get("MATERIAL"))
            if what == "truss":
                values = {"area": beams.positive(block, block.data(), 0, "area")}
            if block.has("COMPOSITE"):
                material = self.layers(block, 0)[1]
        if block.has("DENSITY") and what == "solid":
            self.deck.warn(f"{block.where}: DENSITY is left aside; that of the material is taken")
        return Property(id, "solid" if what == "solid" else what, values=values, where=block.where), material

    def material(self, block: Block, name: str) -> int:
        if not name:
            block.fail("parameter MATERIAL is missing")
        if name.upper() not in self.materials:
            block.fail(f"material '{name}' is not in the deck")
        material = self.materials[name.upper()]
        if not material.density:
            self.deck.warn(f"{material.where}: material '{material.title}' has no density; its elements have no mass")
        return material.id

    def shell(self, section: Section, family) -> tuple[dict, int]:
        block = section.block
        values = {"formulation": "qbat" if family.full else "q4", "offset": offset(self, block)}
        if block.has("COMPOSITE"):
            thickness, material = self.layers(block, 1)
            return values | {"thickness": thickness}, material
        if block.key == "SHELLGENERALSECTION" and not block.get("MATERIAL"):
            thickness, material = self.general(block)
            return values | {"thickness": thickness}, material
        data = block.data()
        values["thickness"] = beams.positive(block, data, 0, "thickness")
        for option in ("NODALTHICKNESS", "SHELLTHICKNESS"):
            if block.has(option):
                self.deck.warn(
                    f"{block.where}: its thickness varies ({option}), which is not read; {values['thickness']:g} is "
                    "taken everywhere"
                )
        return values, self.material(block, block.get("MATERIAL"))

    def general(self, block: Block) -> tuple[float, int]:
        """A section given by its stiffness: mass per area by DENSITY, no stiffness."""
        per_area = block.numbers(0, [block.get("DENSITY")])[0] if block.get("DENSITY") else 0.0
        self.deck.warn(
            f"{block.where}: is given by its stiffness, which is not read; its elements have "
            + (f"the mass {per_area:g} per area and no stiffness" if per_area else "no mass and no stiffness")
        )
        thin = 1e-6
        number = max(self.deck.materials) + 1
        self.deck.materials[number] = Material(number, density=per_area / thin, void=True, where=block.where)
        return thin, number

    def layers(self, block: Block, thickness_at: int) -> tuple[float, int]:
        """Total thickness of a composite, and a material of the mean density and the largest modulus of its layers."""
        total, mass, stiffest = 0.0, 0.0, None
        for line, items in block.rows():
            row = [*items, "", "", ""]
            if not any(items):
                continue
            thickness = float(block.numbers(line, row[:1])[0])
            if not 0 < thickness < np.inf:
                block.fail(f"a layer is {thickness:g} thick", line)
            name = row[2]
            if name.upper() not in self.materials:
                block.fail(f"material '{name}' is not in the deck", line)
            material = self.materials[name.upper()]
            total, mass = total + thickness, mass + thickness * material.density
            if stiffest is None or material.young > stiffest.young:
                stiffest = material
        if stiffest is None:
            block.fail("has no layers")
        self.deck.warn(
            f"{block.where}: is a composite; the sum of its layers' thicknesses and masses, and the modulus of its "
            f"stiffest, '{stiffest.title}', are taken"
        )
        number = max(self.deck.materials) + 1
        self.deck.materials[number] = Material(
            number, "mean", stiffest.title, mass / total, stiffest.young, stiffest.poisson, void=stiffest.void
        )
        return total, number

    def finish(self):
        for kind, (card, count) in self.without.items():
            self.deck.warn(
                f"{card.where}: {count} elements of type {kind} have no section; they add no mass and no stiffness"
            )


def offset(sections: Sections, block: Block) -> float:
    """Of the reference surface from the middle, in thicknesses."""
    word = block.get("OFFSET", "0").upper()
    if word in ("SPOS", "SNEG"):
        return 0.5 if word == "SPOS" else -0.5
    try:
        return float(word)
    except ValueError:
        sections.deck.warn(f"{block.where}: OFFSET = {word} varies, which is not read; none is taken")
        return 0.0
