"""LS-DYNA keyword decks: from the file to a Deck.

Cards follow the LS-DYNA Keyword User's Manual, volumes I and II; docs/decks_dyna.md lists the keywords.
"""

import re
from pathlib import Path

import numpy as np

from ..._core import SceneError
from ...units import LENGTHS, MASSES, TIMES
from ..choice import Choice
from ..model import SOLIDS, Deck, Material, Property
from ..selected import Selected
from ..units import check
from . import files, keywords, loads, materials, mesh, ties
from .cards import Block, Origin
from .sets import Sets
from .tables import Tables

SUFFIXES = (".k", ".key", ".dyn", ".dyna")
UNDERSCORED = re.compile(rb"^\*(ELEMENT|SECTION|MAT|SET|CONTACT|CONTROL|DATABASE|PART|DEFINE|INCLUDE)_[A-Z]")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file is an LS-DYNA deck, by its first bytes: *KEYWORD, or keywords of words joined by _."""
    lines = [line.strip().upper() for line in head.split(b"\n")]
    starred = [line for line in lines if line.startswith(b"*")]
    first = next((line for line in lines if line and not line.startswith(b"$")), b"")
    if not first.startswith(b"*") or first.startswith((b"**", b"*HEADING")):
        return False
    if first.startswith(b"*KEYWORD") or any(UNDERSCORED.match(line) for line in starred):
        return True
    return path.suffix.lower() in SUFFIXES


def read(path: Path, file: str, wanted: list[str] | None = None) -> Deck:
    """The deck, with the ties named in `wanted` (titles or ids), or all of them. SceneError on the first thing that is
    wrong: "FILE: line N: *KEYWORD: message"."""
    reader = files.Reader(path, file)
    reader.read(path, file, Origin(), None)
    deck = Deck(file, "LS-DYNA")
    deck.warnings += reader.warnings
    deck.notes += [f"*INCLUDE_TRANSFORM: {line}" for line in reader.included]
    by_key: dict[str, list[Block]] = {}
    for block in reader.blocks:
        if keywords.place(block.name)[0] == "used":
            by_key.setdefault(keywords.beginning(block.name, keywords.USED) or "", []).append(block)

    def of(*names: str) -> list[Block]:
        return [block for name in names for block in by_key.get(name, [])]

    titles = [block for block in of("TITLE") if block.end]
    deck.title = titles[0].text(0) if titles else ""
    codes = mesh.read_nodes(deck, of("NODE"), of("DEFINE_TRANSFORMATION"))
    found = materials.read(deck, of("MAT"))
    viscosity = [block.or_blank(0, "rr")[1] for block in of("CONTROL_BULK_VISCOSITY")]
    tables = Tables(deck, found, viscosity[0] if viscosity else 0.0)
    tables.read_sections(of("SECTION"))
    tables.read_parts(of("PART"))
    tables.read_orientations(of("DEFINE_SD_ORIENTATION"))
    read_elements(deck, of, tables)
    check_references(deck, tables)
    units = of("CONTROL_UNITS")
    check(deck, units[0].where if units else file, read_units(deck, units))
    sets = Sets(deck, tables, [b for key in by_key if key.startswith("SET_") for b in by_key[key]], of("DEFINE_BOX"))
    offsets = read_ties(deck, sets, tables, of("CONTACT"), wanted)
    read_masses(deck, sets, of)
    read_loads(deck, sets, tables, of, codes, offsets)
    deck.lookup = lambda name: lookup(deck, sets, name)
    say_what_is_left(deck, reader.blocks)
    return deck


def read_elements(deck: Deck, of, tables: Tables):
    collected = mesh.Collected(deck)
    for block in of("ELEMENT_SHELL"):
        mesh.shells(deck, block, collected)
    for block in of("ELEMENT_SOLID", "ELEMENT_TSHELL"):
        mesh.solids(deck, block, collected)
    for block in of("ELEMENT_BEAM"):
        mesh.beams(deck, block, collected, tables)
    for block in of("ELEMENT_DISCRETE"):
        mesh.discrete(deck, block, collected, tables)
    collected.finish()


def check_references(deck: Deck, tables: Tables):
    """Sections and materials of parts that have elements exist and suit them; what they lack is said."""
    for kind, elements in deck.elements.items():
        for number in np.unique(elements.part).tolist():
            part = deck.parts[number]
            section, material = deck.properties.get(part.property), deck.materials.get(part.material)
            if section is None:
                raise SceneError(f"{part.where}: section {part.property} is not in the deck")
            if material is None:
                raise SceneError(f"{part.where}: material {part.material} is not in the deck")
            if kind == "spring":
                continue
            right = {"shell4": "shell", "shell3": "shell", "beam": "beam", "truss": "truss"}.get(kind, "solid")
            count = int((elements.part == number).sum())
            if section.kind == "other":
                deck.warn(
                    f"{section.where}: this section is not understood; {count} elements of part {number} add no mass "
                    "and no stiffness"
                )
                silence(deck, section.id, part, right)
            elif section.kind != right:
                raise SceneError(
                    f"{part.where}: part {number} has {right} elements, but section {part.property} is of kind "
                    f"{section.kind}"
                )
            elif part.material in tables.materials.unread:
                deck.warn(
                    f"{material.where}: its elastic constants are not read; {count} elements of part {number} add mass "
                    "and no stiffness"
                )
                material.void = material.void or right == "solid"


def silence(deck: Deck, section: int, part, right: str):
    """A part whose section is not understood: no mass, no stiffness, but a surface."""
    values = {"thickness": 0.0, "area": 0.0, "iyy": 0.0, "izz": 0.0, "ixx": 0.0, "qb": 0.05}
    prop = Property(Tables.fresh(deck.properties), "void", "", values=values, where=part.where)
    empty = Material(Tables.fresh(deck.materials), void=True, where=part.where)
    deck.properties[prop.id], deck.materials[empty.id] = prop, empty
    part.property, part.material = prop.id, empty.id


UNIT_NAMES = {
    "sec": "s", "mm": "mm", "msec": "ms", "micro_s": "us", "mtrc_ton": "t", "ton": "t", "kg": "kg", "gm": "g",
    "gram": "g", "meter": "m", "inch": "in", "foot": "ft",
}  # fmt: skip


def read_units(deck: Deck, blocks: list[Block]) -> bool:
    """*CONTROL_UNITS: sets deck.units where a scene knows all three; whether it did."""
    for block in blocks:
        if not block.end:
            continue
        words = [word.lower() for word in block.fields(0, "sss")]
        length, time, mass = (UNIT_NAMES.get(word, word) for word in words)
        if length in LENGTHS and time in TIMES and mass in MASSES:
            deck.units = (length, mass, time)
            return True
        deck.warn(f"{block.where}: its units are not all known; they are guessed from a material")
    return False


def read_ties(deck: Deck, sets: Sets, tables: Tables, blocks: list[Block], wanted: list[str] | None) -> dict:
    """Fills deck.ties; returns name -> offset of the contact's name."""
    choice, offsets = Choice(deck, "*CONTACT", wanted), {}
    for order, block in enumerate(blocks, 1):
        name = ties.bare(block)
        try:
            kind = ties.kind_of(name)
        except ValueError:
            deck.warn(f"{block.where}: ties of this kind are not understood; it is left aside")
            continue
        if kind is None:
            left(deck, "*CONTACT", "contacts that do not tie are the host's")
            continue
        contact = ties.Contact(block, order)
        if choice.wants(contact.name, contact.number):
            tie = ties.read(deck, sets, tables, contact, kind)
            choice.add(tie, contact.number)
            offsets[tie.name] = kind.offset
    choice.finish()
    ties.share_masters(deck)
    say_solid_welds(deck)
    return offsets


def say_solid_welds(deck: Deck):
    """Spot welds of solids at slaves, whose forces are not in the scene."""
    slaves = np.unique(np.concatenate([tie.slaves for tie in deck.ties]))
    for kind in SOLIDS:
        elements = deck.elements.get(kind)
        if elements is None:
            continue
        for part, _, material, members in deck.part_values(elements.part):
            if material is None or materials.number_of(material.law) != 100:
                continue
            count = int(np.isin(elements.nodes[members], slaves).any(axis=1).sum())
            if count:
                deck.warn(
                    f"{part.where}: {count} solids of spot welds are at slaves: the scene has their masses, not their "
                    "forces, which the host gives to the slaves"
                )


def read_masses(deck: Deck, sets: Sets, of):
    for block in of("ELEMENT_MASS", "ELEMENT_MASS_NODE_SET"):
        loads.mass(deck, sets, block)
    for block in of("ELEMENT_MASS_PART", "ELEMENT_MASS_PART_SET"):
        loads.mass_of_parts(deck, sets, block)
    for block in of("ELEMENT_INERTIA"):
        loads.inertia(deck, block)
    loads.mass_of_sections(deck)


def read_loads(deck: Deck, sets: Sets, tables: Tables, of, codes, offsets: dict):
    rigid = loads.RigidParts(deck, sets, tables)
    for block in of("CONSTRAINED_EXTRA_NODES_NODE", "CONSTRAINED_EXTRA_NODES_SET"):
        rigid.extra(block)
    for block in of("CONSTRAINED_RIGID_BODIES"):
        rigid.merge(block)
    for block in of("CONSTRAINED_NODAL_RIGID_BODY"):
        rigid.nodal_body(block)
    rigid.finish()
    loads.say_rigid(deck, rigid, offsets)
    loads.node_codes(deck, codes, f"{deck.file}: *NODE")
    for block in of("BOUNDARY_SPC_NODE", "BOUNDARY_SPC_SET"):
        loads.spc(deck, sets, block)
    for block in of("BOUNDARY_PRESCRIBED_MOTION"):
        loads.imposed(deck, sets, block, rigid)
    for block in of("INITIAL_VELOCITY"):
        loads.velocity(deck, sets, block, rigid)
    bodies = of("LOAD_BODY_X", "LOAD_BODY_Y", "LOAD_BODY_Z")
    known = loads.curves(of("DEFINE_CURVE")) if bodies else {}
    for block in bodies:
        loads.gravity(deck, block, known, bool(of("LOAD_BODY_PARTS")))


def lookup(deck: Deck, sets: Sets, name: str) -> np.ndarray | None:
    """Node indices of a part, part set or node set called `name` (title or id); None where there is none."""
    wanted = name.strip().lower()
    parts = {part.id for part in deck.parts.values() if wanted in (part.title.lower(), str(part.id))}
    if not parts:
        for (kind, number), blocks in sets.blocks.items():
            if kind in ("NODE", "PART") and wanted in (sets.title(blocks[0]).lower(), str(number)):
                if kind == "NODE":
                    return sets.nodes(number, blocks[0])
                parts |= sets.parts(number, blocks[0])
    if not parts:
        return None
    return np.flatnonzero(Selected.of_parts(deck, sets.tables.with_stand_ins(parts)).nodes(deck))


def left(deck: Deck, name: str, why: str):
    deck.ignored.setdefault(name, [why, 0])[1] += 1


def say_what_is_left(deck: Deck, blocks: list[Block]):
    """Nothing is dropped in silence: a reason, or a warning with the line."""
    for block in blocks:
        what, why = keywords.place(block.name)
        if what == "safe":
            left(deck, "*" + (keywords.beginning(block.name, set().union(*keywords.SAFE.values())) or ""), why)
        elif what == "matters":
            deck.warn(f"{block.where}: is not read; {why}")
        elif what == "unknown":
            deck.warn(f"{block.where}: is not understood and is left aside")
