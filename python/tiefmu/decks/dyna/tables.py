"""*PART and *SECTION of an LS-DYNA deck."""

import math

import numpy as np

from ..model import Deck, Material, Part, Property
from .cards import Block
from .materials import Materials

INTEGRATED = (1, 4, 5, 9, 11)  # beams whose section is given by diameters or sides
RESULTANT = (2, 12, 13)  # by area and moments
BULK_VISCOSITY = 0.05  # linear, where the deck gives none: that of the table of elements


class Tables:
    """Parts and sections. contact: part -> (OPTT, SFT) of its contact thickness; inertia: part -> centre and node of a
    rigid body with inertia of its own; stand_ins: part -> ids of the parts that stand for some of its elements."""

    def __init__(self, deck: Deck, materials: Materials, bulk_viscosity: float = 0.0):
        self.deck, self.materials = deck, materials
        self.bulk_viscosity = bulk_viscosity or BULK_VISCOSITY
        self.contact: dict[int, tuple[float, float]] = {}
        self.centre_node: dict[int, int] = {}
        self.stand_ins: dict[int, list[int]] = {}
        self.orientations: dict[int, tuple[Block, int]] = {}
        self._springs: dict[tuple, int] = {}

    # parts

    def read_parts(self, blocks: list[Block]):
        for block in blocks:
            if block.has("COMPOSITE"):
                self.composite(block)
                continue
            card = 0
            while card < block.end:
                card = self.part(block, card)

    def new_part(self, block: Block, card: int, number: int, title: str, section: int, material: int):
        if number <= block.origin.part:
            block.fail(f"part {number} is no id", card)
        if number in self.deck.parts:
            block.fail(f"part {number} is repeated; the first one stands in {self.deck.parts[number].where}", card)
        self.deck.parts[number] = Part(number, title, section, material, where=block.at(card))

    def part(self, block: Block, card: int) -> int:
        """One part from `card` on; returns the card behind it."""
        title = block.text(card)
        number, section, material = block.read(card + 1, "iii")
        number = block.id("part", number)
        self.new_part(block, card + 1, number, title, block.id("other", section), block.id("material", material))
        card += 2
        if block.has("INERTIA"):
            *_, system, node = block.read(card, "rrrrii")
            self.centre_node[number] = block.id("node", node)
            card += 4 if system == 1 else 3
        if block.has("REPOSITION"):
            card += 1
        if block.has("CONTACT"):
            *_, optt, sft = block.or_blank(card, "rrrrrr")
            self.contact[number] = (optt * block.origin.unit(length=1), sft)
            card += 1
        return card + block.has("PRINT") + block.has("ATTACHMENT")

    def composite(self, block: Block):
        """*PART_COMPOSITE: one shell of the summed thickness with the mean density and modulus of its layers."""
        title = block.text(0)
        (number,) = block.read(1, "i")
        number, deck = block.id("part", number), self.deck
        layers = []
        for card in range(2, block.end):
            row = block.read(card, "irrs" if block.has("LONG") else "irrsirrs")
            layers += [(row[i], row[i + 1]) for i in range(0, len(row), 4) if row[i]]
        whole = sum(thickness for _, thickness in layers)
        if not layers or whole <= 0:
            block.fail("has no layers with a thickness", 1)
        made = Material(self.fresh(deck.materials), "PART_COMPOSITE", title, where=block.where)
        for ident, thickness in layers:
            ident = block.id("material", ident)
            if ident not in deck.materials:
                block.fail(f"material {ident} is not in the deck")
            one, share = deck.materials[ident], thickness / whole
            made.density += one.density * share
            made.young += one.young * share
            made.poisson += one.poisson * share
        values = self.shell_values(whole * block.origin.unit(length=1))
        section = Property(self.fresh(deck.properties), "shell", "PART_COMPOSITE", title, values, block.where)
        deck.materials[made.id], deck.properties[section.id] = made, section
        self.new_part(block, 1, number, title, section.id, made.id)
        deck.warn(f"{block.where}: its {len(layers)} layers are taken as one of their mean density and modulus")

    @staticmethod
    def fresh(known: dict) -> int:
        """A negative id, which no deck has."""
        return min([0, *known]) - 1

    # sections

    def read_sections(self, blocks: list[Block]):
        for block in blocks:
            kind = block.words[1] if len(block.words) > 1 else ""
            read = {"SHELL": self.shell, "SOLID": self.solid, "TSHELL": self.tshell, "BEAM": self.beam}.get(kind)
            read = {"DISCRETE": self.discrete}.get(kind, read)
            titled, card = block.has("TITLE"), 0
            while card < block.end:
                title = block.text(card) if titled else ""
                card += titled
                number = block.id("other", block.read(card, "i")[0])
                if number in self.deck.properties:
                    first = self.deck.properties[number].where
                    block.fail(f"section {number} is repeated; the first one stands in {first}", card)
                if not number:
                    block.fail("section 0 is no id", card)
                found = Property(number, "other", block.name, title, where=block.at(card))
                self.deck.properties[number] = found
                if read is None:
                    break
                card = read(block, card, found)

    @staticmethod
    def shell_values(thickness: float) -> dict:
        return {"thickness": thickness, "formulation": "q4", "triangle": "c0"}

    def shell(self, block: Block, card: int, found: Property) -> int:
        _, elform, _, points, _, _, composite = block.read(card, "irrrrri")
        t1, t2, t3, t4, _, per_area = block.read(card + 1, "rrrrrr")
        thick = [t1, t2 or t1, t3 or t1, t4 or t1]
        found.kind = "shell"
        found.values = self.shell_values(sum(thick) / 4 * block.origin.unit(length=1))
        found.values["per_area"] = per_area * block.origin.unit(length=-2, mass=1)
        found.values["elform"] = int(elform)
        card += 2
        if composite == 1:
            card += math.ceil(max(points, 1) / 8)
        more = set(block.words) - {"SECTION", "SHELL", "TITLE"}
        return block.end if more or elform > 100 else card

    def solid(self, block: Block, card: int, found: Property) -> int:
        _, elform = block.read(card, "ir")
        found.kind = "solid"
        found.values = {"qb": self.bulk_viscosity, "rotary": elform in (3, 4), "tetra10": 0, "elform": int(elform)}
        more = set(block.words) - {"SECTION", "SOLID", "TITLE"}
        return block.end if more or elform > 100 else card + 1

    def tshell(self, block: Block, card: int, found: Property) -> int:
        _, _, _, points, _, _, composite = block.read(card, "irrrrri")
        found.kind, found.values = "solid", {"qb": self.bulk_viscosity, "rotary": False, "tetra10": 0}
        return card + 1 + (math.ceil(max(points, 1) / 8) if composite == 1 else 0)

    def beam(self, block: Block, card: int, found: Property) -> int:
        _, elform, shear, rule, form, system, per_length = block.read(card, "irrrrrr")
        elform = int(elform) or 1
        length = block.origin.unit(length=1)
        words = block.fields(card + 1, "s" * 8)
        found.values = {"elform": elform, "system": int(system)}
        if elform not in (6, 9):
            found.values["mass_per_length"] = per_length * block.origin.unit(length=-1, mass=1)
        if words[0].upper().startswith("SECTION") or block.has("AISC"):
            pass  # a shape by name and dimensions
        elif elform in INTEGRATED and rule >= 0 and form in (0, 1):
            s1, s2, t1, t2 = block.read(card + 1, "rrrr")
            s, t = (s1 + (s2 or s1)) / 2 * length, (t1 + (t2 or t1)) / 2 * length
            found.values |= (tube if form == 1 else rectangle)(s, t)
            found.kind = "beam"
            # Hughes-Liu shears at its one integration point, Belytschko-Schwer does not shear
            found.values["one_point"] = elform in (1, 9, 11)
            found.values["shear_area"] = found.values["area"] * (shear or 1.0) if elform in (1, 9, 11) else 0.0
        elif elform in RESULTANT:
            a, iss, itt, j, shear_area = block.read(card + 1, "rrrrr")
            iss, itt, j = iss * length**4, itt * length**4, j * length**4
            found.values |= {"area": a * length**2, "iyy": iss, "izz": itt, "ixx": j or iss + itt}
            found.values["shear_area"] = shear_area * length**2
            found.kind = "beam"
        elif elform == 3:
            found.kind, found.values["area"] = "truss", block.read(card + 1, "r")[0] * length**2
        elif elform == 6:
            volume, inertia, axes = block.read(card + 1, "rrr")
            unit = block.origin.unit(length=2, mass=1)
            found.values |= {"volume": volume * length**3, "inertia": inertia * unit, "axes": int(axes)}
        return card + (3 if elform in (12, 14) else 2)

    def discrete(self, block: Block, card: int, found: Property) -> int:
        found.kind = "discrete"
        found.values = {"torsion": block.read(card, "ir")[1] == 1}
        return card + 2

    # springs

    def beam_kind(self, number: int) -> str:
        """What the beams of a part are: beam, truss, or spring (discrete beams, whose property is made here)."""
        part = self.deck.parts[number]
        section = self.deck.properties.get(part.property)
        if section is None or section.values.get("elform") != 6:
            return "truss" if section is not None and section.kind in ("truss", "other") else "beam"
        material = self.deck.materials.get(part.material)
        k, c = self.materials.beams.get(part.material, ([0.0] * 6, [0.0] * 6))
        v = section.values
        plain = v["axes"] == 0
        made = Property(self.fresh(self.deck.properties), "spring", "discrete beam", section.title, where=part.where)
        made.values = {
            "type": "beam" if abs(v["system"]) in (2, 12) and plain else "general",
            "mass": material.density * v["volume"] if material else 0.0,
            "inertia": v["inertia"],
            "skew": 0,
            **spring_values(k, c),
        }
        if part.material not in self.materials.beams:
            made.values["nonlinear"] = [material.law if material else 0]
        if not plain:
            self.deck.warn(f"{section.where}: its axes CID {v['axes']} are left aside; directions are taken as global")
        self.deck.properties[made.id] = made
        part.property = made.id
        return "spring"

    def spring_part(self, number: int, scale: float, orientation: int, block: Block, card: int) -> int:
        """Part that stands for the discrete elements of a part with one scale and orientation."""
        key = (number, scale, orientation)
        if key not in self._springs:
            part, deck = self.deck.parts[number], self.deck
            section = deck.properties.get(part.property)
            if section is None:
                block.fail(f"part {number}: section {part.property} is not in the deck", card)
            if part.material not in self.materials.springs:
                what = "is no spring or damper" if part.material in deck.materials else "is not in the deck"
                block.fail(f"part {number}: material {part.material} {what}", card)
            law, k, c = self.materials.springs[part.material]
            torsion = section.values.get("torsion", False)
            frame = self.orientation(orientation, block, card) if orientation else 0
            known = section.kind == "discrete" and frame is not None and (frame or not torsion)
            made = Property(
                self.fresh(deck.properties), "spring" if known else "other", law, section.title, where=block.at(card)
            )
            made.values = {"type": "general" if frame else "axial", "skew": frame or 0, "turning": torsion}
            k, c = k * scale, c * scale
            if torsion:
                unit = block.origin.unit(length=2)  # moments, where the material has scaled forces
                made.values |= spring_values([0.0] * 3 + [k * unit, 0.0, 0.0], [0.0] * 3 + [c * unit, 0.0, 0.0])
            else:
                made.values |= spring_values([k, 0.0, 0.0, 0.0, 0.0, 0.0], [c, 0.0, 0.0, 0.0, 0.0, 0.0])
            made.values |= {"mass": 0.0, "inertia": 0.0}
            if law not in ("S01", "S02"):
                made.values["nonlinear"] = [f"of *MAT_{law}"]
            deck.properties[made.id] = made
            stand_in = Part(self.fresh(deck.parts), part.title, made.id, part.material, where=part.where)
            deck.parts[stand_in.id] = stand_in
            self.stand_ins.setdefault(number, []).append(stand_in.id)
            self._springs[key] = stand_in.id
        return self._springs[key]

    def read_orientations(self, blocks: list[Block]):
        """*DEFINE_SD_ORIENTATION."""
        for block in blocks:
            card, titled = 0, block.has("TITLE")
            while card < block.end:
                card += titled
                number = block.id("define", block.read(card, "i")[0])
                self.orientations[number] = (block, card)
                card += 1

    def orientation(self, number: int, block: Block, card: int) -> int | None:
        """Id of the axes, the first of which is that of an orientation; None where it is of a kind not understood."""
        if number not in self.orientations:
            block.fail(f"orientation {number} is not in the deck", card)
        own, line = self.orientations[number]
        _, kind, *vector = own.read(line, "iirrr")
        axis = np.array(vector)
        if kind == 2:
            nodes = self.deck.nodes([own.id("node", node) for node in own.read(line, ".....ii")], own.at(line))
            axis = self.deck.position[nodes[1]] - self.deck.position[nodes[0]]
        if kind not in (0, 2):
            return None
        if not np.linalg.norm(axis) > 0:
            own.fail(f"orientation {number} has no direction", line)
        x = axis / np.linalg.norm(axis)
        y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
        y /= np.linalg.norm(y)
        ident = len(self.deck.frames) + 1
        self.deck.frames[ident] = np.stack([x, y, np.cross(x, y)])
        return ident

    def with_stand_ins(self, parts: set[int]) -> set[int]:
        return parts.union(*(self.stand_ins.get(number, []) for number in parts))

    def contact_thickness(self, parts: np.ndarray, thickness: np.ndarray) -> np.ndarray:
        """Thickness of shells as contacts count it: *PART_CONTACT's, or theirs times its factor."""
        found = thickness.copy()
        for number, (optt, sft) in self.contact.items():
            mine = parts == number
            found[mine] = optt if optt > 0 else found[mine] * (sft or 1.0)
        return found


def spring_values(k: list[float], c: list[float]) -> dict:
    return {
        "per_length": False,
        "stiffness": k[:3],
        "damping": c[:3],
        "rotational_stiffness": k[3:],
        "rotational_damping": c[3:],
        "nonlinear": [],
    }


def rectangle(s: float, t: float) -> dict:
    """Sides along s and t."""
    iyy, izz = s * t**3 / 12, t * s**3 / 12
    return {"area": s * t, "iyy": iyy, "izz": izz, "ixx": iyy + izz}


def tube(outer: float, inner: float) -> dict:
    bending = math.pi / 64 * (outer**4 - inner**4)
    return {"area": math.pi / 4 * (outer**2 - inner**2), "iyy": bending, "izz": bending, "ixx": 2 * bending}
