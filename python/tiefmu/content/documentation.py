"""documentation/index.html: what the FMU is, for the person who got it without the scene."""

from html import escape

from .. import sections
from ..html_page import bullets, document, paragraph
from ..report import step, summary
from ..scene import Scene
from .picture import Picture

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
"""

ARRAYS = """<li>Variables are arrays, [n, 3] for vectors: row k of <code>slave.f</code> belongs to the node whose id
stands at place k of <code>slave.node</code>. Arrays of a part of the nodes have a list of their own:
<code>master.t.node</code>.</li>
"""

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


def page(scene: Scene, found: dict, picture: Picture, fmi: int) -> bytes:
    """found: the scene's report; fmi: 2 or 3."""
    ports = found.get("ports", [])
    small = len(picture.segments) + len(found["slaves"]) <= MOST_DRAWN
    body = [
        paragraph(f"A tied interface as an FMI {fmi}.0 co-simulation FMU: {summary(found)}."),
        *sections.remarks(found),
        picture.svg() if small else '<p><img src="../model.png" alt="the scene"></p>',
        "<h2>Ties</h2>",
        sections.ties(found),
        sections.slaves(found),
        sections.masters(found),
        sections.ports(found),
        "<h2>What to look at</h2>",
        *sections.worst(found),
        CONVENTIONS + (ARRAYS if fmi == 3 else "") + "</ul>",
        "<h2>Settings</h2>",
        bullets(settings(scene, found) + (PORTS if ports else [])),
        "<h2>Variables</h2>",
        sections.interface(found, fmi),
    ]
    if found["notes"]:
        body += ["<h2>Notes</h2>", bullets([escape(line) for line in found["notes"][: sections.SHOWN]])]
    body.append('<p><a href="licenses/license.txt">Licences</a></p>')
    return document(scene.title or scene.name, body).encode()


def settings(scene: Scene, found: dict) -> list[str]:
    chosen = scene.settings
    lines = [
        REACTIONS[chosen.reaction],
        f"Inertia: {chosen.inertia}; geometry: {chosen.geometry}; positions of driven nodes: {chosen.position}.",
    ]
    if chosen.reaction_lead:
        lines.append(
            "Reactions run ahead: they answer to the accelerations plus "
            f"{chosen.reaction_lead:g} times their change over the last step, for a host that holds them."
        )
    if any(row["motion"] == "free" for row in found["masters"] + found["points"]):
        lines.append(
            f"Stable step: {step(found['stable_time_step'])}, nodal step: {step(found['nodal_time_step'])}. "
            "A communication step is divided into as many substeps as the limit asks."
        )
    return lines
