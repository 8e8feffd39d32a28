"""documentation/index.html: what the FMU is, for the person who got it without the scene."""

from collections.abc import Callable
from html import escape

from ..html_page import bullets, document, paragraph, table
from ..report import counted, step, summary
from ..scene import Scene
from .picture import Picture

SHOWN = 200  # rows of a table; resources/report.json has all
MOST_DRAWN = 2000  # segments and slaves in a drawing; beyond that the page shows model.png

CONVENTIONS = """<h2>Signs and conventions</h2><ul>
<li>SI units; vectors in the inertial frame, components [1], [2], [3] for x, y, z. i numbers the masters, j the slaves,
p the other ends of springs, each from 1 by ascending node id; descriptions give the id.</li>
<li><code>slave[j].f</code>, <code>slave[j].t</code>: force and moment <em>on</em> the slave from outside.</li>
<li><code>master[i].f</code>, <code>master[i].t</code>: what the tie does <em>to</em> the master. Add it to the node's
external loads. The slaves' loads times their velocities are the reactions times the masters'.</li>
<li>Default formulation: v<sub>s</sub> = v<sub>P</sub> + w<sub>P</sub> &times; d with the shape functions at the
projection P. Optimized: v<sub>s</sub> = v<sub>C</sub> + w &times; d with the segment's mean rigid motion about its
barycentre C.</li>
<li>Outputs belong to the inputs last set: a get after a set at the same time sees the new inputs.</li>
</ul>"""

PORTS = [
    "<code>port[name]</code> of driven nodes: velocity <code>v</code> of the reference point and angular velocity "
    "<code>w</code> move the nodes as one rigid body; <code>f</code>, <code>t</code> is the resultant of what ties and "
    "springs do to them, about the reference point where it is now.",
    "<code>port[name]</code> of slaves: <code>f</code>, <code>t</code> is spread over the slaves with that resultant; "
    "<code>v</code>, <code>w</code> is their mean rigid motion. f&middot;v + t&middot;w is the power of the slaves' "
    "loads.",
]

REACTIONS = {
    "loads": "The reaction is the slaves' load alone: the host carries a driven master's own mass and "
    "<code>added_mass</code> (and inertia).",
    "full": "The reaction holds the slaves' inertia: the host carries a driven master's own mass only. Stable with a "
    "held force only while the tied mass is below the host's.",
    "split": "The reaction is the full one plus the added inertia times the acceleration: the host carries own and "
    "added mass. Stable for every mass ratio.",
}


def page(scene: Scene, found: dict, picture: Picture) -> bytes:
    """found: the scene's report."""
    ports = found.get("ports", [])
    small = len(picture.segments) + len(found["slaves"]) <= MOST_DRAWN
    body = [
        paragraph(f"A tied interface as an FMI 2.0 co-simulation FMU: {summary(found)}."),
        picture.svg() if small else '<p><img src="../model.png" alt="the scene"></p>',
        "<h2>Ties</h2>",
        *tables(found, ports),
        CONVENTIONS,
        "<h2>Settings</h2>",
        bullets(settings(scene, found) + (PORTS if ports else [])),
    ]
    for key in ("warnings", "notes"):
        if found[key]:
            body += [f"<h2>{key.capitalize()}</h2>", bullets([escape(line) for line in found[key][:SHOWN]])]
    body.append('<p><a href="licenses/license.txt">Licences</a></p>')
    return document(scene.title or scene.name, body).encode()


def settings(scene: Scene, found: dict) -> list[str]:
    chosen = scene.settings
    lines = [
        REACTIONS[chosen.reaction],
        f"Inertia: {chosen.inertia}; geometry: {chosen.geometry}; positions of driven nodes: {chosen.position}.",
    ]
    if any(row["motion"] == "free" for row in found["masters"] + found["points"]):
        lines.append(
            f"Stable step: {step(found['stable_time_step'])}, nodal step: {step(found['nodal_time_step'])}. "
            "A communication step is divided into as many substeps as the limit asks."
        )
    return lines


def tables(found: dict, ports: list[dict]) -> list[str]:
    return [
        first_rows(
            "",
            ["tie", "formulation", "search", "distance [m]", "segments", "slaves"],
            found["ties"],
            lambda row: [
                row[key] for key in ("name", "formulation", "search", "search_distance", "segments", "slaves")
            ],
        ),
        first_rows(
            "Slaves: the segment each is tied to, its projection there, the length of its offset and the weights "
            "of the segment's nodes.",
            ["slave j", "node", "tie", "segment", "xi", "eta", "d [m]", "nodes", "weights"],
            found["slaves"],
            lambda row: [
                *(row[key] for key in ("number", "id", "tie", "segment", "xi", "eta", "d")),
                " ".join(map(str, row["nodes"])),
                " ".join(f"{w:.4g}" for w in row["weights"]),
            ],
        ),
        first_rows(
            "Masters: who moves them, their own mass and what the tie adds.",
            ["master i", "node", "motion", "rotations", "mass [kg]", "added mass [kg]", "added inertia [kg m2]"],
            found["masters"],
            lambda row: [
                *(row[key] for key in ("number", "id", "motion")),
                "yes" if row["rotations"] else "no",
                *(row[key] for key in ("mass", "added_mass", "added_inertia")),
            ],
        ),
        first_rows(
            "Ports: nodes that the interface shows as one rigid body. Added: what the tie adds to a port of "
            "driven nodes, with the centre of that mass and its moments and products of inertia about it (xx, "
            "yy, zz, yz, zx, xy), at the start.",
            ["port", "nodes", "reference point [m]", "added mass [kg]", "centre [m]", "inertia [kg m2]"],
            ports,
            lambda row: [
                row["name"],
                counted(len(row["nodes"]), "slave" if row["moves"] == "slaves" else "driven node"),
                numbers(row["at"]),
                row.get("added_mass", ""),
                numbers(row.get("added_centre", [])),
                numbers(row.get("added_inertia", [])),
            ],
        ),
    ]


def first_rows(caption: str, header: list[str], rows: list[dict], cells: Callable[[dict], list]) -> str:
    """The first rows as a table, nothing where there are none."""
    if not rows:
        return ""
    if len(rows) > SHOWN:
        caption += f" The first {SHOWN} of {len(rows)}; resources/report.json has all."
    return table(header, [cells(row) for row in rows[:SHOWN]], caption)


def numbers(values: list[float]) -> str:
    return " ".join(f"{value:.5g}" for value in values)
