"""Ports for studies, which move and load the nodes one by one: what inputs of ports mean to their nodes."""

import numpy as np

from ..errors import UsageError
from ..scene import Scene

TURN = 0.01  # rad between the rows that a turning port is given at: straight lines between them are right to TURN^2 / 8
MOST_ROWS = 100_000


def expand(scene: Scene, time: np.ndarray, values: dict) -> tuple[np.ndarray, dict]:
    """The inputs with those of ports, {(port's name, "v" | "w" | "f" | "t"): (rows, 3)}, replaced by those of nodes,
    {(node id, ...): (rows, 3)}; all at times that may be more than before. Motions follow theory (3.9); loads are
    spread by (3.14) over the slaves where they are at the start. Raises UsageError."""
    found = scene.model.report()
    ports = [port for port in found["ports"] if any((port["name"], key) in values for key in "vwft")]
    given = {key: x for key, x in values.items() if not isinstance(key[0], str)}
    if not ports:
        return time, given

    def of(port: dict, key: str) -> np.ndarray:
        return values.get((port["name"], key), np.zeros((len(time), 3)))

    driven = [port for port in ports if not port["of_slaves"]]
    fine = refined(time, [of(port, "w") for port in driven], scene.settings.geometry == "finite", scene.file)
    place = dict(zip(found["nodes"]["id"].tolist(), found["nodes"]["position"]))
    rotating = set(found["nodes"]["id"][: found["nodes"]["rotating"]].tolist())
    result = {key: at(fine, time, x) for key, x in given.items()}
    for port in driven:
        v, w = at(fine, time, of(port, "v")), at(fine, time, of(port, "w"))
        turned = rotations(fine, w) if scene.settings.geometry == "finite" else np.eye(3)[None]
        for node in port["ids"].tolist():
            arm = turned @ (place[node] - np.array(port["at"]))
            result[node, "v"] = v + np.cross(w, arm)
            if node in rotating:
                result[node, "w"] = w
    for which, port in enumerate(port for port in found["ports"] if port["of_slaves"]):
        if any((port["name"], key) in values for key in "ft"):
            for (node, key), spread in shares(scene, which).items():
                load = np.hstack([of(port, "f"), of(port, "t")]) @ spread.T
                result[node, key] = result.get((node, key), 0) + at(fine, time, load)
    return fine, result


def at(fine: np.ndarray, time: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(fine, time, column) for column in x.T])


def refined(time: np.ndarray, spins: list[np.ndarray], finite: bool, file: str) -> np.ndarray:
    """The times, and between them so many more that no port turns by more than TURN."""
    steps, parts = np.diff(time), np.ones(len(time) - 1)
    for w in spins if finite else []:
        rate = np.linalg.norm(w, axis=1)
        turn = np.maximum(rate[1:], rate[:-1]) * steps
        change = np.sqrt(np.linalg.norm(np.diff(w, axis=0), axis=1) * steps)
        parts = np.maximum(parts, np.ceil(np.where(turn > 0, np.maximum(turn, np.minimum(change, 1)) / TURN, 1)))
    if parts.sum() > MOST_ROWS:
        raise UsageError(f"{file}: a port turns too far for a study; give a shorter input")
    inner = [a + h * np.arange(n) / n for a, h, n in zip(time[:-1], steps, parts.astype(int))]
    return np.concatenate([*inner, time[-1:]])


def rotations(time: np.ndarray, w: np.ndarray) -> np.ndarray:
    """R at each time (n, 3, 3), of a spin that is linear in between: theory (3.11)."""
    turned = np.empty((len(time), 3, 3))
    turned[0] = np.eye(3)
    for k, h in enumerate(np.diff(time)):
        g = 0.5 * h * (w[k] + w[k + 1]) - h * h / 12 * np.cross(w[k], w[k + 1])
        turned[k + 1] = rotation(g) @ turned[k]
    return turned


def rotation(g: np.ndarray) -> np.ndarray:
    """Of the rotation vector g [Rodrigues 1840]."""
    angle = np.linalg.norm(g)
    cross = skew(g)
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross


def shares(scene: Scene, which: int) -> dict:
    """{(slave id, "f" | "t"): (3, 6)}: its load from force and moment on the port of slaves `which`, from 0,
    at the start: theory (3.14)."""
    found = scene.model.report()
    count = sum(port["of_slaves"] for port in found["ports"])
    columns = []
    for k in range(6):
        load = np.zeros((2, count, 3))
        load[k // 3, which, k % 3] = 1.0
        columns.append(scene.model.spread_port_loads(*load))
    spread = np.moveaxis(np.array(columns), 0, -1)  # (force and moment, slave, 3, 6)
    return {
        (slave, key): spread[n, row]
        for n, key in enumerate("ft")
        for row, slave in enumerate(found["slaves"]["id"].tolist())
        if spread[n, row].any()
    }


def skew(d: np.ndarray) -> np.ndarray:
    """[d] u = d x u."""
    return np.array([[0, -d[2], d[1]], [d[2], 0, -d[0]], [-d[1], d[0], 0]])


def rigid(scene: Scene, nodes: list[int], rotating: list[bool]) -> np.ndarray:
    """Motions of single nodes from those of the host's bodies, (freedoms, bodies' freedoms), at the start: a node alone
    is a body of its own, those of a port are one. Rows: three translations a node of `nodes`, then three rotations of
    those that are `rotating`."""
    found = scene.model.report()
    place = dict(zip(found["nodes"]["id"].tolist(), found["nodes"]["position"]))
    owner = {node: port for port in found["ports"] if not port["of_slaves"] for node in port["ids"].tolist()}
    turns = [node for node, turning in zip(nodes, rotating) if turning]
    row = {("v", node): 3 * k for k, node in enumerate(nodes)}
    row |= {("w", node): 3 * (len(nodes) + k) for k, node in enumerate(turns)}
    columns = []
    for key in [("v", node) for node in nodes if node not in owner] + [("w", node) for node in turns]:
        if key[1] in owner:
            continue
        block = np.zeros((3 * len(row), 3))
        block[row[key] : row[key] + 3] = np.eye(3)
        columns.append(block)
    for port in found["ports"]:
        block = np.zeros((3 * len(row), 6))
        for node in port["ids"].tolist() if not port["of_slaves"] else []:
            if ("v", node) not in row:
                continue
            block[row["v", node] : row["v", node] + 3] = np.hstack(
                [np.eye(3), -skew(place[node] - np.array(port["at"]))]
            )
            if ("w", node) in row:
                block[row["w", node] : row["w", node] + 3, 3:] = np.eye(3)
        if block.any():
            columns.append(block)
    return np.hstack(columns)
