"""What holds, moves, joins and loads nodes in an LS-DYNA deck."""

import numpy as np

from ..element_lengths import hex_volume, shell_area, tetra_length
from ..element_properties import structural_mass
from ..model import SHELLS, Deck, Fixed, Initial, RigidBody
from ..selected import Selected
from .cards import Block
from .sets import Sets
from .tables import Tables

CODES = {0: "", 1: "x", 2: "y", 3: "z", 4: "xy", 5: "yz", 6: "xz", 7: "xyz"}


def held(code: float) -> tuple[bool, bool, bool]:
    """Directions of a constraint code."""
    axes = CODES.get(int(code), "")
    return "x" in axes, "y" in axes, "z" in axes


def spc(deck: Deck, sets: Sets, block: Block):
    """*BOUNDARY_SPC_NODE and _SET."""
    card, step = 0, 1 + block.has("ID") + block.has("BIRTH")
    if block.has("BIRTH"):
        deck.warn(f"{block.where}: its birth and death times are left aside")
    card += block.has("ID")
    while card < block.end:
        number, system, *flags = block.read(card, "iirrrrrr")
        if number:
            nodes = (
                sets.nodes(block.id("set", number), block)
                if block.has("SET")
                else deck.nodes([block.id("node", number)], block.at(card))
            )
            move, turn = tuple(f != 0 for f in flags[:3]), tuple(f != 0 for f in flags[3:])
            partly = any(any(three) and not all(three) for three in (move, turn))
            if system and partly:
                deck.warn(f"{block.at(card)}: its system {system} is left aside; directions are taken as global")
            deck.fixed.append(Fixed(nodes, move, turn, block.where))
        card += step


def node_codes(deck: Deck, groups: list[tuple[np.ndarray, int, int]], where: str):
    """TC and RC of *NODE."""
    for ids, move, turn in groups:
        deck.fixed.append(Fixed(deck.nodes(ids, where), held(move), held(turn), where))


def imposed(deck: Deck, sets: Sets, block: Block, rigid: "RigidParts"):
    """*BOUNDARY_PRESCRIBED_MOTION: the nodes that it moves."""
    card, titled = 0, block.has("ID")
    if block.has("SEGMENT", "LINE", "EDGE", "BOX"):
        deck.warn(f"{block.where}: is left aside; nodes that it moves are not known to be moved")
        return
    while card < block.end:
        card += titled
        number, freedom, kind = block.read(card, "irr")
        if number:
            if block.has("RIGID"):
                nodes = rigid.nodes_of(block.id("part", number), block, card)
            elif block.has("SET"):
                nodes = sets.nodes(block.id("set", number), block)
            else:
                nodes = deck.nodes([block.id("node", number)], block.at(card))
            deck.imposed = np.union1d(deck.imposed, nodes)
        card += 2 if abs(freedom) in (9, 10, 11) or kind == 4 else 1


class RigidParts:
    """Rigid bodies: parts of *MAT_RIGID with their extra nodes and merged parts, *CONSTRAINED_NODAL_RIGID_BODY."""

    def __init__(self, deck: Deck, sets: Sets, tables: Tables):
        self.deck, self.sets, self.tables = deck, sets, tables
        self.members: dict[int, np.ndarray] = {}
        for number, part in deck.parts.items():
            if part.material in tables.materials.rigid and number > 0:
                nodes = Selected.of_parts(deck, {number}).nodes(deck)
                if nodes.any():
                    self.members[number] = nodes
        self.nodal: dict[int, RigidBody] = {}

    def nodes_of(self, number: int, block: Block, card: int) -> np.ndarray:
        if number in self.nodal:
            return self.nodal[number].nodes
        if number in self.members:
            return np.flatnonzero(self.members[number])
        if number not in self.deck.parts:
            block.fail(f"rigid body {number} is not in the deck", card)
        return np.empty(0, np.int64)

    def extra(self, block: Block):
        """*CONSTRAINED_EXTRA_NODES_NODE and _SET."""
        for card in range(block.end):
            part, number, *_ = block.read(card, "ii")
            part = block.id("part", part)
            if not number:
                continue
            nodes = (
                self.sets.nodes(block.id("set", number), block)
                if block.has("SET")
                else self.deck.nodes([block.id("node", number)], block.at(card))
            )
            if part not in self.deck.parts:
                block.fail(f"part {part} is not in the deck", card)
            self.members.setdefault(part, np.zeros(len(self.deck.node_id), bool))[nodes] = True

    def merge(self, block: Block):
        """*CONSTRAINED_RIGID_BODIES: the second part is one with the first."""
        for card in range(block.end):
            first, second = (block.id("part", number) for number in block.read(card, "ii"))
            if first in self.members and second in self.members and first != second:
                self.members[first] |= self.members.pop(second)

    def nodal_body(self, block: Block):
        """*CONSTRAINED_NODAL_RIGID_BODY with its options."""
        card, titled = 0, block.has("TITLE")
        more = block.has("SPC", "INERTIA", "OVERRIDE")
        while card < block.end:
            title = block.text(card) if titled else ""
            card += titled
            number, _, group, main = block.read(card, "iiii")
            ident = block.id("part", number)
            nodes = self.sets.nodes(block.id("set", group or number), block)
            node = int(self.deck.nodes([block.id("node", main)], block.at(card))[0]) if main else -1
            body = RigidBody(title or f"rigid body {ident}", node, nodes, block.at(card))
            if block.has("SPC") and fixed_for_good(block.or_blank(card + 1, "rrr")):
                self.deck.fixed.append(Fixed(nodes, (True,) * 3, (True,) * 3, block.where))
            else:
                self.deck.rigid.append(body)
            self.nodal[ident] = body
            if more:  # the last of the inertia cards is there only with a system of its own
                break
            card += 1

    def finish(self):
        """Parts as rigid bodies; those that are held in all directions as fixed nodes."""
        deck = self.deck
        for number, mask in self.members.items():
            part = deck.parts[number]
            nodes, codes = np.flatnonzero(mask), self.tables.materials.rigid.get(part.material, (0.0, 0.0, 0.0))
            if fixed_for_good(codes):
                deck.fixed.append(Fixed(nodes, (True,) * 3, (True,) * 3, part.where))
                continue
            main = self.tables.centre_node.get(number, 0)
            index = int(deck.nodes([main], part.where)[0]) if main else -1
            deck.rigid.append(RigidBody(part.title or f"rigid part {number}", index, nodes, part.where))

    def mask(self) -> np.ndarray:
        found = np.zeros(len(self.deck.node_id), bool)
        for members in self.members.values():
            found |= members
        for body in self.nodal.values():
            found[body.nodes] = True
        return found


def fixed_for_good(codes) -> bool:
    """CMO 1 with all translations and rotations, or CMO -1 with all six digits."""
    cmo, con1, con2 = codes
    return (cmo == 1 and con1 == 7 and con2 == 7) or (cmo == -1 and int(con2) == 111111)


def say_rigid(deck: Deck, rigid: RigidParts, kinds: dict):
    """Constraint ties to rigid bodies, which the solver does not make. kinds: name of the tie -> offset of its name."""
    mask = rigid.mask()
    if not mask.any():
        return
    for tie in deck.ties:
        if kinds[tie.name] in ("OFFSET", "BEAM_OFFSET"):
            continue
        masters = np.unique(tie.faces.nodes[tie.faces.nodes >= 0])
        for nodes, what in ((tie.slaves, "slaves"), (masters, "masters")):
            inside = nodes[mask[nodes]]
            if len(inside):
                deck.warn(
                    f"{tie.where}: tie '{tie.name}': {len(inside)} {what}, the first is node {deck.node_id[inside[0]]}"
                    ", belong to rigid bodies, to which LS-DYNA ties by penalty only (_OFFSET); they are tied here"
                )


# masses


def mass(deck: Deck, sets: Sets, block: Block):
    """*ELEMENT_MASS and _NODE_SET, whose mass is shared among the nodes."""
    (_, number, value), cards = block.table("IIR")
    unit = block.origin.unit(mass=1)
    negative = value < 0
    if negative.any():
        row = int(np.argmax(negative))
        block.fail(f"its mass {value[row]:g} is negative", int(cards[row]))
    if block.has("SET"):
        for ident, one in zip(number.tolist(), value.tolist()):
            nodes = sets.nodes(block.id("set", ident), block)
            if len(nodes):
                deck.added_mass.append((nodes, one * unit / len(nodes)))
        return
    ids = number + block.origin.node
    index = deck._find(ids)
    if (index < 0).any():
        row = int(np.argmax(index < 0))
        block.fail(f"node {ids[row]} is not in the deck", int(cards[row]))
    deck.added_mass.append((index, value * unit))


def mass_of_parts(deck: Deck, sets: Sets, block: Block):
    """*ELEMENT_MASS_PART and _SET: ADDMASS or up to FINMASS, spread by area of shells and volume of solids."""
    for card in range(block.end):
        number, added, whole = block.read(card, "IRR")
        if not number:
            continue
        if added < 0:
            block.fail(f"its mass {added:g} is negative", card)
        parts = (
            sets.parts(block.id("set", number), block) if block.has("SET") else sets.parts_known([number], block, card)
        )
        added *= block.origin.unit(mass=1)
        if whole:
            own, whole = structural_mass(deck, set(parts)).sum(), whole * block.origin.unit(mass=1)
            if added:
                block.fail("it has both ADDMASS and FINMASS; leave one", card)
            if whole <= own:
                block.fail(f"its FINMASS {whole:g} is not more than the mass of its elements, {own:g}", card)
            added = whole - own
        share = np.zeros(len(deck.node_id))
        for kind, one in deck.elements.items():
            nodes = one.nodes[np.isin(one.part, sorted(parts))]
            weight = element_sizes(deck, kind, nodes) / nodes.shape[1]
            given = nodes >= 0
            share += np.bincount(
                nodes[given], weights=np.broadcast_to(weight[:, None], nodes.shape)[given], minlength=len(share)
            )
        if share.sum() > 0:
            nodes = np.flatnonzero(share)
            deck.added_mass.append((nodes, added * share[nodes] / share.sum()))


def element_sizes(deck: Deck, kind: str, nodes: np.ndarray) -> np.ndarray:
    """Area of shells, volume of solids, length of others."""
    x = deck.position[np.where(nodes < 0, nodes[:, [0]], nodes)]
    if kind == "shell4":
        return shell_area(x)
    if kind == "shell3":
        return shell_area(x[:, [0, 1, 2, 2]])
    if kind == "hex8":
        return hex_volume(x)
    if kind in ("tet4", "tet10"):
        return tetra_length(x[:, :4])[0]
    return np.linalg.norm(x[:, 1] - x[:, 0], axis=1)


def mass_of_sections(deck: Deck):
    """MAREA of *SECTION_SHELL, NSM of *SECTION_BEAM."""
    for kind, key in [(kind, "per_area") for kind in SHELLS] + [
        (kind, "mass_per_length") for kind in ("beam", "truss")
    ]:
        one = deck.elements.get(kind)
        if one is None:
            continue
        for _, prop, _, members in deck.part_values(one.part):
            added = prop.values.get(key, 0.0) if prop else 0.0
            if added:
                nodes = one.nodes[members]
                share = added * element_sizes(deck, kind, nodes) / nodes.shape[1]
                deck.added_mass += [(nodes[:, column], share) for column in range(nodes.shape[1])]


def inertia(deck: Deck, block: Block):
    """*ELEMENT_INERTIA: mass, and the mean of the three moments."""
    card = 0
    while card < block.end:
        _, number, _ = block.read(card, "III")
        xx, xy, xz, yy, yz, zz, added = block.read(card + 1, "rrrrrrr")
        node = deck.nodes([block.id("node", number)], block.at(card))
        mean, unit = (xx + yy + zz) / 3, block.origin.unit
        if min(mean, added) < 0:
            block.fail("its mass or inertia is negative", card + 1)
        deck.added_mass.append((node, added * unit(mass=1)))
        deck.added_inertia.append((node, mean * unit(length=2, mass=1)))
        if xy or xz or yz or not xx == yy == zz:
            deck.warn(f"{block.at(card)}: the mean of its moments of inertia, {mean:g}, is taken")
        if block.has("OFFSET"):
            deck.warn(f"{block.at(card)}: its offset is left aside")
        card += 3 if block.has("OFFSET") else 2


# start and gravity


def velocity(deck: Deck, sets: Sets, block: Block, rigid: RigidParts):
    """*INITIAL_VELOCITY, _NODE, _RIGID_BODY and _GENERATION without rotation."""
    words, card = block.name.removeprefix("INITIAL_VELOCITY"), 0
    if words == "_NODE":
        return velocity_of_nodes(deck, block)
    while card < block.end:
        system = except_set = box = 0
        if words == "_RIGID_BODY":
            number, *vector, system = block.read(card, "irrrrrri")
            nodes = rigid.nodes_of(block.id("part", number), block, card)
            card += 1
        elif words == "":
            number, except_set, box, _, system = block.read(card, "iiiii")
            vector = block.read(card + 1, "rrrrrr")
            nodes = sets.nodes(block.id("set", number), block) if number else np.arange(len(deck.node_id))
            if box:
                nodes = nodes[sets.inside(block.id("define", box), block)[nodes]]
            card += 3 if except_set else 2
        elif words == "_GENERATION":
            number, kind, omega, *vector, _, system = block.read(card, "iirrrrii")
            if omega:
                deck.warn(f"{block.at(card)}: start velocities that turn are not taken; give them as [[initial]]")
                card += 2
                continue
            vector += [0.0] * 3
            nodes = generation(deck, sets, number, kind, block, card)
            card += 2
        else:
            deck.warn(f"{block.where}: its start velocities are not taken; give them as [[initial]]")
            return
        if system or except_set:
            deck.warn(
                f"{block.at(min(card, block.end) - 1)}: start velocities in a system of their own or with exempted "
                "nodes are not taken; give them as [[initial]]"
            )
            continue
        start(deck, nodes, np.array(vector), block)


def velocity_of_nodes(deck: Deck, block: Block):
    """*INITIAL_VELOCITY_NODE, nodes of one velocity together."""
    (number, *vector, system), cards = block.table("irrrrrri")
    if system.any():
        deck.warn(f"{block.where}: start velocities in a system of their own are not taken; give them as [[initial]]")
    vectors = np.stack(vector, axis=1)
    for one in np.unique(vectors[system == 0], axis=0):
        which = (vectors == one).all(axis=1) & (system == 0)
        start(deck, deck.nodes(number[which] + block.origin.node, block.at(int(cards[np.argmax(which)]))), one, block)


def start(deck: Deck, nodes: np.ndarray, vector: np.ndarray, block: Block):
    """Start velocities from translations and rotations (6)."""
    deck.initial.append(Initial(nodes, v=vector[:3] * block.origin.unit(length=1, time=-1), where=block.where))
    if vector[3:].any():
        deck.initial.append(Initial(nodes, w=vector[3:] / block.origin.time, where=block.where))


def generation(deck: Deck, sets: Sets, number: int, kind: int, block: Block, card: int) -> np.ndarray:
    if kind == 3:
        return sets.nodes(block.id("set", number), block) if number else np.arange(len(deck.node_id))
    if kind not in (1, 2):
        block.fail(f"nodes by type {kind} are not understood", card)
    if not number:
        return np.arange(len(deck.node_id))
    parts = sets.parts(block.id("set", number), block) if kind == 1 else sets.parts_known([number], block, card)
    return np.flatnonzero(Selected.of_parts(deck, parts).nodes(deck))


def curves(blocks: list[Block]) -> dict[int, np.ndarray]:
    """*DEFINE_CURVE: id -> ordinates."""
    found = {}
    for block in blocks:
        first = 1 if block.has("TITLE") else 0
        if block.name not in ("DEFINE_CURVE", "DEFINE_CURVE_TITLE") or first >= len(block.lines):
            continue
        number, _, _, scale, _, offset = block.read(first, "iirrrr")
        (_, y), _ = block.table("QQ", [c for c in range(first + 1, block.end) if block.lines[c].strip()])
        found[block.id("function", number)] = (scale or 1.0) * (y + offset)
    return found


def gravity(deck: Deck, block: Block, known: dict[int, np.ndarray], restricted: bool):
    """*LOAD_BODY_X, _Y, _Z: the acceleration of the base, so that gravity acts against it."""
    axis = "XYZ".index(block.words[2])
    number, scale, *_, system = block.read(0, "irirrri")
    curve = known.get(block.id("function", number))
    if curve is None or not len(curve):
        block.fail(f"curve {number} is not in the deck", 0)
    if system:
        deck.warn(f"{block.where}: gravity in system {system} is not taken; give [model] gravity")
        return
    if np.ptp(curve) > 1e-9 * max(np.abs(curve).max(), 1e-300):
        deck.warn(f"{block.where}: gravity changes with time (curve {number}) and is not taken; give [model] gravity")
        return
    if restricted:
        deck.warn(f"{block.where}: gravity acts on parts of *LOAD_BODY_PARTS only; it is taken for all nodes")
    if deck.gravity is None:
        deck.gravity = np.zeros(3)
    deck.gravity[axis] -= (scale or 1.0) * float(curve[0]) * block.origin.unit(length=1, time=-2)
