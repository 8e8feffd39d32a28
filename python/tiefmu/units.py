"""Units of a scene file. Everything behind this module is in m, kg, s, N, rad."""

from fractions import Fraction
from typing import Any

import numpy as np

LENGTHS = {
    "m": Fraction(1),
    "cm": Fraction(1, 100),
    "mm": Fraction(1, 1000),
    "um": Fraction(1, 10**6),
    "km": Fraction(1000),
    "in": Fraction(254, 10000),
    "ft": Fraction(3048, 10000),
}
MASSES = {
    "kg": Fraction(1),
    "g": Fraction(1, 1000),
    "mg": Fraction(1, 10**6),
    "t": Fraction(1000),
    "lb": Fraction(45359237, 10**8),
}
TIMES = {"s": Fraction(1), "ms": Fraction(1, 1000), "us": Fraction(1, 10**6), "min": Fraction(60)}

# What a key of the scene file measures: powers of length, mass and time. Angles are always in rad.
DIMENSIONS = {
    "position": (1, 0, 0),
    "search_distance": (1, 0, 0),
    "time_step": (0, 0, 1),
    "mass": (0, 1, 0),
    "inertia": (2, 1, 0),
    "stiffness": (0, 1, -2),
    "rotational_stiffness": (2, 1, -2),
    "damping": (0, 1, -1),
    "rotational_damping": (2, 1, -1),
    "v": (1, 0, -1),
    "w": (0, 0, -1),
    "gravity": (1, 0, -2),
}


class Units:
    """The units of one scene file, by their names in LENGTHS, MASSES and TIMES."""

    def __init__(self, length: str = "m", mass: str = "kg", time: str = "s"):
        self.length, self.mass = length, mass  # names, for messages
        self._base = LENGTHS[length], MASSES[mass], TIMES[time]

    @classmethod
    def of(cls, table: Any) -> "Units":
        """Those of a scene's [units]."""
        return cls(table.length, table.mass, table.time)

    def si(self, key: str, value):
        """`value` (number or array) of the quantity `key` in SI, as a NumPy value of the same shape."""
        factor = Fraction(1)
        for unit, power in zip(self._base, DIMENSIONS[key]):
            factor *= unit**power
        # Numerator and denominator apart: dividing by 1000 is correctly rounded, multiplying by 0.001 is not, and
        # so 30 mm is the same double as 0.03 m.
        return np.asarray(value, dtype=float) * float(factor.numerator) / float(factor.denominator)
