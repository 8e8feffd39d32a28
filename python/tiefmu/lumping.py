"""How far the inertia that accelerates free masters is from the true one where it is lumped."""

import numpy as np

LOOKS = 200  # segments whose ratio is computed: those where the bound below, 1 + lumped over own, is largest
FREE = 1  # report()["nodes"]["motion"]


def lumping(found: dict) -> dict | None:
    """{"ratio", "segment", "connected"}: the largest ratio of lumped to true kinetic energy over the motions of a
    segment's free masters (and of all masters, as both energies are sums over segments; None: some motion has no true
    energy), and whether segments share free masters. No dict: no master is free. `found`: Model.report()."""
    nodes, slaves = found["nodes"], found["slaves"]
    order = np.argsort(nodes["id"], kind="stable")
    node = order[np.searchsorted(nodes["id"][order], np.where(slaves["nodes"] > 0, slaves["nodes"], nodes["id"][0]))]
    corner = np.arange(4) < slaves["corners"][:, None]
    free = corner & (nodes["motion"][node] == FREE)
    if not free.any():
        return None
    added = {}
    for key in ("mass", "inertia"):
        total = np.bincount(node[corner], slaves[f"added_{key}"][corner], len(nodes["id"]))[node]
        part = slaves[f"added_{key}"]
        added[key] = np.divide(part, total, out=np.zeros_like(part), where=total > 0)  # of the node's own
    rows = np.lexsort((slaves["segment"], slaves["tie"]))
    change = np.flatnonzero(np.diff(slaves["segment"][rows]) | np.diff(slaves["tie"][rows])) + 1
    segments = [run for run in np.split(rows, change) if free[run[0]].any()]
    bounds = []
    for run in segments:
        worst = 1.0
        for key in ("mass", "inertia"):
            own = (added[key][run] * nodes[key][node[run]]).sum(axis=0)
            lumped = slaves[f"added_{key}"][run].sum(axis=0)
            held = free[run[0]] & (lumped > 0)
            worst = max(worst, np.max((lumped[held] / np.maximum(own[held], 1e-300)), initial=0) + 1)
        bounds.append(worst)
    best = {"ratio": 0.0, "segment": 0, "connected": connected(slaves, node, free)}
    for k in np.argsort(bounds, kind="stable")[::-1][:LOOKS]:
        if bounds[k] <= best["ratio"]:
            break
        ratio = of_segment(found, segments[k], node[segments[k][0]], free[segments[k][0]], added)
        if ratio > best["ratio"]:
            best |= {"ratio": ratio, "segment": int(slaves["segment"][segments[k][0]])}
    if best["ratio"] <= 1:  # slaves without mass
        return None
    return best | {"ratio": float(f"{best['ratio']:.6g}") if np.isfinite(best["ratio"]) else None}


def line(row: dict) -> str:
    price = "two to ten times" if row["connected"] else "one to four times"
    ratio = (
        "motions without any true energy" if row["ratio"] is None else f"up to {row['ratio']:.3g} times the true one"
    )
    return (
        f"lumped inertia: kinetic energy of the free masters {ratio} (segment {row['segment']}); "
        f'[model] inertia = "consistent" is exact, for {price} the time of a step'
    )


def connected(slaves: dict, node: np.ndarray, free: np.ndarray) -> bool:
    pairs = np.column_stack([node[free], np.broadcast_to(slaves["segment"][:, None], free.shape)[free]])
    return bool(np.unique(np.unique(pairs, axis=0)[:, 0], return_counts=True)[1].max() > 1)


def of_segment(found: dict, run: np.ndarray, node: np.ndarray, free: np.ndarray, added: dict) -> float:
    """Largest eigenvalue of (own + lumped) against (own + T^T M T), theory (4.1), (4.2), (4.4); own: the share of the
    masters' own mass that the segment has of what is lumped onto them."""
    nodes, slaves = found["nodes"], found["slaves"]
    n = int(slaves["corners"][run[0]])
    node, free = node[:n], free[:n]
    coupling = found["couplings"][slaves["coupling"][run[0]]]
    arms = nodes["position"][node] - nodes["position"][node].mean(axis=0)
    own, lumped, true = np.zeros(6 * n), np.zeros(6 * n), np.zeros((6 * n, 6 * n))
    if coupling == "mean-motion":
        ibar = sum(r @ r * np.eye(3) - np.outer(r, r) for r in arms)
        spins = [np.linalg.solve(ibar, skew(r)) for r in arms]
    for s in run:
        t = np.zeros((6, 6 * n))
        d = skew(slaves["offset"][s])
        for i in range(n):
            v, w = slice(6 * i, 6 * i + 3), slice(6 * i + 3, 6 * i + 6)
            if coupling == "mean-motion":
                t[:3, v], t[3:, v] = np.eye(3) / n - d @ spins[i], spins[i]
            else:
                t[:3, v] = slaves["weights"][s, i] * np.eye(3)
                if coupling == "rotation":
                    t[:3, w], t[3:, w] = -slaves["weights"][s, i] * d, slaves["weights"][s, i] * np.eye(3)
            for key, k in (("mass", v), ("inertia", w)):
                lumped[k] += slaves[f"added_{key}"][s, i]
                own[k] += added[key][s, i] * nodes[key][node[i]]
        inertia = np.repeat([slaves["mass"][s], slaves["inertia"][s]], 3)
        true += t.T @ (inertia[:, None] * t)
    moves = np.repeat(free, 6) & (lumped > 0)
    if not moves.any():
        return 1.0
    true = true[np.ix_(moves, moves)] + np.diag(own[moves])
    # Scaled to lumped = 1: the smallest eigenvalue of what is true then says it.
    scale = 1 / np.sqrt((own + lumped)[moves])
    smallest = np.linalg.eigvalsh(scale[:, None] * true * scale)[0]
    return float(1 / smallest) if smallest > 1e-12 else float("inf")


def skew(r: np.ndarray) -> np.ndarray:
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
