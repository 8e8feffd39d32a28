"""Writes mesh_transition.inp (a coarse and a fine face with named sets) and mesh_transition.csv (the wave that drives
the coarse one): python scenes/make_mesh_transition.py"""

from pathlib import Path

import meshio
import numpy as np

HERE = Path(__file__).parent
SIDE = 50.0  # mm
COARSE, FINE = 5, 20  # quads along a side


def face(count):
    """Nodes (n, 3) and quads of a square face of count x count quads."""
    line = np.linspace(0, SIDE, count + 1)
    y, x = np.meshgrid(line, line, indexing="ij")
    nodes = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    return nodes, corner[:, None] + [0, 1, count + 2, count + 1]


def write_mesh():
    coarse, coarse_quads = face(COARSE)
    fine, fine_quads = face(FINE)
    mesh = meshio.Mesh(
        np.vstack([coarse, fine]),
        [("quad", np.vstack([coarse_quads, fine_quads + len(coarse)]))],
        point_sets={"fine_nodes": np.arange(len(coarse), len(coarse) + len(fine))},
        cell_sets={"coarse_face": [np.arange(len(coarse_quads))]},
    )
    file = HERE / "mesh_transition.inp"
    mesh.write(file, float_fmt=".9g")
    file.write_text(file.read_text().replace("CAX4P", "S4R"))  # any Abaqus quad would do; these are faces


def write_wave():
    # A surface wave of 40 mm length and 3 km/s crosses the face at 30 degrees: up and down, and a quarter period
    # later along its way, so that every node runs an ellipse. It starts smoothly over the first two periods.
    length, speed, amplitude = 0.04, 3000.0, np.array([0.6, 1.0])  # m, m/s, m/s (along, up)
    along = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])
    times = np.linspace(0, 8e-5, 161)
    nodes = face(COARSE)[0][:, :2] * 1e-3
    names, columns = ["time"], [times]
    for i, node in enumerate(nodes, start=1):
        phase = 2 * np.pi / length * (speed * times - node @ along)
        ramp = np.sin(np.pi / 2 * np.clip(phase / (4 * np.pi), 0, 1)) ** 2
        forward = amplitude[0] * ramp * np.cos(phase)
        names += [f"master[{i}].v[{k}]" for k in (1, 2, 3)]
        columns += [forward * along[0], forward * along[1], amplitude[1] * ramp * np.sin(phase)]
    lines = [",".join(names)] + [",".join(f"{x:.6g}" for x in row) for row in zip(*columns)]
    (HERE / "mesh_transition.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    write_mesh()
    write_wave()
