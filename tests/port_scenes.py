"""Scenes with ports and the same scenes without, whose nodes are then moved or loaded one by one."""

import copy

import numpy as np
import tiefmu
from fmu_scenes import scene as many_sided
from scipy.spatial.transform import Rotation
from tiefmu.scene import plain

XYZ = (1, 2, 3)
# Driven masters of three of the four segments of fmu_scenes in one port and a driven point in another; slaves in a
# third, and one slave alone in a fourth.
PORTS = [
    {"name": "base", "nodes": [1, 2, 3, 4, 5, 6], "at": [0.3, -0.2, 0.4]},
    {"name": "arm", "nodes": [201]},
    {"name": "load", "nodes": [101, 102, 104], "at": [0.1, 0.7, 0.2]},
    {"name": "tip", "nodes": [105]},
]


def ported(rng, settings, ports=None, motions="driven") -> dict:
    """The scene of fmu_scenes with ports; `motions`: of its masters 7 to 10, which belong to none."""
    formulation, rotations, inertia, reaction, geometry = settings
    made = many_sided(rng, formulation, rotations, "driven", inertia, reaction, geometry, "integrated")
    turns = rotations or formulation == "optimized"
    chosen = {"mixed": ["free", "driven", "fixed", "free"]}.get(motions, [motions] * 4)
    for table, motion in zip(made["node"][6:10], chosen):
        table["motion"] = motion
    ports = copy.deepcopy(PORTS if ports is None else ports)
    if not turns:
        ports = [port for port in ports if port["name"] != "tip"]  # a slave alone needs its own rotation
    made["interface"]["ports"] = ports
    made["interface"]["expose"].append("port.r")
    made["initial"] = [{"nodes": [202], "v": rng.normal(size=3).tolist()}]
    return plain(made)


def single(made: dict) -> dict:
    """The same without ports."""
    made = copy.deepcopy(made)
    del made["interface"]["ports"]
    return made


class Pair:
    """A scene with ports in `ports`, and the same without in `nodes`."""

    def __init__(self, made: dict):
        self.made = made
        self.ports, self.nodes = (tiefmu.load(scene).simulation() for scene in (made, single(made)))
        report = tiefmu.report(tiefmu.load(single(made)))
        self.name = {
            row["id"]: f"{what}[{row['number']}]" for what in ("master", "slave", "point") for row in report[f"{what}s"]
        }
        self.start = {row[0]: np.array(row[1:]) for row in made["mesh"]["nodes"]}
        self.port = {row["name"]: row for row in tiefmu.report(tiefmu.load(made))["ports"]}
        self.known = {name for block in self.nodes.variables for name in names(block)}
        self.turned = {name: np.eye(3) for name in self.port}

    def arm(self, port: str, node: int) -> np.ndarray:
        return self.turned[port] @ (self.start[node] - self.port[port]["at"])

    def drive(self, port: str, v, w, a=None, z=None, finite=True):
        """Sets the port, and each of its nodes as the port moves it."""
        vector(self.ports, f"port[{port}].v", v), vector(self.ports, f"port[{port}].w", w)
        if a is not None:
            vector(self.ports, f"port[{port}].a", a), vector(self.ports, f"port[{port}].z", z)
        for node in self.port[port]["nodes"]:
            r, name = self.arm(port, node), self.name[node]
            values = {"v": v + np.cross(w, r), "w": w}
            if a is not None:
                values |= {"a": a + np.cross(z, r) + (np.cross(w, np.cross(w, r)) if finite else 0), "z": z}
            for key, value in values.items():
                if f"{name}.{key}[1]" in self.known:
                    vector(self.nodes, f"{name}.{key}", value)

    def both(self, name: str, value):
        for simulation in (self.ports, self.nodes):
            vector(simulation, name, value)

    def initialise(self):
        self.ports.initialise(0.0), self.nodes.initialise(0.0)

    def of(self, node: int, key: str) -> np.ndarray:
        """From the scene without ports; zero where it has no such variable."""
        name = f"{self.name[node]}.{key}"
        return vector(self.nodes, name) if f"{name}[1]" in self.known else np.zeros(3)


def names(block: dict) -> list[str]:
    ends = [f"[{k}]" for k in XYZ] if block["components"] == 3 else [""]
    if not block["prefix"]:
        return [block["name"]]
    short = block["name"].removeprefix(block["prefix"] + ".")
    return [
        f"{block['prefix']}[{place}].{short}{end}"
        for place in block["labels"] or block["numbers"].tolist()
        for end in ends
    ]


def vector(simulation, name: str, value=None):
    components = [f"{name}[{k}]" for k in XYZ]
    if value is None:
        return simulation.get_values(components)
    simulation.set_values(components, np.asarray(value, float))


def exponential(turn) -> np.ndarray:
    return Rotation.from_rotvec(turn).as_matrix()


def line_of_slaves(turning: bool, at=None, nodes=(101, 102, 103)) -> dict:
    """Three slaves on a line along x over a quad, each alone free to be turned by its masters."""
    port = {"name": "rod", "nodes": list(nodes)} | ({"at": at} if at else {})
    return {
        "mesh": {
            "nodes": [
                [1, 0, 0, 0],
                [2, 3, 0, 0],
                [3, 3, 1, 0],
                [4, 0, 1, 0],
                [101, 0.5, 0.5, 0.2],
                [102, 1.1, 0.5, 0.2],
                [103, 2.4, 0.5, 0.2],
            ],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "rotations": turning, "mass": 1.0}],
        "tie": [{"name": "tie", "slaves": [101, 102, 103], "search_distance": 1.0}],
        "interface": {"ports": [port], "expose": ["slave.r", "port.r", "power_residual"]},
    }
