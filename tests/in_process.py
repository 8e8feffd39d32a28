"""A scene run by the solver in this process; variables by FMU names without the component: run["slave[1].v"]."""

import numpy as np
import tiefmu

EXPOSED = ["slave.r", "slave.a", "master.r", "point.r", "energy", "power_residual", "drift", "master.stiffness"]


class Run:
    """scene: a dict; everything that can be exposed is. `names` gives the variable's prefix of a node id."""

    def __init__(self, scene, start=0.0, inputs=None):
        self.scene = tiefmu.load(scene | {"interface": {"expose": EXPOSED}})
        self.simulation = self.scene.simulation()
        self.components, self.names = {}, {}
        for block in self.simulation.variables:
            short = block["name"].removeprefix(block["prefix"] + ".")
            for number, node in zip(block["numbers"], block["ids"]):
                prefix = f"{block['prefix']}[{number}]" if block["prefix"] else ""
                self.names[int(node)] = prefix
                name = f"{prefix}.{short}" if prefix else short
                self.components[name] = [f"{name}[{k}]" for k in (1, 2, 3)] if block["components"] == 3 else [name]
        self.set(inputs or {})
        self.simulation.initialise(start)

    def __contains__(self, name):
        return name in self.components

    def __getitem__(self, name):
        values = self.simulation.get_values(self.components[name])
        return values if len(values) > 1 else values[0]

    def of(self, node, name):
        """A vector of the node with this id, or zero where it has no such variable."""
        name = f"{self.names[node]}.{name}"
        return self[name] if name in self else np.zeros(3)

    def set(self, values):
        """{name: vector or number}"""
        for name, value in values.items():
            self.simulation.set_values(self.components[name], np.atleast_1d(np.asarray(value, float)))

    def set_of(self, node, name, value):
        self.set({f"{self.names[node]}.{name}": value})

    def step(self, duration, count=1):
        for _ in range(count):
            self.simulation.step(duration)
