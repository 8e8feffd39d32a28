"""The host of examples/host_and_tie as a PythonFMU: four masses on ground springs and dampers, central differences.

The same numbers and the same order of kick, drift and force as the scene host.toml, written independently of it.
"""

from pythonfmu import Fmi2Causality, Fmi2Slave, Real

NODES = 12  # four nodes, three axes each
MASS = 2.708  # kg
STIFFNESS = [9e3, 8e3, 1.2e4]  # N/m along x, y, z
DAMPING = 6.0  # N s/m


class SprungHost(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.force, self.speed, self.place = [0.0] * NODES, [0.0] * NODES, [0.0] * NODES
        self.damped = [
            0.0
        ] * NODES  # velocity that the dampers see: that of the step's end as the last force foretells it
        for k in range(NODES):
            index = f"[{k // 3 + 1}].%s[{k % 3 + 1}]"
            self.register_variable(
                Real(
                    "master" + index % "f_ext",
                    causality=Fmi2Causality.input,
                    start=0.0,
                    getter=lambda k=k: self.force[k],
                    setter=lambda value, k=k: self.force.__setitem__(k, value),
                ),
                nested=False,
            )
            self.register_variable(
                Real("master" + index % "v", causality=Fmi2Causality.output, getter=lambda k=k: self.speed[k]),
                nested=False,
            )

    def accelerate(self, k):
        return (self.force[k] - STIFFNESS[k % 3] * self.place[k] - DAMPING * self.damped[k]) / MASS

    def do_step(self, current_time, step_size):
        for k in range(NODES):
            kick = 0.5 * step_size * self.accelerate(k)
            self.speed[k] += kick
            self.place[k] += step_size * self.speed[k]
            self.damped[k] = self.speed[k] + kick  # theory (6.4) at beta = 1: the step is far below the limit
            self.speed[k] += 0.5 * step_size * self.accelerate(k)
        return True
