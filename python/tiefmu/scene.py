"""A scene from its tables to the compiled model of the solver.

Order: types (schema.py), mesh (mesh.py), then who is what - node tables, ties, springs, initial velocities - on arrays
over all nodes of the mesh, in SI. Search and mechanics are checked by the solver when it compiles.
"""

import re
import sys
from enum import Enum
from pathlib import Path

import numpy as np

from . import _core, mesh, schema
from ._core import SceneError
from .mesh import properties
from .mesh.data import listed
from .mesh.properties import MOTIONS
from .mesh.properties import NUMBERS as NODE_VALUES
from .units import DIMENSIONS, LENGTHS, MASSES, Units

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


class Scene:
    """A checked and compiled scene; made by `load` (loading.py).

    file: how messages call the source; name: of the model, from the file's name; title; notes, warnings: remarks of
    the reading (lists of str); ties: the [[tie]] tables in order; settings: the [model] table; rotations: ids of the
    nodes declared with rotations; gravity: m/s2 (3,); model: the compiled `_core.Model`; start: a `_core.Simulation`
    of it, initialised at time 0.
    """

    def __init__(self, file: str, name: str, tables: schema.SceneTables, folder: Path):
        self.file, self.name, self.title, self.ties = file, name, tables.title, tables.tie
        self.settings = tables.model
        assembly = Assembly(tables, folder)
        self.notes, self.warnings = assembly.mesh.notes, assembly.mesh.warnings
        self.rotations = assembly.mesh.node_id[assembly.rotations]
        self.gravity = assembly.units.si("gravity", tables.model.gravity)
        self.model = _core.Model(assembly.scene())
        self.start = self.simulation()
        self.start.initialise(0.0)

    def simulation(self) -> _core.Simulation:
        """A new simulation of this scene, as the FMU runs it; call `initialise(t)` first."""
        return _core.Simulation(self.model)

    def hidden_positions(self) -> list[str]:
        """What [interface] expose would have to name for the positions of all nodes and slaves to be known that are no
        inputs; of those behind ports the FMU shows none all the same."""
        shown = {block["name"] for block in self.start.variables}
        found = self.model.report()
        kinds = {"slave": len(found["slaves"]["id"]) > 0, "master": found["nodes"]["master"].any()}
        kinds["point"] = (found["nodes"]["master"] == 0).any()
        return [f"{kind}.r" for kind, there in kinds.items() if there and f"{kind}.r" not in shown]


def escaped(message: str) -> str:
    """The same with control characters and the like, which names may hold, written as escapes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in message)


def plain(value):
    """The same with lists and Python numbers in place of tuples and NumPy arrays and numbers."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def read_toml(path: Path) -> dict:
    if path.suffix.lower() == ".fmu" and path.is_file():
        raise SceneError("is an FMU; give the scene that it was built from")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise SceneError("no such file") from None
    except OSError as error:
        raise SceneError(error.strerror) from None
    except UnicodeDecodeError as error:
        raise SceneError(f"not a text file (byte {error.start} is not UTF-8)") from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        place = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", str(error), re.DOTALL)
        if not place:
            raise SceneError(f"not TOML: {error}") from None
        where = f"line {place[2]}, column {place[3]}" if place[2] else "end of file"
        raise SceneError(f"{where}: not TOML: {place[1]}") from None


class Assembly:
    """The scene on arrays over all nodes of the mesh, index by index."""

    def __init__(self, tables: schema.SceneTables, folder: Path):
        self.tables = tables
        self.units = Units.of(tables.units)
        self.mesh = mesh.build(tables.mesh, folder)
        if not tables.tie and not tables.spring:
            raise SceneError("the scene has neither a tie nor a spring; give at least one [[tie]]")
        n = len(self.mesh.node_id)
        self.position = self.units.si("position", self.mesh.position)
        self.motion = np.zeros(n, np.uint8)
        self.motion_table = np.zeros(n, int)  # what names the node and sets its motion: a node table's number, or 0,
        # or -1 for the table of properties
        self.rotations = np.zeros(n, bool)
        self.values = {key: np.zeros(n) for key in NODE_VALUES}
        self.velocity, self.spin = np.zeros((n, 3)), np.zeros((n, 3))
        if tables.mesh.properties is not None:
            self.apply_properties(folder / tables.mesh.properties, tables.mesh.properties)
        for number, table in enumerate(tables.node, 1):
            self.apply_node_table(f"node table {number}", number, table)
        self.ties = self.resolve_ties()
        self.springs = self.resolve_springs()
        self.ports = self.resolve_ports()
        for number, initial in enumerate(tables.initial, 1):
            self.apply_initial(f"initial {number}", initial)

    # which nodes and segments a table means: sorted or as listed, as indices

    def nodes(self, where: str, wanted) -> np.ndarray:
        return self.mesh.select_nodes(where, wanted)

    def segments(self, where: str, wanted) -> np.ndarray:
        return self.mesh.select_segments(where, wanted)

    def apply_properties(self, path: Path, name: str):
        for key, column in properties.read(path, name, self.mesh.node_id).items():
            if key == "motion":
                self.motion[column.nodes] = column.values
                self.motion_table[column.nodes] = -1
            elif key == "rotations":
                self.rotations[column.nodes] = column.values
            else:
                self.values[key][column.nodes] = self.units.si(key, column.values)

    def apply_node_table(self, where: str, number: int, table: schema.Node):
        nodes = self.nodes(f"{where}: nodes", table.nodes)
        if table.motion is not None:
            self.motion[nodes] = MOTIONS.index(table.motion)
            self.motion_table[nodes] = 0 if table.nodes == "all" else number
        if table.rotations is not None:
            self.rotations[nodes] = table.rotations
        for key, values in self.values.items():
            if getattr(table, key) is not None:
                values[nodes] = self.units.si(key, getattr(table, key))

    def resolve_ties(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """(name, segments, slaves) of each tie."""
        ties, names = [], set()
        for number, table in enumerate(self.tables.tie, 1):
            table.name = table.name or str(number)
            where = f"tie '{table.name}'"
            if table.name in names:
                raise SceneError(f"{where}: this name is repeated")
            names.add(table.name)
            segments = self.segments(f"{where}: segments", table.segments)
            second = self.mesh.segment_id[segments][self.mesh.second_order[segments]]
            if len(second):
                self.mesh.notes.append(
                    f"{where}: second-order segments, used as the linear ones of their corner nodes: {listed(second)}"
                )
            slaves = self.nodes(f"{where}: slaves", table.slaves)
            if not isinstance(table.slaves, list):
                slaves = self.without_masters(where, table.slaves, slaves, segments)
            fixed = slaves[(self.motion[slaves] == MOTIONS.index("fixed")) & (self.motion_table[slaves] != 0)]
            if len(fixed):
                table_number = self.motion_table[fixed[0]]
                place = f"node table {table_number}" if table_number > 0 else self.tables.mesh.properties
                raise SceneError(
                    f"{where}: slave {self.mesh.node_id[fixed[0]]}: constrained twice, by the tie and by "
                    f"motion = 'fixed' in {place}; take it out of one"
                )
            ties.append((table.name, segments, slaves))
        return ties

    def without_masters(self, where: str, name: str, slaves: np.ndarray, segments: np.ndarray) -> np.ndarray:
        """The slaves of a set that are no masters of the same tie; a set may be a whole part."""
        masters = np.isin(slaves, self.mesh.segments[segments])
        if masters.all():
            raise SceneError(f"{where}: slaves: every node of '{name}' is a master of this tie")
        if masters.any():
            self.mesh.notes.append(
                f"{where}: nodes of the set of slaves that are masters of this tie, passed over: "
                f"{listed(self.mesh.node_id[slaves[masters]])}"
            )
        return slaves[~masters]

    def resolve_springs(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Ends (a, b) of the springs of each table; b is -1 for ground."""
        springs = []
        for number, table in enumerate(self.tables.spring, 1):
            where = f"spring {number}"
            if table.nodes is not None:
                a, b = self.nodes(f"{where}: nodes", table.nodes)
                springs.append((np.array([a]), np.array([b])))
            else:
                a = self.nodes(f"{where}: ground", table.ground)
                springs.append((a, np.full(len(a), -1)))
        return springs

    def resolve_ports(self) -> list[np.ndarray]:
        """Nodes of each port."""
        ports, names, owner = [], set(), np.full(len(self.mesh.node_id), -1)
        for number, port in enumerate(self.tables.interface.ports):
            where = f"interface: port '{port['name']}'"
            if port["name"] in names:
                raise SceneError(f"{where}: this name is repeated")
            names.add(port["name"])
            nodes = self.nodes(where, port["nodes"])
            twice = nodes[owner[nodes] >= 0]
            if len(twice):
                other = self.tables.interface.ports[owner[twice[0]]]["name"]
                raise SceneError(
                    f"{where}: node {self.mesh.node_id[twice[0]]}: is already in port '{other}'; a node "
                    "can be in one port only"
                )
            owner[nodes] = number
            ports.append(nodes)
        return ports

    def apply_initial(self, where: str, table: schema.Initial):
        nodes = self.nodes(f"{where}: nodes", table.nodes)
        slave = np.zeros(len(self.motion), bool)
        for _, _, slaves in self.ties:
            slave[slaves] = True
        fixed = self.motion == MOTIONS.index("fixed")
        if table.nodes == "all":
            nodes = nodes[~(slave | fixed)[nodes]]
        for mask, what in ((slave, "a slave: its motion comes from its tie"), (fixed, "fixed")):
            bad = nodes[mask[nodes]]
            if len(bad):
                raise SceneError(f"{where}: nodes: node {self.mesh.node_id[bad[0]]} is {what}")
        if table.v is not None:
            self.velocity[nodes] = self.units.si("v", table.v)
        if table.w is not None:
            still = nodes[~self.rotations[nodes]]
            if len(still) and table.nodes != "all":
                raise SceneError(
                    f"{where}: w: node {self.mesh.node_id[still[0]]} has no rotations; "
                    "set rotations = true in a node table, or leave w out"
                )
            turning = nodes[self.rotations[nodes]]
            if not len(turning):
                raise SceneError(
                    f"{where}: w: no node has rotations; set rotations = true in a node table, or leave w out"
                )
            self.spin[turning] = self.units.si("w", table.w)

    def scene(self) -> _core.Scene:
        """What the solver compiles."""
        scene, si = _core.Scene(), self.units.si
        length, mass = self.units.length, self.units.mass
        scene.set_units(length, float(LENGTHS[length]), mass, float(MASSES[mass]))
        scene.set_nodes(
            self.mesh.node_id,
            self.position,
            self.motion,
            self.rotations.astype(np.uint8),
            *(self.values[key] for key in NODE_VALUES),
            self.velocity,
            self.spin,
        )
        scene.set_segments(self.mesh.segment_id, self.mesh.segments)
        for table, (name, segments, slaves) in zip(self.tables.tie, self.ties):
            scene.add_tie(
                name,
                segments.astype(np.int32),
                slaves.astype(np.int32),
                choice(_core.Formulation, table.formulation),
                choice(_core.SearchMethod, table.search),
                si("search_distance", table.search_distance),
                table.unresolved == "drop",
            )
        for number, (spring, (a, b)) in enumerate(zip(self.tables.spring, self.springs), 1):
            scene.add_springs(
                f"spring {number}",
                a.astype(np.int32),
                b.astype(np.int32),
                choice(_core.SpringKind, spring.kind),
                *(
                    np.broadcast_to(si(key, getattr(spring, key)), 3).copy()
                    for key in ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
                ),
                spring.orientation or [0.0, 0.0, 0.0],
            )
        for port, nodes in zip(self.tables.interface.ports, self.ports):
            place = np.empty(0) if port["at"] is None else si("position", port["at"])
            scene.add_port(port["name"], nodes.astype(np.int32), isinstance(port["nodes"], list), place)
        scene.settings = self.settings()
        return scene

    def settings(self) -> _core.Settings:
        """The tables [model], [integrator] and [interface], key by key: one that the solver does not know is an
        AttributeError."""
        settings = _core.Settings()
        for table in (self.tables.model, self.tables.integrator, self.tables.interface):
            for key in type(table).model_fields:
                value = getattr(table, key)
                if key == "ports":
                    continue
                if isinstance(value, str):
                    value = choice(type(getattr(settings, key)), value)
                elif key in DIMENSIONS:
                    value = self.units.si(key, value)
                setattr(settings, key, value)
        return settings


def choice(kind: type[Enum], word: str):
    """The value of an enumeration of the solver that the scene file calls `word`."""
    return kind[word.replace("-", "_")]
