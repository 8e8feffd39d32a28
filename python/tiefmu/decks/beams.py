"""Stiffness of a straight beam of equal sections at its middle, where its flexibility is diagonal: theory (3.19).

Values of a Property that is a beam: area; iyy, izz, ixx: moments of area about its second and third axis, and of
torsion; shear_area (5/6 of the area where it is not given, 0: no shear deformation); one_point: the element has one
integration point along its length, so that it shears only.
"""

import numpy as np

from .model import Material


def beam_stiffness(values: dict, material: Material, length: float) -> tuple[np.ndarray, np.ndarray]:
    """(along the axes of the beam, about them): N/m and N m/rad in the deck's units."""
    young, shear = material.young, material.young / (2 * (1 + material.poisson))
    area, bending = values["area"], np.array([values["izz"], values["iyy"]])  # of shear along the second, third axis
    shear_area = values.get("shear_area", 5 / 6 * area)
    if values.get("one_point"):
        aside = np.full(2, shear * shear_area / length)
    else:
        flexibility = length**3 / (12 * young * np.maximum(bending, 1e-300))
        if shear_area > 0:
            flexibility = flexibility + length / (shear * shear_area)
        aside = 1 / flexibility
    turning = np.array([shear * values["ixx"], young * values["iyy"], young * values["izz"]]) / length
    return np.array([young * area / length, *aside]), turning
