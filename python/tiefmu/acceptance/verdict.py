"""What becomes of a criterion."""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Curve:
    """Something over time for the picture."""

    label: str
    time: np.ndarray
    values: np.ndarray


@dataclass
class Verdict:
    """What became of a criterion.

    value: the number that is judged; asked: what it should be, in words; unit: of value and limits; where: what else
    the table says. For the picture: curves, corridor (time, lowest, highest), limits (horizontal lines), bars
    (label, value).
    """

    name: str
    kind: str
    value: float
    passed: bool
    asked: str
    unit: str = ""
    where: str = ""
    axis: str = ""
    curves: list[Curve] = field(default_factory=list)
    corridor: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
    limits: list[float] = field(default_factory=list)
    bars: list[tuple[str, float]] = field(default_factory=list)
