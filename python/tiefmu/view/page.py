"""`tiefmu report`: one self-contained page of a scene to sign off, with a picture that turns in the browser."""

import argparse
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__, sections
from ..arguments import check_ending, check_folder_of, existing, is_fmu
from ..errors import UsageError
from ..html_page import bullets, document, paragraph, table
from ..loading import load
from ..report import of_fmu, report, summary
from ..results import needed
from .geometry import Geometry

DRAWN = 20_000  # slaves at most, those farthest from their segments
LABELLED = 10
SEGMENT, EDGE, MASTER = "#c9d8e6", "#445566", "#223344"


def add_parser(commands) -> None:
    command = commands.add_parser(
        "report",
        help="write a page to sign off: what is tied to what, in 3-D",
        description="Writes one self-contained HTML page of a scene, or of an FMU made by tiefmu: warnings, a picture "
        "that turns in the browser, worst distances, added masses, clamps, limits, variables. Opens without a network.",
        epilog="example: tiefmu report weld.toml -o weld.html",
    )
    command.add_argument("model", metavar="SCENE-or-FMU", help="scene (TOML), deck, or FMU made by tiefmu")
    command.add_argument(
        "-o", "--output", metavar="HTML", type=Path, help="file to write (default: name of the model + .html, here)"
    )
    command.set_defaults(command=run_report)


def run_report(options: argparse.Namespace) -> None:
    path = options.output or Path(f"{Path(options.model).stem}.html")
    check_ending(path, ".html", ".htm")
    check_folder_of(path)
    needed("plotly", "report", "tiefmu report")
    found = of_fmu(existing(options.model)) if is_fmu(options.model) else report(load(options.model), positions=True)
    path.write_text(page(Path(options.model).name, found), encoding="utf-8")
    print(f"{path}: {summary(found)}, {path.stat().st_size / 1024:.0f} KiB")


def page(name: str, found: dict) -> str:
    """The page as HTML. found: a report."""
    try:
        picture = viewer(Geometry(found), found)
    except UsageError as error:
        picture = paragraph(f"No picture: {error}.")
    body = [
        paragraph(f"{name}: {summary(found)}."),
        *sections.remarks(found),
        "<h2>What is tied to what</h2>",
        picture,
        sections.ties(found),
        "<h2>What to look at</h2>",
        *sections.worst(found),
        "<h2>Slaves, masters, ports</h2>",
        scrolled(sections.slaves(found)),
        scrolled(sections.masters(found)),
        scrolled(sections.ports(found)),
        "<h2>Variables</h2>",
        sections.interface(found),
    ]
    if found["notes"]:
        body += ["<h2>Notes</h2>", bullets([escape(line) for line in found["notes"][: sections.SHOWN]])]
    body += ["<h2>Signed</h2>", table(["checked by", "date", "signature"], [["\u2002" * 30] * 3])]
    body.append(paragraph(f"Written by tiefmu {__version__}."))
    return document(found["title"] or name, body)


def scrolled(html: str) -> str:
    return f'<div class="scroll">{html}</div>' if html else ""


def viewer(geometry: Geometry, found: dict) -> str:
    """The picture, with the library that turns it."""
    import plotly.graph_objects as go

    rows = found["slaves"]
    origin = near(geometry.positions)
    nodes, slaves = geometry.positions - origin, geometry.slaves - origin
    order = sorted(range(len(rows)), key=lambda k: -rows[k]["distance"])[:DRAWN]
    places, feet = slaves[order], (geometry.feet - origin)[order]
    distances = [rows[k]["distance"] for k in order]
    words = [
        f"slave {row['id']}, tie {escape(row['tie'])}<br>segment {row['segment']}, xi {row['xi']:.4g}, eta "
        f"{row['eta']:.4g}<br>distance {row['distance']:.4g} m" + ("<br>clamped" if row["clamped"] else "")
        for row in (rows[k] for k in order)
    ]
    masters = [
        f"node {row['id']}, {row['motion']}<br>mass {row['mass']:.4g} kg, added {row['added_mass']:.4g} kg"
        for row in geometry.rows
    ]
    corners = [[*c, c[-1]][:4] for c in geometry.segments.values()]
    corner = np.array(corners, dtype=int).reshape(-1, 4)
    faces = np.vstack([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])
    figure = go.Figure()
    x, y, z = nodes.T
    figure.add_trace(
        go.Mesh3d(
            x=x, y=y, z=z, i=faces[:, 0], j=faces[:, 1], k=faces[:, 2], color=SEGMENT, opacity=0.7, hoverinfo="skip",
            name="segments", flatshading=True, showlegend=True,
        )
    )  # fmt: skip
    outline = nodes[corner[:, [0, 1, 2, 3, 0]]]
    figure.add_trace(lines(outline, EDGE, 2, "edges"))
    figure.add_trace(lines(np.stack([feet, places], axis=1), "#bb4400", 2, "to the projection"))
    figure.add_trace(points(nodes, masters, "nodes", {"size": 3, "color": MASTER}))
    bar = {"title": {"text": "distance [m]", "side": "right"}, "thickness": 14}
    look = {"size": 5, "color": distances, "colorscale": "Viridis", "colorbar": bar, "showscale": True}
    if distances and distances[0] == distances[-1]:
        look |= {"cmin": 0.0, "cmax": distances[0] or 1.0}
    shown = f"slaves (the {DRAWN} farthest of {len(rows)})" if len(rows) > DRAWN else "slaves"
    figure.add_trace(points(places, words, shown, look))
    worst = order[:LABELLED]
    x, y, z = slaves[worst].T
    figure.add_trace(
        go.Scatter3d(
            x=x, y=y, z=z, mode="text", text=[str(rows[k]["id"]) for k in worst], textposition="top center",
            hoverinfo="skip", name="worst distances",
        )
    )  # fmt: skip
    figure.update_layout(
        height=640,
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        scene={
            "aspectmode": "data",
            "camera": {"eye": {"x": 1.5, "y": 1.5, "z": 1.5}},
            **{
                f"{axis}axis": {"title": {"text": f"{axis} {f'{-o:+.9g} ' if o else ''}[m]"}}
                for axis, o in zip("xyz", origin.tolist())
            },
        },
        legend={"x": 0, "y": 1},
    )
    return figure.to_html(full_html=False, include_plotlyjs=True, div_id="picture", config={"displaylogo": False})


def near(positions: np.ndarray) -> np.ndarray:
    """Where the picture has its origin: browsers draw with seven digits. Zero unless the scene is far from it, (3,)."""
    size, centre = float(np.ptp(positions, axis=0).max()), positions.mean(axis=0)
    if not 0 < 1e3 * size < np.abs(centre).max():
        return np.zeros(3)
    return np.round(centre, int(np.floor(-np.log10(size))))


def lines(polylines: np.ndarray, colour: str, width: float, name: str) -> Any:
    """polylines: (n, corners, 3); a gap after each."""
    import plotly.graph_objects as go

    gaps = np.concatenate([polylines, np.full((len(polylines), 1, 3), np.nan)], axis=1).reshape(-1, 3)
    x, y, z = gaps.T
    return go.Scatter3d(
        x=x, y=y, z=z, mode="lines", line={"color": colour, "width": width}, hoverinfo="skip", name=name
    )


def points(places: np.ndarray, words: list[str], name: str, look: dict) -> Any:
    import plotly.graph_objects as go

    x, y, z = places.T
    return go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=look, hovertext=words, hoverinfo="text", name=name)
