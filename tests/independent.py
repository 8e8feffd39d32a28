"""The tie once more, from docs/theory.md alone: dense, slow and short. Shares no code with the project.

`Problem` assembles a scene given as the dict of a TOML file (inline mesh, SI, sets by ids or "all") from the kernels of
independent_kernels.py and `Problem.solve` integrates it to rounding. Degrees of freedom are ordered (v, w) node by
node, six per node; nodes without rotation have zero columns there.
"""

import numpy as np
from independent_kernels import (
    Spring,
    default_bias,
    default_map,
    default_search_distance,
    find,
    lumped,
    mean_inertia,
    optimized_bias,
    optimized_map,
    quaternion_rate,
    rotation_matrix,
)
from scipy.integrate import solve_ivp
from scipy.linalg import eigh


class Slave:
    pass


def constant(inputs: dict) -> dict:
    """Inputs of a Problem that do not change over time."""

    def held(value):
        value = np.array(value)
        return lambda t: value

    return {key: held(value) for key, value in inputs.items()}


def pick(which, everything) -> list:
    return list(everything) if which == "all" else list(which)


class Problem:
    """A scene ready to compute. Nodes (masters and points) and slaves stand in the order of ascending id."""

    def __init__(self, scene):
        self.model = {"inertia": "lumped", "reaction": "loads", "geometry": "finite", "gravity": [0, 0, 0]}
        self.model |= scene.get("model", {})
        self.gravity = np.asarray(self.model["gravity"], float)
        where = {row[0]: np.array(row[1:], float) for row in scene["mesh"]["nodes"]}
        about = {i: {} for i in where}
        for table in scene.get("node", []):
            for i in pick(table["nodes"], where):
                about[i] |= {k: v for k, v in table.items() if k != "nodes"}
        segment_nodes = {row[0]: list(row[1:]) for row in scene["mesh"].get("segments", [])}

        found = []  # (slave id, tie, corner ids, projection)
        for tie in scene.get("tie", []):
            segment_ids = sorted(pick(tie["segments"], segment_nodes))
            ids = sorted({n for e in segment_ids for n in segment_nodes[e]})
            index = {n: k for k, n in enumerate(ids)}
            position = np.array([where[n] for n in ids])
            segments = [tuple(index[n] for n in segment_nodes[e]) for e in segment_ids]
            method = tie.get("search", "box")
            reach = tie.get("search_distance", 0) or default_search_distance(position, segments, method)
            points = np.array([where[i] for i in tie["slaves"]])
            winners = find(position, segments, segment_ids, points, tie.get("search", "box"), reach)
            for i, (e, p) in zip(tie["slaves"], winners):
                if e is None:
                    raise ValueError(f"slave {i} not found")
                found.append((i, tie, segment_nodes[segment_ids[e]], segment_ids[e], p))
        found.sort(key=lambda f: f[0])
        slave_ids = [f[0] for f in found]
        self.masters = sorted({n for f in found for n in f[2]})
        held = set(self.masters)
        for spring in scene.get("spring", []):
            held |= set(spring.get("nodes", [])) | set(spring.get("ground", []))
        self.ids = sorted(held - set(slave_ids))
        self.index = {i: k for k, i in enumerate(self.ids)}

        def number(key, ids):
            return np.array([float(about[i].get(key, 0)) for i in ids])

        self.x0 = np.array([where[i] for i in self.ids]).reshape(-1, 3)
        self.mass, self.inertia = number("mass", self.ids), number("inertia", self.ids)
        self.rotating = np.array([bool(about[i].get("rotations", False)) for i in self.ids])
        self.motion = np.array([about[i].get("motion", "driven") for i in self.ids])
        self.v0, self.w0 = np.zeros_like(self.x0), np.zeros_like(self.x0)
        for table in scene.get("initial", []):
            for i in set(pick(table["nodes"], self.ids)) & set(self.ids):
                self.v0[self.index[i]] = table.get("v", [0, 0, 0])
                self.w0[self.index[i]] = table.get("w", [0, 0, 0])
        self.slaves = [self._slave(f, about[f[0]], where[f[0]]) for f in found]
        self.slave_index = {i: k for k, i in enumerate(slave_ids)}
        self.springs = []
        for table in scene.get("spring", []):
            pairs = [tuple(table["nodes"])] if "nodes" in table else [(i, None) for i in table["ground"]]
            for a, b in pairs:
                xb = where[a] if b is None else where[b]
                self.springs.append(Spring(table, self._end(a), self._end(b), where[a], xb))
        self.free = np.zeros((len(self.ids), 6), bool)
        self.free[self.motion == "free", :3] = True
        self.free[(self.motion == "free") & self.rotating, 3:] = True
        self.free = self.free.ravel()

    def _end(self, i):
        if i is None:
            return None
        return ("slave", self.slave_index[i]) if i in self.slave_index else ("node", self.index[i])

    def _slave(self, found, about, x):
        s = Slave()
        s.id, tie, corner_ids, s.segment, s.projection = found
        s.nodes = [self.index[n] for n in corner_ids]
        s.optimized = tie.get("formulation", "default") == "optimized"
        corners = self.x0[s.nodes]
        s.d0 = x - (corners.mean(axis=0) if s.optimized else s.projection.point)
        s.phi = s.projection.phi
        s.turns = s.optimized or bool(np.all(self.rotating[s.nodes]))
        s.mass, s.inertia = float(about.get("mass", 0)), float(about.get("inertia", 0))
        s.frozen = mean_inertia(corners)
        s.added = lumped(corners, s.projection, np.linalg.norm(s.d0), s.optimized, s.mass, s.inertia)
        if not s.turns:
            s.added[:, 1] = 0
        return s

    def added(self):
        """D: added (mass, inertia) per node, (N, 2)."""
        total = np.zeros((len(self.ids), 2))
        for s in self.slaves:
            np.add.at(total, s.nodes, s.added)
        return total

    # -- kinematics

    def maps(self, x, v, w, offsets):
        """T (6 S, 6 N) and b (6 S,) for offsets d (S, 3)."""
        small = self.model["geometry"] == "small"
        total, bias = np.zeros((6 * len(self.slaves), 6 * len(self.ids))), np.zeros(6 * len(self.slaves))
        for k, s in enumerate(self.slaves):
            corners = self.x0[s.nodes] if small else x[s.nodes]
            rows, d = slice(6 * k, 6 * k + 6), offsets[k]
            if s.optimized:
                t = optimized_map(corners, d)
                b = optimized_bias(corners, v[s.nodes], d)
            else:
                t = default_map(s.phi, d, s.turns)
                b = default_bias(s.phi, w[s.nodes], d) if s.turns else np.zeros(6)
            for c, n in enumerate(s.nodes):
                total[rows, 6 * n : 6 * n + 6] += t[:, 6 * c : 6 * c + 6]
            bias[rows] = 0 if small else b
        return total, bias

    def slave_masses(self):
        return np.concatenate([[s.mass] * 3 + [s.inertia if s.turns else 0.0] * 3 for s in self.slaves] or [[]])

    def node_masses(self):
        return np.column_stack([self.mass] * 3 + [np.where(self.rotating, self.inertia, 0)] * 3).ravel()

    def added_masses(self):
        d = self.added()
        return np.column_stack([d[:, :1]] * 3 + [d[:, 1:]] * 3).ravel()

    def mass_matrix(self, t):
        if self.model["inertia"] == "lumped":
            return np.diag(self.node_masses() + self.added_masses())
        return np.diag(self.node_masses()) + t.T @ (self.slave_masses()[:, None] * t)

    # -- one instant

    def unpack(self, y):
        """x, v, w (N, 3), node and slave quaternions, slave positions or None (small geometry integrates them)."""
        n, s = len(self.ids), len(self.slaves)
        cuts = np.cumsum([3 * n, 3 * n, 3 * n, 4 * n, 4 * s])
        x, v, w, qn, qs, xs = np.split(y, cuts)
        return (
            x.reshape(-1, 3),
            v.reshape(-1, 3),
            w.reshape(-1, 3),
            qn.reshape(-1, 4),
            qs.reshape(-1, 4),
            xs.reshape(-1, 3),
        )

    def start(self):
        one = np.array([1.0, 0, 0, 0])
        n, s = len(self.ids), len(self.slaves)
        _, xs = self.offsets(self.x0, np.tile(one, (s, 1)), None)
        y = [self.x0.ravel(), self.v0.ravel(), self.w0.ravel(), np.tile(one, n), np.tile(one, s)]
        return np.concatenate(y + ([xs.ravel()] if self.model["geometry"] == "small" else []))

    def offsets(self, x, qs, xs):
        """d and slave positions, (S, 3) each."""
        d, place = np.zeros((len(self.slaves), 3)), np.zeros((len(self.slaves), 3))
        for k, s in enumerate(self.slaves):
            turned = s.turns and self.model["geometry"] == "finite"
            d[k] = rotation_matrix(qs[k]) @ s.d0 if turned else s.d0
            place[k] = d[k] + (x[s.nodes].mean(axis=0) if s.optimized else s.phi @ x[s.nodes])
        if xs is not None and len(xs):
            place = xs
        return d, place

    def evaluate(self, t, y, inputs=None):
        """Everything at one instant, as a dict. inputs: {("f", "t", "v", "w", "a" or "z", node id): function of t}."""
        inputs = inputs or {}
        x, v, w, qn, qs, xs = self.unpack(y)
        v, w, acc = v.copy(), w.copy(), np.zeros((len(self.ids), 6))
        node_load, slave_load = np.zeros((len(self.ids), 6)), np.zeros((len(self.slaves), 6))
        for (kind, i), value in inputs.items():
            value = value(t)
            if kind in "ft":
                load, k = (slave_load, self.slave_index[i]) if i in self.slave_index else (node_load, self.index[i])
                load[k, :3] += value if kind == "f" else 0
                load[k, 3:] += value if kind == "t" else 0
            else:
                target = {"v": v, "w": w, "a": acc[:, :3], "z": acc[:, 3:]}[kind]
                target[self.index[i]] = value
        d, place = self.offsets(x, qs, xs)
        tmap, bias = self.maps(x, v, w, d)
        twist = (tmap @ np.hstack([v, w]).ravel()).reshape(-1, 6)
        outside = np.sum(node_load * np.hstack([v, w])) + np.sum(slave_load * twist)
        outside += self.mass * (self.motion == "free") @ (v @ self.gravity)
        outside += sum(s.mass * self.gravity @ u[:3] for s, u in zip(self.slaves, twist))
        strain = dissipation = 0.0
        one = np.array([1.0, 0, 0, 0])
        state = {"node": (x, v, qn, w, node_load), "slave": (place, twist[:, :3], qs, twist[:, 3:], slave_load)}
        for spring in self.springs:
            ends = []
            for end in (spring.a, spring.b):
                if end is None:
                    ends.append((spring.anchor, np.zeros(3), one, np.zeros(3)))
                else:
                    ends.append(tuple(part[end[1]] for part in state[end[0]][:4]))
            (x1, v1, q1, w1), (x2, v2, q2, w2) = ends
            on_a, on_b, energy, power = spring.load(x1, x2, v1, v2, q1, q2, w1, w2)
            strain, dissipation = strain + energy, dissipation + power
            for end, load in ((spring.a, on_a), (spring.b, on_b)):
                if end is not None:
                    state[end[0]][4][end[1]] += load
        for k, s in enumerate(self.slaves):
            slave_load[k, :3] += s.mass * self.gravity
        own = node_load.copy()
        own[:, :3] += self.mass[:, None] * self.gravity
        consistent = self.model["inertia"] == "consistent"
        m = self.mass_matrix(tmap)
        ms = self.slave_masses()
        right = own.ravel() + tmap.T @ (slave_load.ravel() - (ms * bias if consistent else 0))
        a, free = acc.ravel(), self.free
        if free.any():
            a[free] = np.linalg.solve(m[np.ix_(free, free)], (right - m[:, ~free] @ a[~free])[free])
        loads = tmap.T @ slave_load.ravel()
        inertial = tmap.T @ (ms * (tmap @ a + bias)) if consistent else self.added_masses() * a
        full = loads - inertial
        # the true energy, with the slaves' own; lumped inertia conserves another one
        moving = self.node_masses() * np.repeat(self.motion == "free", 6)
        kinetic = 0.5 * (moving @ np.hstack([v, w]).ravel() ** 2 + ms @ twist.ravel() ** 2)
        reaction = {"loads": loads, "full": full, "split": full + self.added_masses() * a}
        return {
            "x": x,
            "v": v,
            "w": w,
            "a": a.reshape(-1, 6),
            "slave_x": place,
            "slave_v": twist[:, :3],
            "slave_w": twist[:, 3:],
            "slave_a": (tmap @ a + bias).reshape(-1, 6),
            "d": d,
            "T": tmap,
            "b": bias,
            "reaction": {k: r.reshape(-1, 6) for k, r in reaction.items()},
            "kinetic": kinetic,
            "strain": strain,
            "dissipation": dissipation,
            "external": outside,
        }

    def rate(self, t, y, inputs):
        now = self.evaluate(t, y, inputs)
        _, _, _, qn, qs, _ = self.unpack(y)
        a = np.where(self.free, now["a"].ravel(), 0).reshape(-1, 6)
        parts = [now["v"].ravel(), a[:, :3].ravel(), a[:, 3:].ravel()]
        parts += [quaternion_rate(q, w) for q, w in zip(qn, now["w"])]
        parts += [quaternion_rate(q, w) for q, w in zip(qs, now["slave_w"])]
        if self.model["geometry"] == "small":
            parts.append(now["slave_v"].ravel())
        return np.concatenate(parts)

    def solve(self, times, inputs=None, rtol=1e-12, atol=1e-15):
        """List of `evaluate` dicts at the times, integrated from times[0] by DOP853."""
        answer = solve_ivp(
            self.rate,
            (times[0], times[-1]),
            self.start(),
            method="DOP853",
            t_eval=times,
            rtol=rtol,
            atol=atol,
            args=(inputs,),
        )
        assert answer.success, answer.message
        return [self.evaluate(t, y, inputs) for t, y in zip(times, answer.y.T)]

    # -- stability (theory 6)

    def omega_max(self):
        """rad/s: the highest frequency of the free nodes at the start."""
        t, _ = self.maps(self.x0, 0 * self.x0, 0 * self.x0, np.array([s.d0 for s in self.slaves]).reshape(-1, 3))
        n = 6 * len(self.ids)
        everything = np.vstack([np.eye(n), t])  # nodes, then slaves
        stiffness = np.zeros((n, n))
        for spring in self.springs:
            rows = []
            for end in (spring.a, spring.b):
                first = None if end is None else 6 * end[1] + (n if end[0] == "slave" else 0)
                rows.append(np.zeros((6, n)) if first is None else everything[first : first + 6])
            strain, k = spring.strain_map()
            strain = strain @ np.vstack(rows)
            stiffness += strain.T @ (k[:, None] * strain)
        pick = np.ix_(self.free, self.free)
        return np.sqrt(eigh(stiffness[pick], self.mass_matrix(t)[pick], eigvals_only=True)[-1])
