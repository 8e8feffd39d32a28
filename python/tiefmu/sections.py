"""What a reviewer reads of a scene: the sections of the page inside an FMU and of `tiefmu report`, warnings first."""

from collections.abc import Callable
from html import escape

from .html_page import bullets, table
from .report import counted, step

SHOWN = 200  # rows of a table; the report as JSON has all
WORST = 10


def remarks(found: dict) -> list[str]:
    """Warnings and dropped slaves: what comes first."""
    parts = []
    if found["warnings"]:
        parts += ["<h2>Warnings</h2>", bullets([escape(line) for line in found["warnings"][:SHOWN]])]
    if found["dropped"]:
        parts.append("<h2>Dropped slaves</h2>")
        parts.append(
            first_rows(
                "Slaves that found no segment and are not tied.",
                ["slave", "tie", "reason"],
                found["dropped"],
                lambda row: [row["id"], row["tie"], row["reason"]],
            )
        )
    return parts


def worst(found: dict) -> list[str]:
    """The largest distances and added masses, and the clamped slaves."""
    far = sorted(found["slaves"], key=lambda row: -row["distance"])[:WORST]
    heavy = sorted(found["masters"], key=lambda row: -ratio(row))[:WORST]
    clamped = [row for row in found["slaves"] if row["clamped"]]
    return [
        first_rows(
            f"The {WORST} slaves farthest from their segment, over the search distance of their tie.",
            ["slave", "tie", "segment", "distance [m]", "of the search distance", "xi", "eta"],
            far,
            lambda row: [
                *(row[key] for key in ("id", "tie", "segment", "distance")),
                row["distance"] / search_distance(found, row) if search_distance(found, row) > 0 else None,
                row["xi"],
                row["eta"],
            ],
        ),
        first_rows(
            f"The {WORST} masters with the largest added over own mass.",
            ["node", "motion", "mass [kg]", "added mass [kg]", "added/own", "added inertia [kg m2]"],
            heavy,
            lambda row: [
                *(row[key] for key in ("id", "motion", "mass", "added_mass")),
                ratio(row) if row["mass"] > 0 else None,
                row["added_inertia"],
            ],
        ),
        first_rows(
            "Slaves outside their segment: mass, inertia and stiffness use the projection clamped to it.",
            ["slave", "tie", "segment", "xi", "eta", "distance [m]"],
            clamped,
            lambda row: [row[key] for key in ("id", "tie", "segment", "xi", "eta", "distance")],
        ),
        limits(found),
    ]


def ratio(row: dict) -> float:
    return row["added_mass"] / row["mass"] if row["mass"] > 0 else (float("inf") if row["added_mass"] > 0 else 0.0)


def search_distance(found: dict, slave: dict) -> float:
    return next(tie["search_distance"] for tie in found["ties"] if tie["name"] == slave["tie"])


def limits(found: dict) -> str:
    return table(
        ["step", "limit", "what"],
        [
            ["stable", step(found["stable_time_step"]), "2/omega_max of the assembled system"],
            ["nodal", step(found["nodal_time_step"]), "smallest sqrt(2 m/K) of the free nodes"],
            ["method", step(found["integrator_limit"]), "limit of the chosen integrator"],
        ],
        "Limits of the time step at the start.",
    )


def interface(found: dict, fmi: int = 2) -> str:
    """The variables, a row a kind."""
    numbers = "Value references run over the nodes by their number, and over x, y, z."

    def place(row):
        if fmi == 3:
            return f"{row['reference']}, {row['count']} elements"
        return f"{row['reference']}" + (f" to {row['reference'] + row['count'] - 1}" if row["count"] > 1 else "")

    return first_rows(
        f"Variables of the FMU, a row a kind. {numbers if fmi == 2 else ''}",
        ["name", "value references" if fmi == 2 else "value reference", "causality", "unit", "description"],
        found.get("interface", []),
        lambda row: [row["name"], place(row), *(row[key] for key in ("causality", "unit", "description"))],
    )


def ties(found: dict) -> str:
    keys = ("name", "formulation", "search", "search_distance", "segments", "slaves")
    return first_rows(
        "",
        ["tie", "formulation", "search", "distance [m]", "segments", "slaves"],
        found["ties"],
        lambda row: [row[key] for key in keys],
    )


def slaves(found: dict) -> str:
    return first_rows(
        "Slaves: the segment each is tied to, its projection there, the length of its offset and the weights "
        "of the segment's nodes.",
        ["slave j", "node", "tie", "segment", "xi", "eta", "d [m]", "nodes", "weights"],
        found["slaves"],
        lambda row: [
            *(row[key] for key in ("number", "id", "tie", "segment", "xi", "eta", "d")),
            " ".join(map(str, row["nodes"])),
            " ".join(f"{w:.4g}" for w in row["weights"]),
        ],
    )


def masters(found: dict) -> str:
    return first_rows(
        "Masters: who moves them, their own mass and what the tie adds.",
        ["master i", "node", "motion", "rotations", "mass [kg]", "added mass [kg]", "added inertia [kg m2]"],
        found["masters"],
        lambda row: [
            *(row[key] for key in ("number", "id", "motion")),
            "yes" if row["rotations"] else "no",
            *(row[key] for key in ("mass", "added_mass", "added_inertia")),
        ],
    )


def ports(found: dict) -> str:
    return first_rows(
        "Ports: nodes that the interface shows as one rigid body. Added: what the tie adds to a port of "
        "driven nodes, with the centre of that mass and its moments and products of inertia about it (xx, "
        "yy, zz, yz, zx, xy), at the start.",
        ["port", "nodes", "reference point [m]", "added mass [kg]", "centre [m]", "inertia [kg m2]"],
        found.get("ports", []),
        lambda row: [
            row["name"],
            counted(len(row["nodes"]), "slave" if row["moves"] == "slaves" else "driven node"),
            numbers(row["at"]),
            row.get("added_mass", ""),
            numbers(row.get("added_centre", [])),
            numbers(row.get("added_inertia", [])),
        ],
    )


def first_rows(caption: str, header: list[str], rows: list[dict], cells: Callable[[dict], list]) -> str:
    """The first rows as a table, nothing where there are none."""
    if not rows:
        return ""
    if len(rows) > SHOWN:
        caption += f" The first {SHOWN} of {len(rows)}; tiefmu info --json and modelDescription.xml have all."
    return table(header, [cells(row) for row in rows[:SHOWN]], caption)


def numbers(values: list[float]) -> str:
    return " ".join(f"{value:.5g}" for value in values)
