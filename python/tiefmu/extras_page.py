"""documentation/index.html: what the FMU is, for the person who got it without the scene."""

from html import escape

from .extras_picture import Picture
from .report import counted, step, summary
from .scene import Scene

SHOWN = 200  # rows of a table; resources/report.json has all
MOST_DRAWN = 2000  # segments and slaves in a drawing; beyond that the page shows model.png

STYLE = """body { font-family: sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; line-height: 1.4 }
table { border-collapse: collapse; font-size: 85% } th, td { padding: 0.15em 0.7em; text-align: right }
thead { border-bottom: 1px solid #456 } caption { text-align: left; padding: 0.5em 0 }"""

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

PORTS = """<li><code>port[name]</code> of driven nodes: velocity <code>v</code> of the reference point and angular
velocity <code>w</code> move the nodes as one rigid body; <code>f</code>, <code>t</code> is the resultant of what ties
and springs do to them, about the reference point where it is now.</li>
<li><code>port[name]</code> of slaves: <code>f</code>, <code>t</code> is spread over the slaves with that resultant;
<code>v</code>, <code>w</code> is their mean rigid motion. f&middot;v + t&middot;w is the power of the slaves'
loads.</li>
"""

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
    title, ports = escape(scene.title or scene.name), found.get("ports", [])
    small = len(picture.segments) + len(found["slaves"]) <= MOST_DRAWN
    parts = [
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n",
        f"<p>A tied interface as an FMI 2.0 co-simulation FMU: {escape(summary(found))}.</p>\n",
        picture.svg() if small else '<p><img src="../model.png" alt="the scene"></p>',
        "\n<h2>Ties</h2>\n",
        table(
            "",
            ["tie", "formulation", "search", "distance [m]", "segments", "slaves"],
            [
                [row["name"], row["formulation"], row["search"], row["search_distance"], row["segments"], row["slaves"]]
                for row in found["ties"]
            ],
        ),
        table(
            "Slaves: the segment each is tied to, its projection there, the length of its offset and the weights "
            "of the segment's nodes.",
            ["slave j", "node", "tie", "segment", "xi", "eta", "d [m]", "nodes", "weights"],
            [
                [
                    row["number"],
                    row["id"],
                    row["tie"],
                    row["segment"],
                    row["xi"],
                    row["eta"],
                    row["d"],
                    " ".join(map(str, row["nodes"])),
                    " ".join(f"{w:.4g}" for w in row["weights"]),
                ]
                for row in found["slaves"][:SHOWN]
            ],
            len(found["slaves"]),
        ),
        table(
            "Masters: who moves them, their own mass and what the tie adds.",
            ["master i", "node", "motion", "rotations", "mass [kg]", "added mass [kg]", "added inertia [kg m2]"],
            [
                [
                    row["number"],
                    row["id"],
                    row["motion"],
                    "yes" if row["rotations"] else "no",
                    row["mass"],
                    row["added_mass"],
                    row["added_inertia"],
                ]
                for row in found["masters"][:SHOWN]
            ],
            len(found["masters"]),
        ),
        table(
            "Ports: nodes that the interface shows as one rigid body. Added: what the tie adds to a port of "
            "driven nodes, with the centre of that mass and its moments and products of inertia about it (xx, "
            "yy, zz, yz, zx, xy), at the start.",
            ["port", "nodes", "reference point [m]", "added mass [kg]", "centre [m]", "inertia [kg m2]"],
            [
                [
                    row["name"],
                    counted(len(row["nodes"]), "slave" if row["moves"] == "slaves" else "driven node"),
                    numbers(row["at"]),
                    row.get("added_mass", ""),
                    numbers(row.get("added_centre", [])),
                    numbers(row.get("added_inertia", [])),
                ]
                for row in ports[:SHOWN]
            ],
            len(ports),
        ),
        CONVENTIONS,
        "<h2>Settings</h2><ul>\n",
    ]
    settings = scene.settings
    parts += [
        f"<li>{REACTIONS[settings.reaction]}</li>\n",
        f"<li>Inertia: {settings.inertia}; geometry: {settings.geometry}; positions of driven nodes: "
        f"{settings.position}.</li>\n",
    ]
    if any(row["motion"] == "free" for row in found["masters"] + found["points"]):
        parts.append(
            f"<li>Stable step: {step(found['stable_time_step'])}, nodal step: "
            f"{step(found['nodal_time_step'])}. A communication step is divided into as many substeps as the "
            "limit asks.</li>\n"
        )
    if ports:
        parts.append(PORTS)
    parts.append("</ul>\n")
    for key in ("warnings", "notes"):
        if found[key]:
            parts.append(
                f"<h2>{key.capitalize()}</h2><ul>"
                + "".join(f"<li>{escape(line)}</li>" for line in found[key][:SHOWN])
                + "</ul>\n"
            )
    parts.append('<p><a href="licenses/license.txt">Licences</a></p>\n</body></html>\n')
    return "".join(parts).encode()


def numbers(values: list[float]) -> str:
    return " ".join(f"{value:.5g}" for value in values)


def table(caption: str, header: list[str], rows: list[list], total: int | None = None) -> str:
    if not rows:
        return ""
    if total and total > len(rows):
        caption += f" The first {len(rows)} of {total}; resources/report.json has all."
    body = "".join("<tr>" + "".join(f"<td>{cell(value)}</td>" for value in row) + "</tr>\n" for row in rows)
    return (
        f"<table><caption>{caption}</caption><thead><tr>"
        + "".join(f"<th>{name}</th>" for name in header)
        + f"</tr></thead><tbody>\n{body}</tbody></table>\n"
    )


def cell(value) -> str:
    return f"{value:.5g}" if isinstance(value, float) else escape(str(value))
