"""VTK files: the ties of a scene (`info --vtu`), and a run over time (`run --pvd`)."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UsageError
from ..fmu_instance import Fmu
from ..scene import MOTIONS
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


class PvdFile:
    """Takes a run block by block: a VTU file for every k-th row in a folder beside PATH, and PATH, a collection of them
    with their times. Points move; fields velocity (m/s) of nodes and slaves, reaction (N) of masters."""

    def __init__(self, path: Path, fmu: Fmu, found: dict, names: list[str], plan: Experiment, frames: int = FRAMES):
        """found: the FMU's report; names: its outputs. Raises UsageError."""
        self.path, self.inputs, self.geometry = path, plan.inputs, Geometry(found)
        rows = self.geometry.rows
        prefixes = ["master"] * len(found["masters"]) + ["point"] * len(found["points"])
        nodes = [f"{prefix}[{row['number']}]" for prefix, row in zip(prefixes, rows)]
        slaves = [f"slave[{row['number']}]" for row in found["slaves"]]
        known = set(names) | set(self.inputs.names)
        moving = [name for name, row in zip(nodes, rows) if row["motion"] != "fixed"] + slaves
        hidden = next((name for name in moving if f"{name}.r[1]" not in known), None)
        if hidden and "ports" in found:
            raise UsageError(f"{path}: nodes behind ports show no positions; leave the ports out of the scene")
        if hidden:
            kind = hidden.split("[")[0]
            raise UsageError(f'{path}: the FMU shows no {hidden}.r; expose = ["{kind}.r"] in [interface] of its scene')
        # A frame is looked up in the row, the inputs, and what is shown where neither has it.
        still = np.zeros((len(nodes) + len(slaves), 3))
        start = np.vstack([self.geometry.positions, self.geometry.slaves])
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
        self.every = max(1, int(np.ceil(plan.rows / frames)))
        self.folder = path.with_name(path.stem + "_frames")
        self.count, self.written = 0, []
        self.folder.mkdir(exist_ok=True)
        self.collection = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
        self.sets = ElementTree.SubElement(self.collection, "Collection")

    def write(self, block: np.ndarray) -> None:
        for row in block[-self.count % self.every :: self.every]:
            self.frame(row)
        self.count += len(block)

    def frame(self, row: np.ndarray) -> None:
        values = np.concatenate([row, self.inputs.at(row[:1])[0], self.constants])
        r, v, f = (values[self.places[quantity]] for quantity in "rvf")
        feet = self.geometry.projections(r[: len(self.geometry.ids)])
        still = np.zeros_like(feet)
        data = {"velocity": np.vstack([v, still]), "reaction": np.vstack([f, still])}
        name = f"{self.folder.name}/{len(self.written):06d}.vtu"
        self.written.append(self.path.parent / name)
        mesh(self.geometry, np.vstack([r, feet]), point_data=data).write(self.written[-1], file_format="vtu")
        ElementTree.SubElement(self.sets, "DataSet", timestep=repr(float(row[0])), part="0", file=name)

    def discard(self) -> None:
        """Of a run that stopped."""
        for file in self.written:
            file.unlink(missing_ok=True)
        if not any(self.folder.iterdir()):
            self.folder.rmdir()

    def close(self) -> None:
        ElementTree.indent(self.collection)
        ElementTree.ElementTree(self.collection).write(self.path, encoding="utf-8", xml_declaration=True)
