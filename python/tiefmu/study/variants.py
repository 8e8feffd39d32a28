"""A scene changed one choice at a time: inertia, geometry, formulation, freedoms, method, or a penalty for the tie.

Every change gives a scene of the ordinary kind, so that all of them run in the same compiled solver.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import decks, schema
from .._core import SceneError
from ..scene import MOTIONS, NODE_VALUES, Assembly, Scene, read_toml
from ..units import DIMENSIONS, Units

METHODS = ["central-difference", "symplectic-euler", "noh-bathe", "rk4"]
HEAVY = 1e18  # mass of a driven node made free, in units of what else there is: its motion is then what was given
EXACT_TOLERANCE = 1e-12  # of the equations of consistent inertia


@dataclass(frozen=True)
class Variant:
    """One model of a scene. formulation: "scene" leaves the ties as they are; freedoms: "all", or "translations" for
    masters without rotations; penalty: frequency of the slave on its penalty spring in units of the scene's highest,
    0 for a tie."""

    inertia: str = "consistent"
    geometry: str = "finite"
    formulation: str = "scene"
    freedoms: str = "all"
    penalty: float = 0.0

    @property
    def reference(self) -> "Variant":
        """The model without model error that this one is compared with."""
        return Variant(formulation=self.formulation)

    @property
    def name(self) -> str:
        parts = [f"penalty x{self.penalty:g}" if self.penalty else self.inertia]
        parts += ["small geometry"] if self.geometry == "small" else []
        parts += ["no rotations"] if self.freedoms != "all" else []
        return ", ".join(parts)


def change(table: schema.Table, **fields: Any) -> None:
    """Sets fields of a table; all others stay."""
    for key, value in fields.items():
        setattr(table, key, value)


def in_si(tables: schema.SceneTables) -> schema.SceneTables:
    """A copy with every quantity in SI, but for the mesh."""
    new = tables.model_copy(deep=True)
    si, base = Units.of(tables.units).si, schema.Units()
    change(new.units, length=base.length, mass=base.mass, time=base.time)
    for name in schema.TABLES:
        found = getattr(new, name)
        for table in found if isinstance(found, list) else [found]:
            for key in table.model_fields_set & DIMENSIONS.keys():
                value = getattr(table, key)
                if isinstance(value, (int, float, list)):  # and not, say, inertia = "lumped"
                    setattr(table, key, si(key, value).tolist())
    return new


class Source:
    """A scene file or a deck as read, before it is compiled. own: the scene as the file has it; scene, and all that is
    built: its nodes one by one, without ports. Raises SceneError."""

    def __init__(self, path):
        self.file, self.name, self.folder = str(path), Path(path).stem, Path(path).parent
        self.imported: tempfile.TemporaryDirectory | None = None  # what was made of a deck
        try:
            if decks.is_deck(Path(path)):
                self.imported = tempfile.TemporaryDirectory(prefix="tiefmu-")
                self.folder = Path(self.imported.name)
                self.tables = schema.parse(decks.tables(Path(path), self.folder))
            else:
                self.tables = schema.parse(read_toml(Path(path)))
        except SceneError as error:
            raise SceneError(f"{self.file}: {error}") from None
        self.own = self.compile(self.tables, with_ports=True)  # as it is: what is wrong with it shows here
        self.scene = self.compile(self.tables) if self.tables.interface.ports else self.own
        self.units = Units.of(self.tables.units)
        nodes = self.scene.model.report()["nodes"]
        moving = {MOTIONS[m] for m in nodes["motion"].tolist()}
        self.any_free, self.any_driven = "free" in moving, "driven" in moving
        self.formulations = {tie.formulation for tie in self.tables.tie}

    def compile(self, tables: schema.SceneTables, with_ports: bool = False) -> Scene:
        """Raises SceneError with the file's name."""
        tables = tables.model_copy(deep=True)
        if not with_ports:
            expose, hide = (
                [name for name in names if not name.startswith("port.")]
                for names in (tables.interface.expose, tables.interface.hide)
            )
            change(tables.interface, ports=[], expose=expose, hide=hide)
        try:
            return Scene(self.file, self.name, tables, self.folder)
        except SceneError as error:
            raise SceneError(f"{self.file}: {error}") from None

    def changed(self, variant: Variant) -> schema.SceneTables:
        """The tables of a variant that is a tie: a copy with the fields of its choices changed."""
        tables = self.tables.model_copy(deep=True)
        change(tables.model, inertia=variant.inertia, geometry=variant.geometry)
        if variant.formulation != "scene":
            for tie in tables.tie:
                change(tie, formulation=variant.formulation)
        if variant.freedoms == "translations":
            self.drop_rotations(tables)
        return tables

    def drop_rotations(self, tables: schema.SceneTables) -> None:
        """Nothing turns but the slaves of optimized ties; those of default ties lose their rotary inertia with it."""
        assembly = Assembly(tables, self.folder)
        ids = assembly.mesh.node_id
        tables.node.append(schema.Node(nodes="all", rotations=False))
        for tie, (_, _, slaves) in zip(tables.tie, assembly.ties):
            if tie.formulation == "default":
                tables.node.append(schema.Node(nodes=ids[slaves].tolist(), inertia=0.0))
        for table in tables.initial:
            table.w = None
        tables.initial = [table for table in tables.initial if table.v is not None]

    def tables_of(
        self, variant: Variant, method: str, reaction: str, energy: bool = False, heavy: bool = False
    ) -> schema.SceneTables:
        """See `build`."""
        tables = self.penalty(variant) if variant.penalty else self.changed(variant)
        if heavy and self.any_driven:
            tables = self.arrays(tables, heavy=True)
        change(tables.model, reaction=reaction, reaction_lead=0.0, position="integrated")
        if method == "rk4":  # references, and errors below what the default leaves
            change(tables.model, solver_tolerance=EXACT_TOLERANCE)
        default = schema.Integrator()
        change(tables.integrator, method=method, time_step=default.time_step, safety=default.safety)
        change(tables.interface, expose=["energy"] if energy else [], hide=[])
        return tables

    def build(
        self,
        variant: Variant,
        method: str = "central-difference",
        reaction: str = "full",
        energy: bool = False,
        heavy: bool = False,
    ) -> Scene:
        """The variant, compiled.

        energy: expose the energies. heavy: driven nodes become free ones too heavy for anything but their given
        acceleration to move them. Raises SceneError.
        """
        return self.compile(self.tables_of(variant, method, reaction, energy, heavy))

    def arrays(self, tables: schema.SceneTables, heavy: bool) -> schema.SceneTables:
        """The same scene in SI with inline mesh and one node table a node, so that single nodes can be changed.

        Tables are copied with changed fields: what this function knows nothing of stays as it was.
        """
        a = Assembly(tables.model_copy(deep=True), self.folder)
        ids = a.mesh.node_id
        new = in_si(tables)
        change(
            new.mesh,
            file=None,
            properties=None,
            nodes=[(int(i), *map(float, x)) for i, x in zip(ids, a.position)],
            segments=[
                [int(e), *(int(ids[n]) for n in corners if n >= 0)]
                for e, corners in zip(a.mesh.segment_id, a.mesh.segments)
            ],
        )
        new.node = self.nodes(a, new, heavy)
        last = {}  # of each node, the last table with initial velocities that names it
        for number, table in enumerate(new.initial, 1):
            last |= dict.fromkeys(a.nodes(f"initial {number}: nodes", table.nodes).tolist(), table)
        new.initial = [
            last[k].model_copy(update={"nodes": [int(i)], "v": v.tolist(), "w": w.tolist() if r else None})
            for k, (i, v, w, r) in enumerate(zip(ids, a.velocity, a.spin, a.rotations))
            if v.any() or (r and w.any())
        ]
        for tie, (_, segments, slaves) in zip(new.tie, a.ties):
            change(tie, segments=a.mesh.segment_id[segments].tolist(), slaves=ids[slaves].tolist())
        springs = []
        for spring, (first, second) in zip(new.spring, a.springs):
            for p, q in zip(ids[first].tolist(), second.tolist()):
                ends = {"nodes": None, "ground": [p]} if q < 0 else {"nodes": [p, int(ids[q])], "ground": None}
                springs.append(spring.model_copy(update=ends))
        new.spring = springs
        return new

    @staticmethod
    def nodes(a: Assembly, tables: schema.SceneTables, heavy: bool) -> list[schema.Node]:
        """One node table a node: what the tables say of it, later ones over earlier ones."""
        said: list[dict] = [{} for _ in a.mesh.node_id]
        for number, table in enumerate(tables.node, 1):
            keys = {key: getattr(table, key) for key in table.model_fields_set if getattr(table, key) is not None}
            for k in a.nodes(f"node table {number}: nodes", table.nodes):
                said[k] |= keys
        values = {key: a.values[key].copy() for key in NODE_VALUES}
        motion = [MOTIONS[m] for m in a.motion]
        slave = np.zeros(len(said), bool)
        for _, _, slaves in a.ties:
            slave[slaves] = True
        if heavy:
            driven = ~slave & (a.motion == MOTIONS.index("driven"))
            for key in ("mass", "inertia"):
                values[key][driven] = HEAVY * max(1.0, a.values["mass"].max(), a.values["inertia"].max())
            motion = ["free" if d else m for d, m in zip(driven, motion)]
        return [
            schema.Node(nodes=[int(i)]).model_copy(
                update=said[k]
                | {"nodes": [int(i)], "motion": None if slave[k] else motion[k], "rotations": bool(a.rotations[k])}
                | {key: float(v[k]) for key, v in values.items()}
            )
            for k, i in enumerate(a.mesh.node_id)
        ]  # a slave's motion is that of its tie

    def penalty(self, variant: Variant) -> schema.SceneTables:
        """Each slave becomes a free node, held by a stiff spring at the place where its tie would put it.

        That place is a massless slave of the same tie, so that kinematics and loads are those of the tie itself. Every
        slave needs mass. Raises SceneError.
        """
        base = replace(variant, penalty=0.0)
        scene = self.compile(self.changed(base))
        found = scene.model.report()
        top = 2 / scene.start.get("stable_time_step")[0]
        if not top > 1e-20:
            raise SceneError(
                f"{self.file}: no free node is held by a spring, so a penalty has no frequency to be compared with"
            )
        new = self.arrays(self.changed(base), heavy=False)
        tables = {table.nodes[0]: table for table in new.node}
        slaves = dict(zip(found["slaves"]["id"].tolist(), range(len(found["slaves"]["id"]))))
        turning = [found["couplings"][c] != "translation" for c in found["slaves"]["coupling"]]
        ghost = {node: node + max(tables) for node in slaves}
        v, w = scene.start.get("slave_velocity"), scene.start.get("slave_spin") if any(turning) else None
        place = {row[0]: row[1:] for row in new.mesh.nodes}
        for node, s in slaves.items():
            table = tables[node]
            mass, inertia = table.mass or 0.0, table.inertia or 0.0
            turns = turning[s] and inertia > 0
            if not mass > 0:
                raise SceneError(f"{self.file}: node {node}: has no mass, so a penalty cannot tie it")
            new.mesh.nodes.append((ghost[node], *place[node]))
            k = mass * (variant.penalty * top) ** 2
            new.node.append(schema.Node(nodes=[ghost[node]], motion="driven", rotations=table.rotations))
            new.spring.append(
                schema.Spring(
                    nodes=[node, ghost[node]],
                    kind="bushing",
                    stiffness=k,
                    rotational_stiffness=k * inertia / mass if turns else 0.0,
                )
            )
            new.initial.append(
                schema.Initial(nodes=[node], v=v[s].tolist(), w=w[s].tolist() if w is not None and turns else None)
            )
            table.motion, table.rotations = "free", turns
        for tie in new.tie:
            tie.slaves = [ghost[node] for node in tie.slaves if node in ghost]
        return new


def compiles(source: Source, variant: Variant) -> bool:
    try:
        source.build(variant, heavy=True)
        return True
    except SceneError:
        return False


def variants(source: Source) -> list[Variant]:
    """Every tie that the scene allows and that is not the same as another one: the reference of each formulation
    first."""
    result = []
    for formulation in [
        "scene",
        *sorted({"default", "optimized"} - (source.formulations if len(source.formulations) == 1 else set())),
    ]:
        for geometry in ("finite", "small"):
            for inertia in ("consistent", "lumped"):
                variant = Variant(inertia, geometry, formulation)
                if compiles(source, variant):
                    result.append(variant)
    dropped = Variant(freedoms="translations")
    if len(source.scene.rotations) and compiles(source, dropped):
        result.append(dropped)
    return result
