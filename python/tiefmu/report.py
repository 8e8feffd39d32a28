"""The tie report: as a dict (which is also the JSON), and as text."""

import json
import re
import zipfile
from collections import Counter
from pathlib import Path

import numpy as np

from . import _core
from .errors import UsageError
from .scene import MOTIONS, Scene

MOST_PLACES = 10_000  # masters and points whose positions the report holds: an FMU grows by 200 kB at most
NUMBER = re.compile(r"-?\d[\d.]*(e[+-]?\d+)?")
MANY_VARIABLES = 10_000  # importers read them in seconds, masters connect them in minutes
SHOWN = 20  # slaves, masters, points and ids that the text shows; the dict has all


def report(scene: Scene, positions: bool = False, arrays: bool = False) -> dict:
    """What became of the scene: ties, slaves, masters, points, limits, findings; plain lists and numbers, SI units.

    Keys are those of the JSON. Per slave: xi, eta of the projection and its distance; d = |offset|, to the
    projection (default) or the segment's barycentre (optimized); `weights` as the tie uses them (Phi, or 1/n);
    `added`: lumped mass and inertia on each master (theory 4). A step that nothing limits is 1e30; an infinite `cond`
    or `lambda` is null. `position`: of masters and points at the start, where they are at most MOST_PLACES, or
    if asked for by `positions`. `interface`: the variables, a row a kind. `arrays`: of an FMI 3.0 FMU, where their
    number is no matter.
    `lumping`: {"ratio", "segment", "connected"}: how far lumped inertia is from the true one (src/lumping.hpp; ratio
    null: infinite); null where no master is free, lumping is exact, or inertia is consistent.
    """
    found = scene.model.report()
    slaves, nodes = found["slaves"], found["nodes"]
    by_id = np.argsort(slaves["id"], kind="stable")
    ports = {"ports": port_rows(scene, found)} if found["ports"] else {}
    variables = variable_counts(scene)
    positions = positions or len(nodes["id"]) <= MOST_PLACES
    return {
        "title": scene.title,
        "ties": ties(scene, found),
        "slaves": slave_rows(scene, found, by_id),
        "masters": node_rows(scene, nodes, True, positions),
        "points": node_rows(scene, nodes, False, positions),
        "springs": found["springs"],
        "dropped": [
            {"id": number, "tie": scene.ties[tie].name, "reason": reason} for number, tie, reason in found["dropped"]
        ],
        "left_out": found["left_out"].tolist(),
        "warnings": scene.warnings + found["warnings"] + size_warning(0 if arrays else sum(variables.values())),
        "notes": [*scene.notes, *found["notes"]],
        "stable_time_step": scene.start.get("stable_time_step").tolist()[0],
        "nodal_time_step": scene.start.get("nodal_time_step").tolist()[0],
        "integrator_limit": scene.start.integrator_limit,
        "lumping": lumping(found["lumping"]),
        "freedoms": freedoms(scene, nodes),
        "variables": variables,
        "interface": interface_rows(scene),
    } | ports


def lumping(row: dict | None) -> dict | None:
    return row and row | {"ratio": float(f"{row['ratio']:.6g}") if np.isfinite(row["ratio"]) else None}


def lumping_line(row: dict) -> str:
    """Of a surface the ratio is a bound: that of its worst segment alone."""
    if row["ratio"] is None:
        return (
            f"lumped inertia: motions of the free masters have no true energy (segment {row['segment']}); "
            '[model] inertia = "consistent" needs masters with mass of their own'
        )
    reach, price = ("at most", "two to five times") if row["connected"] else ("up to", "one to five times")
    return (
        f"lumped inertia: kinetic energy of the free masters is {reach} {row['ratio']:.3g} times the true one "
        f'(segment {row["segment"]}); [model] inertia = "consistent" is exact, for {price} the time of a step'
    )


def ties(scene: Scene, found: dict) -> list[dict]:
    slaves = found["slaves"]
    rows = []
    for number, (table, distance) in enumerate(zip(scene.ties, found["search_distance"])):
        own = slaves["tie"] == number
        rows.append(
            {
                "name": table.name,
                "formulation": table.formulation,
                "search": table.search,
                "search_distance": distance,
                "segments": len(np.unique(slaves["segment"][own])),
                "slaves": int(own.sum()),
            }
        )
    return rows


def slave_rows(scene: Scene, found: dict, order: np.ndarray) -> list[dict]:
    s = {key: value[order] for key, value in found["slaves"].items()}
    n = s["corners"]
    optimized = s["coupling"] == found["couplings"].index("mean-motion")
    corner = np.arange(4) < n[:, None]
    share = np.where(optimized[:, None], corner / n[:, None], s["weights"])
    names = [table.name for table in scene.ties]
    columns = {
        "id": s["id"].tolist(),
        "number": s["number"].tolist(),
        "tie": [names[tie] for tie in s["tie"].tolist()],
        "segment": s["segment"].tolist(),
        "xi": s["xi"].tolist(),
        "eta": s["eta"].tolist(),
        "distance": s["distance"].tolist(),
        "d": s["d"].tolist(),
        "offset": s["offset"].tolist(),
        "nodes": s["nodes"].tolist(),
        "weights": share.tolist(),
        "cond": finite(s["cond"]),
        "clamped": s["clamped"].astype(bool).tolist(),
        "lambda": finite(s["lambda"]),
    }
    rows = []
    for k, masses, inertias, *values in zip(
        n.tolist(), s["added_mass"].tolist(), s["added_inertia"].tolist(), *columns.values()
    ):
        row = dict(zip(columns, values))
        row["nodes"], row["weights"] = row["nodes"][:k], row["weights"][:k]
        row["added"] = [{"node": row["nodes"][i], "mass": masses[i], "inertia": inertias[i]} for i in range(k)]
        rows.append(row)
    return rows


def finite(values: np.ndarray) -> list:
    return [value if known else None for value, known in zip(values.tolist(), np.isfinite(values).tolist())]


def node_rows(scene: Scene, nodes: dict, master: bool, positions: bool) -> list[dict]:
    """One row a master or point, by ascending number."""
    start, rotating = scene.start, nodes["rotating"]
    stiffness, added_mass = start.get("stiffness"), start.get("added_mass")
    added_inertia, rotational_stiffness = start.get("added_inertia"), start.get("rotational_stiffness")
    rows = []
    places = rounded(nodes["position"]).tolist() if positions else None
    for i in np.argsort(nodes["number"], kind="stable").tolist():
        if bool(nodes["master"][i]) != master:
            continue
        mass = float(nodes["mass"][i])
        row = {
            "id": int(nodes["id"][i]),
            "number": int(nodes["number"][i]),
            "motion": MOTIONS[nodes["motion"][i]],
            "rotations": i < rotating,
            "mass": mass,
            "added_mass": float(added_mass[i]),
            "added_inertia": 0.0,
            "stiffness": float(stiffness[i]),
            "rotational_stiffness": 0.0,
        }
        steps = [_core.nodal_step(mass + row["added_mass"], row["stiffness"])]
        if i < rotating:
            row["added_inertia"] = float(added_inertia[i])
            row["rotational_stiffness"] = float(rotational_stiffness[i])
            steps.append(
                _core.nodal_step(float(nodes["inertia"][i]) + row["added_inertia"], row["rotational_stiffness"])
            )
        row["nodal_time_step"] = min(steps)
        if places is not None:
            row["position"] = places[i]
        rows.append(row)
    return rows


def rounded(positions: np.ndarray) -> np.ndarray:
    """Positions to 1e-7 of the scene's size, which is enough to draw it and takes half of the bytes."""
    size = float(np.ptp(positions, axis=0).max()) if len(positions) else 0.0
    return np.round(positions, int(np.ceil(7 - np.log10(size)))) if size > 0 else positions


def port_rows(scene: Scene, found: dict) -> list[dict]:
    """One row a port, in the scene's order. Of driven nodes also what the tie adds to them, as one body: its mass, the
    centre of that mass and the moments and products of inertia about it (xx, yy, zz, yz, zx, xy), at the start."""
    nodes, rows = found["nodes"], []
    added_mass, added_inertia = scene.start.get("added_mass"), scene.start.get("added_inertia")
    index = dict(zip(nodes["id"].tolist(), range(len(nodes["id"]))))
    for port in sorted(found["ports"], key=lambda port: port["number"]):
        ids = np.sort(port["ids"])
        row = {
            "name": port["name"],
            "moves": "slaves" if port["of_slaves"] else "driven nodes",
            "at": port["at"],
            "nodes": ids.tolist(),
        }
        if not port["of_slaves"]:
            own = np.array([index[i] for i in ids.tolist()])
            mass, position = added_mass[own], nodes["position"][own]
            total = float(mass.sum())
            centre = mass @ position / total if total > 0 else np.array(port["at"])
            arm = position - centre
            tensor = np.einsum(
                "n,nij->ij", mass, (arm**2).sum(axis=1)[:, None, None] * np.eye(3) - arm[:, :, None] * arm[:, None, :]
            )
            tensor += added_inertia[own[own < nodes["rotating"]]].sum() * np.eye(3)
            row |= {
                "added_mass": total,
                "added_centre": centre.tolist(),
                "added_inertia": [float(tensor[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1))],
            }
        rows.append(row)
    return rows


def freedoms(scene: Scene, nodes: dict) -> dict:
    """How many the model keeps - of driven nodes as inputs, of free ones as unknowns - and what it leaves out."""
    moving = nodes["motion"] != MOTIONS.index("fixed")
    rotating = np.arange(len(nodes["id"])) < nodes["rotating"]
    dropped = np.setdiff1d(np.intersect1d(scene.rotations, nodes["id"]), nodes["id"][rotating])
    left_out = [f"rotations of node {number}" for number in dropped.tolist()]
    left_out += [f"{MOTIONS[2]} node {number}" for number in np.sort(nodes["id"][~moving]).tolist()]
    return {
        "translations": 3 * int(moving.sum()),
        "rotations": 3 * int((moving & rotating).sum()),
        "left_out": left_out,
    }


def variable_counts(scene: Scene) -> dict:
    counts = {}
    for block in scene.start.variables:
        counts[block["name"]] = counts.get(block["name"], 0) + len(block["numbers"]) * block["components"]
    return counts


def interface_rows(scene: Scene) -> list[dict]:
    """A row a block of variables: its first name with i, j, p or the port for the node and k for the component, the
    first value reference and how many follow."""
    letters = {"master": "[i]", "slave": "[j]", "point": "[p]", "port": "[name]"}
    rows = []
    for block in scene.start.variables:
        prefix, components = block["prefix"], block["components"]
        name = block["name"].replace(prefix, prefix + letters[prefix], 1) if prefix in letters else block["name"]
        rows.append(
            {
                "name": name + ("[k]" if components == 3 else ""),
                "reference": int(block["reference"]),
                "count": max(1, len(block["numbers"])) * components,
                **{key: block[key] for key in ("causality", "unit", "description")},
            }
        )
    return rows


def size_warning(variables: int) -> list[str]:
    if variables <= MANY_VARIABLES:
        return []
    return [
        f"interface: {variables} variables; many importers and masters take minutes over more than {MANY_VARIABLES}; "
        "'ports' in [interface] makes the nodes of a set one rigid port of 12 variables, and 'tiefmu build --fmi 3' "
        "makes arrays of them"
    ]


def of_fmu(path: Path) -> dict:
    """The report that an FMU carries; UsageError if it is none of ours."""
    try:
        with zipfile.ZipFile(path) as archive:
            found = json.loads(archive.read("resources/report.json"))
    except KeyError:
        raise UsageError(f"{path}: holds no resources/report.json, so it was not made by tiefmu") from None
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from None
    except ValueError:
        raise UsageError(f"{path}: its resources/report.json is damaged") from None
    except Exception:  # damaged archives raise many kinds
        raise UsageError(f"{path}: not an FMU (a zip archive)") from None
    if not isinstance(found, dict) or "slaves" not in found:
        raise UsageError(f"{path}: its resources/report.json is none of tiefmu")
    return found


def of_folder(folder: Path) -> dict | None:
    """The report of an unpacked FMU; None if it is none of ours."""
    try:
        found = json.loads((folder / "resources" / "report.json").read_bytes())
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and "integrator_limit" in found else None


# ------------------------------------------------------------------------------------------------------------- as text


def text(name: str, found: dict) -> str:
    """The report as people read it: at most SHOWN slaves, masters and points, and how many more there are."""
    lines = [f"{name}: {found['title']}" if found["title"] else name, summary(found), ""]
    for tie in found["ties"]:
        lines.append(
            f"tie '{tie['name']}': {tie['formulation']} formulation, search '{tie['search']}' within "
            f"{tie['search_distance']:.6g} m: {counted(tie['slaves'], 'slave')} on "
            f"{counted(tie['segments'], 'segment')}"
        )
    lines += ["", *slave_text(found["slaves"])]
    lines += node_text("master", found["masters"])
    lines += node_text("point", found["points"])
    lines += port_text(found.get("ports", []))
    lines += [
        "steps",
        f"  stable  {step(found['stable_time_step'])}   2/omega_max of the assembled system",
        f"  nodal   {step(found['nodal_time_step'])}   smallest sqrt(2 m/K) of the free nodes",
        f"  method  {step(found['integrator_limit'])}   limit of the chosen integrator",
        "",
    ]
    if found.get("lumping"):  # FMUs of an earlier program have none
        lines.append(lumping_line(found["lumping"]))
    lines.append(
        f"freedoms: {found['freedoms']['translations']} translations, {found['freedoms']['rotations']} rotations"
    )
    lines += listed("  left out: ", found["freedoms"]["left_out"])
    lines += listed("nodes that no tie and no spring uses, left out: ", found["left_out"])
    lines += [f"dropped: slave {row['id']} of tie '{row['tie']}': {row['reason']}" for row in found["dropped"][:SHOWN]]
    lines += more(found["dropped"], "dropped slaves")
    for key in ("warnings", "notes"):
        lines += [f"{key[:-1]}: {line}" for line in of_each_kind(found[key], SHOWN, " (--json lists all)")]
    return "\n".join(lines) + "\n"


def slave_text(slaves: list[dict]) -> list[str]:
    header = (
        f"{'slave':>9} {'j':>6} {'tie':<12} {'segment':>9} {'xi':>9} {'eta':>9} {'d [m]':>11} {'cond':>9}  "
        "weight -> master: added mass [kg], inertia [kg m2]"
    )
    lines = [header] if slaves else []
    for row in slaves[:SHOWN]:
        condition = "inf" if row["cond"] is None else f"{row['cond']:.3g}"
        first = (
            f"{row['id']:>9} {row['number']:>6} {row['tie'][:12]:<12} {row['segment']:>9} {row['xi']:>9.5f} "
            f"{row['eta']:>9.5f} {row['d']:>11.5g} {condition:>9}  "
        )
        for weight, added in zip(row["weights"], row["added"]):
            lines.append(f"{first}{weight:>8.5f} -> {added['node']}: {added['mass']:.5g}, {added['inertia']:.5g}")
            first = " " * len(first)
        if row["clamped"]:
            lines.append(
                " " * len(first) + "outside its segment: mass, inertia and stiffness use the projection clamped to it"
            )
    return [*lines, *more(slaves, "slaves"), ""] if slaves else []


def node_text(what: str, nodes: list[dict]) -> list[str]:
    if not nodes:
        return []
    lines = [
        f"{what:>9} {'i':>6} {'motion':>7} {'rot':>4} {'mass [kg]':>11} {'added':>11} {'inertia +':>11} "
        f"{'K [N/m]':>11} {'nodal step [s]':>15}"
    ]
    for row in nodes[:SHOWN]:
        lines.append(
            f"{row['id']:>9} {row['number']:>6} {row['motion']:>7} {'yes' if row['rotations'] else 'no':>4} "
            f"{row['mass']:>11.5g} {row['added_mass']:>11.5g} {row['added_inertia']:>11.5g} "
            f"{row['stiffness']:>11.5g} {step(row['nodal_time_step']):>15}"
        )
    return [*lines, *more(nodes, what + "s"), ""]


def port_text(ports: list[dict]) -> list[str]:
    lines = []
    for row in ports[:SHOWN]:
        what = "slave" if row["moves"] == "slaves" else "driven node"
        added = f", added mass {row['added_mass']:.5g} kg" if "added_mass" in row else ""
        lines.append(
            f"port '{row['name']}': {counted(len(row['nodes']), what)} about "
            f"[{', '.join(f'{x:.6g}' for x in row['at'])}] m{added}"
        )
    return [*lines, *more(ports, "ports"), ""] if ports else []


def summary(found: dict) -> str:
    """How much of everything, in one line."""
    whats = ["tie", "slave", "master", "point"] + (["port"] if "ports" in found else [])
    return ", ".join(
        [
            *(counted(len(found[f"{what}s"]), what) for what in whats),
            counted(found["springs"], "spring"),
            counted(sum(found["variables"].values()), "variable"),
        ]
    )


def counted(n: int, what: str) -> str:
    return f"{n} {what}" + ("s" if n != 1 else "")


def step(seconds: float) -> str:
    return "no limit" if seconds >= 1e30 else f"{seconds:.6g} s"


def more(rows: list, what: str) -> list[str]:
    return [f"  ... and {len(rows) - SHOWN} more {what} (--json lists all)"] if len(rows) > SHOWN else []


def of_each_kind(lines: list[str], most: int, where: str) -> list[str]:
    """The first `most` of the lines that differ in numbers alone, then how many more there are, and `where`."""
    kinds = [NUMBER.sub("0", line) for line in lines]
    total, count = Counter(kinds), Counter()
    shown = []
    for line, kind in zip(lines, kinds):
        count[kind] += 1
        if count[kind] <= most:
            shown.append(line)
        elif count[kind] == total[kind]:
            shown.append(f"{total[kind] - most} more like these{where}")
    return shown


def listed(intro: str, items: list) -> list[str]:
    if not items:
        return []
    rest = f" and {len(items) - SHOWN} more" if len(items) > SHOWN else ""
    return [intro + ", ".join(map(str, items[:SHOWN])) + rest]
