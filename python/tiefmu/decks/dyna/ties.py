"""Tied contacts of an LS-DYNA deck: *CONTACT_TIED_..., *CONTACT_SPOTWELD and what is taken for them."""

from dataclasses import dataclass

import numpy as np

from ..model import SHELLS, Deck, Faces, Tie
from ..selected import Selected
from .cards import Block, integer
from .sets import Sets
from .tables import Tables

CRITERION = (0.05, 0.6)  # of the shorter diagonal, of the summed thicknesses: manual, remarks on tied contacts
OPTIONS = ("ID", "TITLE", "MPP", "THERMAL")
OFFSETS = ("CONSTRAINED_OFFSET", "BEAM_OFFSET", "OFFSET")  # the longest ends first
TYPES = {
    0: "segment set", 1: "shell set", 2: "part set", 3: "part", 4: "node set", 5: "all parts", 6: "all but a part set",
}  # fmt: skip


@dataclass
class Kind:
    """What a contact's name means. offset: '' or one of OFFSETS; turns: slaves' rotations are tied too; penalty: a
    reason to say that the code would not tie kinematically."""

    offset: str
    turns: bool
    edge_to_solid: bool = False
    penalty: str = ""

    @property
    def moved(self) -> bool:
        """Whether slaves are moved onto the surface."""
        return not self.offset and not self.penalty


def kind_of(name: str) -> Kind | None:
    """Of a contact's name behind CONTACT_ without OPTIONS; None where it is no tie. ValueError: a tie that is not
    understood."""
    offset = next((one for one in OFFSETS if name.endswith("_" + one)), "")
    base = name.removesuffix("_" + offset) if offset else name
    penalty = {"OFFSET": "OFFSET ties by penalty", "BEAM_OFFSET": "BEAM_OFFSET ties by penalty"}.get(offset, "")
    if base in ("TIED_NODES_TO_SURFACE", "TIED_SURFACE_TO_SURFACE"):
        return Kind(offset, False, penalty=penalty)
    if base == "TIED_SURFACE_TO_SURFACE_FAILURE":
        return Kind(offset, False, penalty="_FAILURE lets go of what is overloaded")
    if base in ("TIED_SHELL_EDGE_TO_SURFACE", "SPOTWELD"):
        return Kind(offset, True, penalty=penalty)
    if base in ("SPOTWELD_WITH_TORSION", "SPOTWELD_WITH_TORSION_PENALTY"):
        return Kind(offset, True, penalty="its torsion ties by penalty")
    if base == "TIED_SHELL_EDGE_TO_SOLID":
        return Kind(offset, True, edge_to_solid=True)
    words = base.split("_")
    if "TIEBREAK" in words or base.endswith(("_TIED", "TIED_WELD")):
        if "SINGLE" in words or "GENERAL" in words:
            raise ValueError
        return Kind(offset, False, penalty="ties by penalty" + (" and can break" if "TIEBREAK" in words else ""))
    if "TIED" in words or "SPOTWELD" in words:
        raise ValueError
    return None


def bare(block: Block) -> str:
    """The contact's name without CONTACT_ and options, which may stand before _OFFSET."""
    return "_".join(word for word in block.words[1:] if word not in OPTIONS)


def headed(block: Block, card: int) -> tuple[int, str]:
    """Id and heading of a card; a heading may hold commas of its own."""
    line, width = block.need(card), block.width("i")
    first, comma, rest = line.partition(b",")
    if not comma or len(first) > width:
        first, rest = line[:width], line[width:]
    try:
        number = integer(first.decode("latin-1").strip())
    except ValueError:
        block.refuse(card, "i", 0, first.decode("latin-1").strip())
    return number, rest.decode("utf-8", "replace").strip()


class Contact:
    """The cards of one contact: title, sides, thicknesses."""

    def __init__(self, block: Block, order: int):
        self.block = block
        card = 0
        self.number, self.title = order, ""
        if block.has("ID", "TITLE"):
            self.number, self.title = headed(block, 0)
            self.number = self.number or order
            card = 1
        if block.has("MPP"):
            card += 1
            while card < block.end and block.lines[card].lstrip().startswith(b"&"):
                card += 1
        self.first = card

    @property
    def name(self) -> str:
        return self.title or f"tie {self.number}"

    def read(self):
        block = self.block
        self.slave, self.master, *types = block.read(self.first, "iiiiii")
        self.slave_type, self.master_type, self.slave_box, self.master_box = types
        self.birth, self.death = block.or_blank(self.first + 1, "......rr")
        _, _, self.sst, self.mst, self.sfst, self.sfmt = block.or_blank(self.first + 2, "rrrrrr")
        fourth = block.has("TIEBREAK", "WELD")  # which have a card of their own before the optional ones
        *_, self.solid_thickness = block.or_blank(self.first + 4 + fourth, "rrrrrrr")  # optional card B, SLDTHK
        unit = block.origin.unit(length=1)
        self.sst, self.mst, self.solid_thickness = self.sst * unit, self.mst * unit, self.solid_thickness * unit


def read(deck: Deck, sets: Sets, tables: Tables, contact: Contact, kind: Kind) -> Tie:
    """One tied contact."""
    block, name = contact.block, contact.name
    contact.read()
    where = f"tie '{name}'"
    slaves = side_nodes(deck, sets, contact.slave, contact.slave_type, block, contact.first, where)
    faces = side_faces(deck, sets, contact.master, contact.master_type, block, contact.first, where)
    if contact.slave_box > 0:
        slaves = slaves[sets.inside(block.id("define", contact.slave_box), block)[slaves]]
    if contact.master_box > 0:
        faces = sets.in_box(faces, block.id("define", contact.master_box), block)
    if not len(slaves):
        block.fail(
            f"{where}: its slave side ({TYPES[contact.slave_type]} {contact.slave}) holds no nodes", contact.first
        )
    if not len(faces):
        block.fail(
            f"{where}: its master side ({TYPES[contact.master_type]} {contact.master}) holds no segments", contact.first
        )
    negative = contact.sst < 0 or contact.mst < 0
    tie = Tie(
        name,
        slaves,
        thick_faces(tables, contact, faces, negative),
        "optimized" if kind.edge_to_solid else "default",
        "box",
        unresolved="drop",
        pairwise=(0.0, CRITERION[1]) if negative else CRITERION,
        hand_on_rotations=kind.turns or kind.moved or kind.offset in OFFSETS[:2],  # moved ones have no arm
        slave_rotations=kind.turns,
        slave_thickness=slave_thickness(deck, tables, contact, negative),
        adjust=kind.moved,
        onto_middle=True,
        where=block.where,
    )
    say(deck, contact, kind, tie, negative)
    return tie


def share_masters(deck: Deck):
    """Masters keep their rotations for a tie that needs them, also where another one hands no moment on."""
    turning = np.zeros(len(deck.node_id), bool)
    for tie in deck.ties:
        if tie.hand_on_rotations:
            turning[tie.faces.nodes[tie.faces.nodes >= 0]] = True
    for tie in deck.ties:
        if not tie.hand_on_rotations and turning[tie.faces.nodes[tie.faces.nodes >= 0]].any():
            tie.hand_on_rotations = True
            deck.warn(
                f"{tie.where}: tie '{tie.name}': the moment of its offset goes to its masters, as other ties need "
                "their rotations"
            )


def say(deck: Deck, contact: Contact, kind: Kind, tie: Tie, negative: bool):
    block = contact.block
    if kind.penalty:
        deck.warn(f"{block.where}: tie '{tie.name}': {kind.penalty}; it is taken as kinematic")
    if contact.birth > 0 or 0 < contact.death < 1e18:
        deck.warn(f"{block.where}: tie '{tie.name}': its birth and death times are left aside; it holds always")
    said = []
    if kind.turns:
        said.append("translations and rotations are tied")
    elif tie.hand_on_rotations and not kind.moved:
        said.append("translations are tied, with the moment of the offset; rotations of slaves are free and left out")
    else:
        said.append("translations alone are tied; rotations of slaves are left out")
    if kind.edge_to_solid:
        said.append("formulation optimized, as moments go to solids as couples")
    if tie.adjust:
        said.append("slaves are moved onto the surface, as the contact has no _OFFSET")
    if negative:
        said.append(
            f"tolerance 0.6 (|SST| + |MST|) = {CRITERION[1] * (abs(contact.sst) + abs(contact.mst)):g}, as one of them "
            "is negative"
        )
    else:
        said.append("tolerance per pair: the larger of 0.05 shorter diagonals and 0.6 (t_s + t_m)")
    said.append("a slave beyond it is dropped")
    deck.notes.append(f"tie '{tie.name}' ({block.where}): " + "; ".join(said))


def side_parts(sets: Sets, number: int, kind: int, block: Block, card: int) -> set[int] | None:
    """Parts of a side of type 2, 3, 5 or 6; None for another type."""
    deck = sets.deck
    if kind == 2:
        return sets.parts(block.id("set", number), block)
    if kind == 3:
        return sets.parts_known([number], block, card)
    if kind == 5:
        return set(deck.parts)
    if kind == 6:
        return set(deck.parts) - sets.parts(block.id("set", number), block)
    return None


def side_nodes(deck: Deck, sets: Sets, number: int, kind: int, block: Block, card: int, where: str) -> np.ndarray:
    """Slave nodes of a side: of parts, nodes of shells, beams and springs, and the outer ones of solids."""
    check_side(number, kind, block, card, where, TYPES)
    if kind == 4:
        return sets.nodes(block.id("set", number), block)
    parts = side_parts(sets, number, kind, block, card)
    if parts is None:
        faces = side_faces(deck, sets, number, kind, block, card, where)
        return np.unique(faces.nodes[faces.nodes >= 0])
    selected = Selected.of_parts(deck, parts)
    mask = selected.only((*SHELLS, "beam", "truss", "spring")).nodes(deck)
    faces = sets.faces_of_elements(selected)
    mask[faces.nodes[faces.nodes >= 0]] = True
    return np.flatnonzero(mask)


def side_faces(deck: Deck, sets: Sets, number: int, kind: int, block: Block, card: int, where: str) -> Faces:
    check_side(number, kind, block, card, where, {k: v for k, v in TYPES.items() if k != 4})
    if kind == 0:
        return sets.segments(block.id("set", number), block)
    if kind == 1:
        return sets.faces_of_elements(sets.elements("SHELL", block.id("set", number), block))
    return sets.faces_of_parts(side_parts(sets, number, kind, block, card) or set())


def check_side(number: int, kind: int, block: Block, card: int, where: str, types: dict):
    if kind not in types:
        block.fail(f"{where}: a side of type {kind} is not understood", card)
    if number <= 0 and kind != 5:
        block.fail(f"{where}: names no {TYPES[kind]}", card)


def thick_faces(tables: Tables, contact: Contact, faces: Faces, negative: bool) -> Faces:
    """The faces with the thickness that the criterion counts."""
    if negative:
        thickness = np.full(len(faces), abs(contact.mst))
    else:
        thickness = tables.contact_thickness(faces.part, faces.thickness)
        if contact.mst > 0:
            thickness[thickness > 0] = contact.mst
        thickness[thickness > 0] *= contact.sfmt or 1.0
        thickness[thickness == 0] = max(contact.solid_thickness, 0.0)
    return Faces(faces.nodes, faces.element, faces.part, thickness)


def slave_thickness(deck: Deck, tables: Tables, contact: Contact, negative: bool) -> np.ndarray:
    """Per node of the deck: the largest thickness of its shells as the contact counts it."""
    found = np.zeros(len(deck.node_id))
    if negative:
        return found + abs(contact.sst)
    for kind in SHELLS:
        elements = deck.elements.get(kind)
        if elements is not None:
            t = tables.contact_thickness(elements.part, deck.thickness(elements))
            t = (np.full(len(t), contact.sst) if contact.sst > 0 else t) * (contact.sfst or 1.0)
            nodes = elements.nodes.ravel()
            np.maximum.at(found, nodes[nodes >= 0], np.repeat(t, elements.nodes.shape[1])[nodes >= 0])
    return found
