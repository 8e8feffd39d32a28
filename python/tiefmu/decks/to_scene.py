"""From a deck to a scene: which nodes and segments it needs, what they weigh, who moves them.

Masters and the other ends of springs are driven unless `free` names a part or set that holds them; everything else is
decided here, and said in the deck's notes and warnings.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .._core import SceneError
from ..units import DIMENSIONS, LENGTHS, MASSES, TIMES
from .element_properties import Nodal, nodal, warn_of_nothing
from .model import TURNING, Deck, Faces, Tie
from .shared_slaves import settle_shared
from .springs import held_by_scene, spring_tables
from .surfaces import match_rows


@dataclass
class Written:
    """A scene in three parts. tables: as in the TOML file, without what the two files hold; the mesh (positions in
    the scene's units, segments as node ids with 0 for a triangle's fourth, sets of ids); columns of node properties.
    pairwise: ties whose slaves still have to be compared with the tolerance of the segment that they find; unit: of
    lengths, in m."""

    tables: dict
    node_id: np.ndarray
    position: np.ndarray
    segment_id: np.ndarray
    segments: np.ndarray
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    segment_sets: dict[str, np.ndarray] = field(default_factory=dict)
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    pairwise: dict[str, dict] = field(default_factory=dict)
    unit: float = 1.0


def convert(deck: Deck, free: tuple[str, ...] = ()) -> Written:
    """The scene of the deck's ties. free: names of parts or sets whose masters the FMU integrates."""
    n = len(deck.node_id)
    slave, master = np.zeros(n, bool), np.zeros(n, bool)
    pass_over_masters(deck)
    settle_shared(deck)
    for tie in deck.ties:
        slave[tie.slaves] = True
        master[tie.faces.nodes[tie.faces.nodes >= 0]] = True
    refuse_slave_masters(deck, slave, master)
    loose = free_nodes(deck, free)
    held = hold(deck, slave, master, loose)
    in_scene = held_by_scene(deck, slave, master | slave, loose & ~held["fixed"])
    warn_of_nothing(deck, slave | master)
    values = nodal(deck, in_scene)
    drop_rotations(deck, values, slave)
    springs, ends = spring_tables(deck, in_scene, values.rotations)
    used = slave | master
    used[ends] = True
    chosen = np.flatnonzero(used)
    chosen = chosen[np.argsort(deck.node_id[chosen])]
    scale = Scale(deck)
    written = Written(
        {"title": deck.title or f"Ties of {Path(deck.file).name}"} | scale.table(),
        deck.node_id[chosen],
        scale.of("position", deck.position[chosen]),
        *segments_of(deck),
    )
    written.unit = scale.factors[0] if scale.names else 1.0
    written.columns = columns(deck, values, chosen, slave, loose, held, scale)
    written.tables["tie"] = [tie_table(deck, tie, written, scale) for tie in deck.ties]
    if springs:
        written.tables["spring"] = [scale.spring(table) for table in springs]
    add_initial(deck, written, used & ~slave & ~held["fixed"], values, scale)
    if deck.gravity is not None and deck.gravity.any():
        written.tables["model"] = {"gravity": scale.of("gravity", deck.gravity).tolist()}
        deck.notes.append(f"gravity {deck.gravity.tolist()} acts on slaves and free nodes")
    ports = rigid_ports(deck, written, used & ~slave & ~loose & ~held["fixed"], slave, scale)
    if ports:
        written.tables["interface"] = {"ports": ports}
    moved = used & ~slave
    fixed, free_now = moved & held["fixed"], moved & loose & ~held["fixed"]
    deck.notes.append(
        f"{slave.sum()} slaves, {free_now.sum()} free, {fixed.sum()} fixed and {(moved & ~fixed & ~free_now).sum()} "
        "driven nodes; the host moves driven ones, --free NAME frees those of a part or set"
    )
    return written


class Scale:
    """Values from the deck's units to the scene's: the same where a scene knows them by name, else SI."""

    def __init__(self, deck: Deck):
        named = all(isinstance(unit, str) for unit in deck.units)
        self.names = dict(zip(("length", "mass", "time"), deck.units)) if named else {}
        tables = (LENGTHS, MASSES, TIMES)
        self.factors = [
            float(table[unit] if isinstance(unit, str) else unit) for unit, table in zip(deck.units, tables)
        ]
        if not named:
            deck.notes.append("the deck's units have no name in a scene; its values are written in m, kg and s")

    def table(self) -> dict:
        return {"units": self.names} if self.names else {}

    def of(self, key: str, value):
        if self.names:
            return np.asarray(value, float)
        return float(np.prod([factor**power for factor, power in zip(self.factors, DIMENSIONS[key])])) * np.asarray(
            value, float
        )

    def number(self, key: str, value: float) -> float:
        return float(self.of(key, value))

    def spring(self, table: dict) -> dict:
        keys = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
        return {key: self.of(key, value).tolist() if key in keys else value for key, value in table.items()}


def pass_over_masters(deck: Deck):
    """Slaves that are masters of their own tie: they move with the surface already."""
    for tie in deck.ties:
        own = np.isin(tie.slaves, tie.faces.nodes)
        if own.any():
            first = deck.node_id[tie.slaves[own][0]]
            tie.slaves = tie.slaves[~own]
            deck.warn(
                f"{tie.where}: tie '{tie.name}': {own.sum()} slaves, the first is node {first}, belong to its own "
                "surface and are passed over"
            )
            if not len(tie.slaves):
                raise SceneError(f"{tie.where}: tie '{tie.name}': every slave belongs to its own surface")


def refuse_slave_masters(deck: Deck, slave: np.ndarray, master: np.ndarray):
    both = np.flatnonzero(slave & master)
    if not len(both):
        return
    node = both[0]
    one = next(tie for tie in deck.ties if node in tie.slaves)
    other = next(tie for tie in deck.ties if (tie.faces.nodes == node).any())
    raise SceneError(
        f"{one.where}: tie '{one.name}': node {deck.node_id[node]} is a slave here and a master of tie '{other.name}'; "
        "a slave cannot be a master: import one of them with --tie"
    )


def free_nodes(deck: Deck, names: tuple[str, ...]) -> np.ndarray:
    mask = np.zeros(len(deck.node_id), bool)
    for name in names:
        nodes = deck.lookup(name)
        if nodes is None:
            raise SceneError(f"{deck.file}: --free: the deck has no part or node set called '{name}'")
        mask[nodes] = True
    return mask


def hold(deck: Deck, slave: np.ndarray, master: np.ndarray, loose: np.ndarray) -> dict[str, np.ndarray]:
    """Which nodes are fixed; takes imposed and rigid ones out of `loose` and says what cannot be kept."""
    n = len(deck.node_id)
    held = np.zeros((n, 6), bool)
    for one in deck.fixed:
        held[one.nodes] |= np.array([*one.translations, *one.rotations])
    fixed = held.all(axis=1)
    fixed |= held[:, :3].all(axis=1) & ~rotating_nodes(deck)
    tied = np.flatnonzero(slave & held.any(axis=1))
    if len(tied):
        deck.warn(
            f"{len(tied)} slaves, the first is node {deck.node_id[tied[0]]}, are held by boundary conditions too; the "
            "tie wins"
        )
    imposed = np.zeros(n, bool)
    imposed[deck.imposed] = True
    if (imposed & slave).any():
        deck.warn(
            f"{(imposed & slave).sum()} slaves, the first is node {deck.node_id[np.argmax(imposed & slave)]}, have an "
            "imposed motion too; the tie wins"
        )
    rigid = np.zeros(n, bool)
    for body in deck.rigid:
        rigid[body.nodes] = True
        if body.main >= 0:
            rigid[body.main] = True
    for mask, what in ((imposed, "an imposed motion"), (rigid, "a rigid body")):
        taken = loose & mask & master
        if taken.any():
            deck.notes.append(f"{taken.sum()} nodes named by --free belong to {what} and stay driven")
        loose &= ~mask
    fixed &= ~slave & ~imposed & ~rigid
    partly = held.any(axis=1) & ~fixed & loose & (master | slave) & ~slave
    if partly.any():
        deck.warn(
            f"{partly.sum()} free nodes, the first is node {deck.node_id[np.argmax(partly)]}, are held in some "
            "directions only; a scene cannot hold single directions, and they are free in all"
        )
    if (fixed & master).any():
        deck.notes.append(f"{(fixed & master).sum()} masters are fixed by boundary conditions")
    return {"fixed": fixed}


def rotating_nodes(deck: Deck) -> np.ndarray:
    """Nodes of shells, beams and springs that transmit moments."""
    mask = np.zeros(len(deck.node_id), bool)
    for kind, elements in deck.elements.items():
        if kind in TURNING:
            mask[elements.nodes[elements.nodes >= 0]] = True
        if kind == "spring":
            for _, prop, _, members in deck.part_values(elements.part):
                if (
                    prop is not None
                    and prop.values.get("type", "axial") != "axial"
                    and prop.values.get("turning", True)
                ):
                    mask[elements.nodes[members][elements.nodes[members] >= 0]] = True
    return mask


def drop_rotations(deck: Deck, values: Nodal, slave: np.ndarray):
    """Slaves of default ties whose masters do not rotate: their rotations have nothing to hold on to."""
    for tie in deck.ties:
        if not tie.hand_on_rotations:
            masters = np.unique(tie.faces.nodes[tie.faces.nodes >= 0])
            turning = values.rotations[masters].any()
            values.rotations[masters] = False
            lone = tie.slaves[values.rotations[tie.slaves]]
            if turning:
                deck.warn(
                    f"{tie.where}: tie '{tie.name}' hands no rotations on: its masters are taken without rotations, in "
                    "all ties that they belong to"
                )
        elif not tie.slave_rotations:
            lone = tie.slaves[values.rotations[tie.slaves]]
        elif tie.formulation == "default":
            lone = tie.slaves[values.rotations[tie.slaves]]
            lone = lone[~masters_rotate(deck, tie, values, lone)] if len(lone) else lone
            if len(lone):
                deck.warn(
                    f"{tie.where}: tie '{tie.name}': {len(lone)} slaves that can turn, the first is node "
                    f"{deck.node_id[lone[0]]}, meet masters that cannot: their rotations and inertia are left out; the "
                    "optimized formulation (Spotflag 1) would keep them"
                )
        else:
            continue
        values.rotations[lone] = False
        values.inertia[lone] = 0.0
        values.rotational_stiffness[lone] = 0.0


def masters_rotate(deck: Deck, tie: Tie, values: Nodal, slaves: np.ndarray) -> np.ndarray:
    """Whether the face nearest to each slave, by its centre, has rotations at all of its nodes."""
    nodes = tie.faces.nodes
    four = np.where(nodes < 0, nodes[:, [2]], nodes)
    whole = np.asarray(values.rotations[four].all(axis=1))
    if whole.all() or not whole.any():
        return np.full(len(slaves), whole.all())
    centre = deck.position[four].mean(axis=1)
    nearest = np.empty(len(slaves), int)
    step = max(1, 10**6 // len(centre))
    for start in range(0, len(slaves), step):
        x = deck.position[slaves[start : start + step]]
        nearest[start : start + step] = ((x[:, None] - centre) ** 2).sum(axis=2).argmin(axis=1)
    return whole[nearest]


def segments_of(deck: Deck) -> tuple[np.ndarray, np.ndarray]:
    """Ids and node ids of all faces of all ties, each once; an id is the element's where that is free."""
    faces = Faces.joined([tie.faces for tie in deck.ties])
    ids = faces.element.copy()
    first = np.zeros(len(ids), bool)
    _, index = np.unique(ids, return_index=True)
    first[index] = True
    fresh = ~first | (ids <= 0)
    ids[fresh] = max(int(ids.max(initial=0)), 0) + 1 + np.arange(fresh.sum())
    nodes = np.where(faces.nodes < 0, 0, deck.node_id[faces.nodes])
    order = np.argsort(ids, kind="stable")
    return ids[order], nodes[order]


def tie_table(deck: Deck, tie: Tie, written: Written, scale: Scale) -> dict:
    slaves, main = unique_name(f"{tie.name} slaves", written.node_sets), unique_name(tie.name, written.segment_sets)
    written.node_sets[slaves] = np.sort(deck.node_id[tie.slaves])
    wanted = np.sort(np.where(tie.faces.nodes < 0, 0, deck.node_id[tie.faces.nodes]), axis=1)
    place = match_rows(np.sort(written.segments, axis=1), wanted)
    written.segment_sets[main] = np.sort(written.segment_id[np.unique(place)])
    table: dict[str, Any] = {
        "name": tie.name,
        "segments": main,
        "slaves": slaves,
        "formulation": tie.formulation,
        "search": tie.search,
        "unresolved": tie.unresolved,
    }
    if tie.search_distance is not None:
        table["search_distance"] = scale.number("search_distance", tie.search_distance)
    if tie.pairwise is not None:
        tolerance = pair_tolerance(deck, tie, tie.pairwise[0])
        largest = tie.pairwise_more + np.maximum(
            tolerance["diagonal"].max(), tie.pairwise[1] * (tolerance["t_s"].max() + tolerance["t_m"].max())
        )
        table["search_distance"] = scale.number("search_distance", float(largest))
        tolerance["segment"] = written.segment_id[place]
        tolerance["factor"] = float(scale.factors[0])
        tolerance["share"], tolerance["more"] = tie.pairwise[1], tie.pairwise_more
        tolerance["adjust"], tolerance["onto_middle"] = tie.adjust, tie.onto_middle
        written.pairwise[tie.name] = tolerance
    return table


def pair_tolerance(deck: Deck, tie: Tie, share: float) -> dict:
    """What the tolerance of a pair consists of: share of the shorter diagonal and thickness of each face, and of each
    slave the largest thickness of its shells. In the deck's units."""
    four = np.where(tie.faces.nodes < 0, tie.faces.nodes[:, [2]], tie.faces.nodes)
    x = deck.position[four]
    diagonals = np.stack([np.linalg.norm(x[:, i] - x[:, i + 2], axis=1) for i in (0, 1)])
    thick = np.zeros(len(deck.node_id)) if tie.slave_thickness is None else tie.slave_thickness
    for kind, elements in deck.elements.items() if tie.thick_slaves and tie.slave_thickness is None else ():
        if kind in TURNING and kind != "beam":
            t = np.repeat(deck.thickness(elements), elements.nodes.shape[1])
            nodes = elements.nodes.ravel()
            np.maximum.at(thick, nodes[nodes >= 0], t[nodes >= 0])
    return {
        "diagonal": share * diagonals.min(axis=0),
        "t_m": tie.faces.thickness,
        "slave": deck.node_id[tie.slaves],
        "t_s": thick[tie.slaves],
    }


def columns(deck: Deck, values: Nodal, chosen: np.ndarray, slave, loose, held, scale: Scale) -> dict[str, np.ndarray]:
    motion = np.where(loose, "free", "driven").astype("U6")
    motion[held["fixed"]] = "fixed"
    motion[slave] = ""
    found = {"id": deck.node_id[chosen]}
    for key in ("mass", "inertia", "stiffness", "rotational_stiffness"):
        found[key] = scale.of(key, getattr(values, key)[chosen])
    found["motion"] = motion[chosen]
    found["rotations"] = np.where(values.rotations[chosen], "true", "false")
    return found


def add_initial(deck: Deck, written: Written, allowed: np.ndarray, values: Nodal, scale: Scale):
    tables = []
    for number, one in enumerate(deck.initial, 1):
        nodes = one.nodes[allowed[one.nodes]]
        if one.w is not None:
            nodes = nodes[values.rotations[nodes]]
        if not len(nodes):
            continue
        name = unique_name(f"start {number}", written.node_sets)
        written.node_sets[name] = np.sort(deck.node_id[nodes])
        key, value = ("v", one.v) if one.v is not None else ("w", one.w)
        tables.append({"nodes": name, key: scale.of(key, value).tolist()})
    if tables:
        written.tables["initial"] = tables


def rigid_ports(deck: Deck, written: Written, driven: np.ndarray, slave: np.ndarray, scale: Scale) -> list[dict]:
    ports, taken = [], np.zeros(len(deck.node_id), bool)
    for body in deck.rigid:
        members = np.union1d(body.nodes, [body.main]) if body.main >= 0 else body.nodes
        if slave[members].any():
            node = deck.node_id[members[slave[members]][0]]
            deck.warn(f"{body.where}: rigid body '{body.name}' holds slaves, the first is node {node}; the tie wins")
        members = members[driven[members] & ~taken[members]]
        if not len(members):
            continue
        taken[members] = True
        name = re.sub(r"[^\w.:/ -]+", " ", body.name, flags=re.ASCII).strip() or "rigid body"
        name = unique_name(name, written.node_sets)
        written.node_sets[name] = np.sort(deck.node_id[members])
        port = {"name": name, "nodes": name}
        if body.main >= 0:
            port["at"] = scale.of("position", deck.position[body.main]).tolist()
        ports.append(port)
        deck.notes.append(f"rigid body '{body.name}' ({body.where}): {len(members)} of its nodes are one port")
    return ports


def unique_name(name: str, known) -> str:
    name = "".join(c if c.isprintable() else " " for c in name).strip() or "set"
    if name == "all":
        name = "all of it"
    found, number = name, 2
    while found in known:
        found, number = f"{name} {number}", number + 1
    return found
