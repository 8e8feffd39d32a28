"""VTK files: the ties of a scene (`info --vtu`), and a run over time (`run --pvd`)."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UsageError
from ..scene import MOTIONS, Scene
from ..schema import suggestion
from ..signals import Experiment
from .geometry import Geometry

FRAMES = 100  # of a run, unless asked for otherwise
FIELDS = ["tie", "id", "distance", "xi", "eta", "weights", "clamped"]  # of cells
NODE_FIELDS = ["id", "mass", "added_mass", "added_inertia", "stiffness", "nodal_step", "motion"]


def mesh(geometry: Geometry, points: np.ndarray, **data) -> Any:
    """meshio's: segments, a vertex a slave, a line from each slave to its projection. points: nodes, slaves, feet."""
    import meshio

    n, m = len(geometry.ids), len(geometry.slaves)
    quads = np.array([c for c in geometry.segments.values() if len(c) == 4], dtype=np.int64).reshape(-1, 4)
    triangles = np.array([c for c in geometry.segments.values() if len(c) == 3], dtype=np.int64).reshape(-1, 3)
    slaves = n + np.arange(m)
    cells = [("quad", quads), ("triangle", triangles), ("vertex", slaves[:, None])]
    cells.append(("line", np.column_stack([slaves, m + slaves])))
    kept = [k for k, (_, block) in enumerate(cells) if len(block)]
    if "cell_data" in data:
        data["cell_data"] = {name: [blocks[k] for k in kept] for name, blocks in data["cell_data"].items()}
    return meshio.Mesh(points, [cells[k] for k in kept], **data)


def write_ties(found: dict, path: Path, fields: list[str] | None = None) -> None:
    """Writes a VTU file, binary and compressed. found: a report; fields: of FIELDS and NODE_FIELDS, default all.

    Cells: segments, slaves (vertices), lines from each slave to its projection; slaves and lines carry tie (its number,
    from 1), id, distance (m), xi, eta, weights (4) and clamped; segments their id and -1. Points: the nodes' id, mass,
    added_mass (kg), added_inertia (kg m2), stiffness (N/m), nodal_step (s), motion (0 driven, 1 free, 2 fixed), -1 of
    slaves and projections. Raises UsageError, OSError.
    """
    known = [*FIELDS, *dict.fromkeys(NODE_FIELDS)]
    for name in fields or []:
        if name not in known:
            raise UsageError(f"{path}: no field '{name}'{suggestion(name, known)}")
    geometry = Geometry(found)
    rows, m = found["slaves"], len(found["slaves"])
    names = [tie["name"] for tie in found["ties"]]
    number = {name: k for k, name in enumerate(names, 1)}
    slaves = {
        "tie": np.array([number[row["tie"]] for row in rows]),
        "id": np.array([row["id"] for row in rows]),
        "distance": np.array([row["distance"] for row in rows]),
        "xi": np.array([row["xi"] for row in rows]),
        "eta": np.array([row["eta"] for row in rows]),
        "weights": np.array([(row["weights"] + [0.0])[:4] for row in rows]).reshape(-1, 4),
        "clamped": np.array([int(row["clamped"]) for row in rows]),
    }
    cell_data = {}
    for name, values in slaves.items():
        if fields is not None and name not in fields:
            continue
        blocks = []
        for corners in (4, 3):
            ids = [segment for segment, nodes in geometry.segments.items() if len(nodes) == corners]
            blocks.append(np.array(ids) if name == "id" else np.full((len(ids), *values.shape[1:]), -1, values.dtype))
        cell_data[name] = [*blocks, values, values]
    nodes = {
        "id": [row["id"] for row in geometry.rows] + 2 * slaves["id"].tolist(),
        "motion": [MOTIONS.index(row["motion"]) for row in geometry.rows] + [-1] * (2 * m),
    }
    for name in NODE_FIELDS[1:-1]:
        key = "nodal_time_step" if name == "nodal_step" else name
        nodes[name] = [row[key] for row in geometry.rows] + [-1.0] * (2 * m)
    point_data = {name: np.array(values) for name, values in nodes.items() if fields is None or name in fields}
    points = np.vstack([geometry.positions, geometry.slaves, geometry.feet])
    mesh(geometry, points, cell_data=cell_data, point_data=point_data).write(path, file_format="vtu")


class Columns:
    """Where things are and how they move, from the rows of a run: outputs, inputs, and what stays at the start."""

    def __init__(self, path: Path, geometry: Geometry, found: dict, names: list[str], plan: Experiment):
        """names: of the outputs. Raises UsageError where they do not say."""
        self.inputs = plan.inputs
        rows = geometry.rows
        prefixes = ["master"] * len(found["masters"]) + ["point"] * len(found["points"])
        nodes = [f"{prefix}[{row['number']}]" for prefix, row in zip(prefixes, rows)]
        slaves = [f"slave[{row['number']}]" for row in found["slaves"]]
        known = set(names) | set(self.inputs.names)
        moving = [name for name, row in zip(nodes, rows) if row["motion"] != "fixed"] + slaves
        hidden = next((name for name in moving if f"{name}.r[1]" not in known), None)
        if hidden and "ports" in found:
            raise UsageError(f"{path}: nodes behind ports show no positions in an FMU; give its scene")
        if hidden:
            kind = hidden.split("[")[0]
            raise UsageError(f'{path}: the FMU shows no {hidden}.r; expose = ["{kind}.r"] in [interface] of its scene')
        # A frame is looked up in the row, the inputs, and what is shown where neither has it.
        still = np.zeros((len(nodes) + len(slaves), 3))
        start = np.vstack([geometry.positions, geometry.slaves])
        self.constants = np.concatenate([start.ravel(), still.ravel()])
        columns = {name: 1 + k for k, name in enumerate(names)}
        columns |= {name: 1 + len(names) + k for k, name in enumerate(self.inputs.names)}
        first = 1 + len(names) + len(self.inputs.names)
        self.places = {}
        for quantity, missing in (("r", first), ("v", first + start.size), ("f", first + start.size)):
            place = missing + np.arange(start.size)
            for k, name in enumerate([*nodes, *slaves] if quantity != "f" else nodes):
                for i in range(3):
                    place[3 * k + i] = columns.get(f"{name}.{quantity}[{i + 1}]", place[3 * k + i])
            self.places[quantity] = place.reshape(-1, 3)

    def follow(self, row: np.ndarray) -> None:
        """Every row of the run, in order."""

    def look(self, row: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities and reactions of the nodes, then the slaves, (nodes + slaves, 3), at the row followed
        last."""
        values = np.concatenate([row, self.inputs.at(row[:1])[0], self.constants])
        r, v, f = (values[self.places[quantity]] for quantity in "rvf")
        return r, v, f


class Companion:
    """The same from a simulation of the scene in this process, stepped as the FMU is: for nodes behind ports."""

    def __init__(self, scene: Scene, found: dict, plan: Experiment):
        """scene: with positions shown (loading.load)."""
        self.simulation, self.inputs, self.time = scene.simulation(), plan.inputs, plan.start
        self.simulation.initialise(plan.start)
        rows = scene.model.report()
        node = {int(number): k for k, number in enumerate(rows["nodes"]["id"])}
        slave = {int(number): k for k, number in enumerate(rows["slaves"]["id"])}
        self.nodes = [node[row["id"]] for row in found["masters"] + found["points"]]
        self.slaves = [slave[row["id"]] for row in found["slaves"]]

    def follow(self, row):
        time = float(row[0])
        if self.inputs.names:
            self.simulation.set_values(self.inputs.names, self.inputs.at(np.array([self.time]))[0])
        if time > self.time:
            self.simulation.step(time - self.time)
        self.time = time

    def look(self, row):
        def of(node_field: str, slave_field: str) -> np.ndarray:
            return np.vstack(
                [self.simulation.get(node_field)[self.nodes], self.simulation.get(slave_field)[self.slaves]]
            )

        if self.inputs.names:
            self.simulation.set_values(self.inputs.names, self.inputs.at(row[:1])[0])
        r, v = of("position", "slave_position"), of("velocity", "slave_velocity")
        f = self.simulation.get("reaction_force")[self.nodes]
        return r, v, np.vstack([f, np.zeros((len(self.slaves), 3))])


class PvdFile:
    """Takes a run block by block: a VTU file for every k-th row, and for the last one, in a folder beside PATH, and
    PATH, a collection of them with their times. Points move; fields velocity (m/s) of nodes and slaves, reaction (N) of
    masters."""

    def __init__(
        self, path: Path, scene: Scene | None, found: dict, names: list[str], plan: Experiment, frames: int = FRAMES
    ):
        """scene: None where there is but an FMU; found: a report with positions; names: the FMU's outputs. Raises
        UsageError."""
        from tqdm import tqdm

        self.path, self.geometry = path, Geometry(found)
        self.motion: Companion | Columns
        if scene is not None and "ports" in found:
            self.motion = Companion(scene, found, plan)
        else:
            self.motion = Columns(path, self.geometry, found, names, plan)
        self.every = max(1, int(np.ceil((plan.rows - 1) / max(frames - 1, 0.5) * (1 - 1e-9))))
        frames = int(min(frames, plan.rows))
        self.bar = tqdm(total=frames, unit="frame", delay=2, disable=None, leave=False, desc=path.name)
        self.folder = path.with_name(path.stem + "_frames")
        self.count, self.written, self.frames = 0, [], frames
        self.folder.mkdir(exist_ok=True)
        self.collection = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
        self.sets = ElementTree.SubElement(self.collection, "Collection")

    def write(self, block: np.ndarray) -> None:
        for row in block:
            self.motion.follow(row)
            if self.count % self.every == 0:
                self.frame(row)
            self.count += 1
        self.last = block[-1].copy()

    def frame(self, row: np.ndarray) -> None:
        self.bar.update()
        r, v, f = self.motion.look(row)
        feet = self.geometry.projections(r[: len(self.geometry.ids)])
        still = np.zeros_like(feet)
        data = {"velocity": np.vstack([v, still]), "reaction": np.vstack([f, still])}
        name = f"{self.folder.name}/{len(self.written):06d}.vtu"
        self.written.append(self.path.parent / name)
        mesh(self.geometry, np.vstack([r, feet]), point_data=data).write(self.written[-1], file_format="vtu")
        ElementTree.SubElement(self.sets, "DataSet", timestep=repr(float(row[0])), part="0", file=name)

    def discard(self) -> None:
        """Of a run that stopped."""
        self.bar.close()
        for file in self.written:
            file.unlink(missing_ok=True)
        if not any(self.folder.iterdir()):
            self.folder.rmdir()

    def close(self) -> None:
        if (self.count - 1) % self.every and len(self.written) < self.frames:
            self.frame(self.last)
        self.bar.close()
        ElementTree.indent(self.collection)
        ElementTree.ElementTree(self.collection).write(self.path, encoding="utf-8", xml_declaration=True)
