"""Writes bracket.msh (gmsh: a flange with a bolt hole, rolled onto a cylinder, and the plate below it, with named
groups) and bracket.csv (the pull on the bolt): python scenes/make_bracket.py (needs gmsh)"""

from pathlib import Path

import gmsh
import numpy as np

HERE = Path(__file__).parent
RADIUS = 150.0  # mm, of the flange about the y axis
GAP = 2.0  # mm between the two mid-surfaces
HOLE = 24.0  # mm, arc length from the middle to the hole
TWIST = 0.002  # 1/mm: the plate is warped by TWIST x y


def flange():
    """Flat mesh of a 84 x 40 mm flange with a hole of 12 mm, in quads and triangles."""
    occ = gmsh.model.occ
    sheet = occ.addRectangle(-42, -20, 0, 84, 40)
    hole = occ.addDisk(HOLE, 0, 0, 6, 6)
    occ.cut([(2, sheet)], [(2, hole)])
    occ.synchronize()
    surface = gmsh.model.getEntities(2)[0][1]
    gmsh.model.mesh.setRecombine(2, surface)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 4.5)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 4.5)
    gmsh.option.setNumber("Mesh.RecombinationAlgorithm", 0)  # the plain one, which leaves some triangles
    gmsh.option.setNumber("Mesh.RandomSeed", 1)
    gmsh.model.mesh.generate(2)
    gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, [surface]), "flange")


def roll():
    """Bends the flat flange onto its cylinder; x becomes the arc length."""
    for tag in gmsh.model.mesh.getNodes()[0]:
        (x, y, _), *_ = gmsh.model.mesh.getNode(tag)
        angle = x / RADIUS
        gmsh.model.mesh.setNode(tag, [RADIUS * np.sin(angle), y, RADIUS * (np.cos(angle) - 1) + GAP], [])


def plate():
    """A coarse plate of 15 mm quads on the cylinder, warped by a twist; three of its quads are cut into triangles."""
    first = int(gmsh.model.mesh.getMaxNodeTag()) + 1
    columns, rows, size = 6, 3, 15.0
    tags, points = [], []
    for j in range(rows + 1):
        for i in range(columns + 1):
            x, y = size * (i - columns / 2), size * (j - rows / 2)
            tags.append(first + len(tags))
            points += [x, y, np.sqrt(RADIUS**2 - x**2) - RADIUS + TWIST * x * y]
    quads, triangles = [], []
    for j in range(rows):
        for i in range(columns):
            a = first + j * (columns + 1) + i
            b, c, d = a + 1, a + columns + 2, a + columns + 1
            if (i, j) in ((1, 1), (2, 2), (4, 1)):
                triangles += [a, b, c, a, c, d]
            else:
                quads += [a, b, c, d]
    surface = gmsh.model.addDiscreteEntity(2)
    gmsh.model.mesh.addNodes(2, surface, tags, points)
    element = int(gmsh.model.mesh.getMaxElementTag()) + 1
    gmsh.model.mesh.addElementsByType(surface, 2, range(element, element + len(triangles) // 3), triangles)
    element += len(triangles) // 3
    gmsh.model.mesh.addElementsByType(surface, 3, range(element, element + len(quads) // 4), quads)
    gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, [surface]), "plate")


def write_pull(rim):
    """1 ms, a pulse of 2 kN in all on the slaves round the hole, away from the plate and sideways."""
    times = np.linspace(0, 1e-3, 201)
    pulse = np.where(times < 3e-4, np.sin(np.pi * times / 3e-4) ** 2, 0.0)
    names = ["time"] + [f"slave[{j}].f[{k}]" for j in rim for k in (1, 3)]
    columns = [times] + [share / len(rim) * pulse for j in rim for share in (500.0, 2000.0)]
    lines = [",".join(names)] + [",".join(f"{x:.6g}" for x in row) for row in zip(*columns)]
    (HERE / "bracket.csv").write_text("\n".join(lines) + "\n")


def main():
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("bracket")
    flange()
    group = gmsh.model.getPhysicalGroups(2)[0][1]
    tags, points = gmsh.model.mesh.getNodesForPhysicalGroup(2, group)
    distance = np.hypot(points[0::3] - HOLE, points[1::3])
    slaves = np.sort(tags)
    rim = 1 + np.searchsorted(slaves, np.sort(tags[distance < 6.01]))
    roll()
    plate()
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    gmsh.write(str(HERE / "bracket.msh"))
    gmsh.finalize()
    write_pull(rim)


if __name__ == "__main__":
    main()
