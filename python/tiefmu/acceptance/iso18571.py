"""Ratings by ISO/TS 18571, of the package objective-rating-metrics."""

import numpy as np

from ..results import needed

RATE = 10_000  # Hz, which the specification asks for


def ratings(time: np.ndarray, reference: np.ndarray, values: np.ndarray, what: str) -> dict[str, float]:
    """Of curves at RATE: corridor, phase, magnitude, slope, overall; 0 to 1. Curves that are equal are rated 1, as are
    slopes and phases of constant ones. Raises UsageError where the package is missing."""
    needed("objective_rating_metrics", "rating", what)
    from objective_rating_metrics.rating import ISO18571

    if np.array_equal(reference, values):
        return dict.fromkeys(("corridor", "phase", "magnitude", "slope", "overall"), 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        rated = ISO18571(np.column_stack([time, reference]), np.column_stack([time, values]), dt=1 / RATE)
        grades = {
            name: float(getattr(rated, f"{name}_rating")(ndigits=-1))
            for name in ("corridor", "phase", "magnitude", "slope", "overall")
        }
    return {name: grade if np.isfinite(grade) else 0.0 for name, grade in grades.items()}
