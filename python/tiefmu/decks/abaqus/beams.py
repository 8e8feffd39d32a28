"""Sections of beams: area and moments of area."""

from collections.abc import Callable

import numpy as np

from ...mesh.abaqus_cards import Block
from ..model import Material

PI = np.pi


def positive(block: Block, values: list[float], place: int, what: str) -> float:
    if len(values) <= place or not 0 < values[place] < np.inf:
        block.fail(f"expected its {what}" + (f", found {values[place]:g}" if len(values) > place else ""), 0)
    return values[place]


def read(sections, block: Block) -> tuple[dict, int]:
    """(values of the property, the material's id)."""
    values = block.data()
    if block.key == "BEAMGENERALSECTION":
        return general(sections, block, values)
    shape = block.get("SECTION").upper().replace(" ", "")
    material = sections.material(block, block.get("MATERIAL"))
    if shape not in SHAPES:
        sections.deck.warn(
            f"{block.where}: SECTION = {shape or 'none'} is not read; its elements have no mass and no stiffness"
        )
        return nothing(), 0
    area, i11, i22, j = by_sizes(block, shape, values)
    return {"area": area, "iyy": i11, "izz": i22, "ixx": j, "second_axis": first_direction(block)}, material


def first_direction(block: Block) -> np.ndarray:
    """n1, about which I11 counts; default -z."""
    given = np.array((block.data(1) + [0.0] * 3)[:3])
    given[~np.isfinite(given)] = 0.0
    return given if given.any() else np.array([0.0, 0.0, -1.0])


def by_sizes(block: Block, shape: str, values: list[float]) -> tuple[float, float, float, float]:
    """Area, I11, I22 and J of a shape by its sizes; an empty name of a size: it does not count."""
    names, function = SHAPES[shape]
    sizes = [positive(block, values, place, what) if what else 0.0 for place, what in enumerate(names)]
    area, i11, i22, j = function(*sizes)
    if not (area > 0 and min(i11, i22) > 0):
        block.fail(f"its {shape} section has no area", 0)
    return area, i11, i22, j


def nothing() -> dict:
    return {"area": 0.0, "iyy": 0.0, "izz": 0.0, "ixx": 0.0}


def rectangle(a, b):
    long, short = max(a, b), min(a, b)
    torsion = long * short**3 * (1 / 3 - 0.21 * short / long * (1 - short**4 / (12 * long**4)))
    return a * b, a * b**3 / 12, b * a**3 / 12, torsion


def circle(r, inner=0.0):
    i = PI * (r**4 - inner**4) / 4
    return PI * (r**2 - inner**2), i, i, 2 * i


def box(a, b, right, top, left, bottom):
    """Outer sides a and b, thicknesses of the walls; moments about the middle of the box, torsion by Bredt."""
    inner_a, inner_b = a - left - right, b - top - bottom
    area = a * b - inner_a * inner_b
    middle = (a - (left + right) / 2) * (b - (top + bottom) / 2)
    walls = (b / left + b / right + a / top + a / bottom) or 1.0
    return area, (a * b**3 - inner_a * inner_b**3) / 12, (b * a**3 - inner_b * inner_a**3) / 12, 4 * middle**2 / walls


def wide_flange(distance, height, bottom, top, t_bottom, t_top, web):
    """I: flanges and web, moments about the centroid."""
    pieces = [
        (bottom, t_bottom, t_bottom / 2),
        (top, t_top, height - t_top / 2),
        (web, height - t_bottom - t_top, (height + t_bottom - t_top) / 2),
    ]
    area = sum(b * h for b, h, _ in pieces)
    centre = sum(b * h * y for b, h, y in pieces) / area
    i11 = sum(b * h**3 / 12 + b * h * (y - centre) ** 2 for b, h, y in pieces)
    i22 = sum(h * b**3 / 12 for b, h, _ in pieces)
    return area, i11, i22, sum(max(b, h) * min(b, h) ** 3 / 3 for b, h, _ in pieces)


SHAPES: dict[str, tuple[tuple[str, ...], Callable]] = {
    "RECT": (("width", "height"), rectangle),
    "CIRC": (("radius",), circle),
    "PIPE": (("radius", "wall"), lambda r, t: circle(r, max(r - t, 0.0))),
    "THICKPIPE": (("radius", "wall"), lambda r, t: circle(r, max(r - t, 0.0))),
    "BOX": (("width", "height", "first wall", "second wall", "third wall", "fourth wall"), box),
    "I": (("", "height", "first flange", "second flange", "first wall", "second wall", "web"), wide_flange),
}


def general(sections, block: Block, values: list[float]) -> tuple[dict, int]:
    """*BEAM GENERAL SECTION: A, I11, I12, I22, J; axes; E, G. Its material is its own."""
    if block.get("SECTION", "GENERAL").upper() != "GENERAL":
        shape = block.get("SECTION").upper().replace(" ", "")
        if shape not in SHAPES:
            sections.deck.warn(
                f"{block.where}: SECTION = {shape} is not read; its elements have no mass and no stiffness"
            )
            return nothing(), 0
        area, i11, i22, j = by_sizes(block, shape, values)
    else:
        area = positive(block, values, 0, "area")
        i11, _, i22, j = (values[1:] + [0.0] * 4)[:4]
    moduli = block.data(2) or (block.data(1) if len(block.data(1)) <= 2 else [])  # the line of axes may be blank
    young, shear = (moduli + [0.0, 0.0])[:2]
    density = block.numbers(0, [block.get("DENSITY")])[0] if block.get("DENSITY") else 0.0
    if not (density >= 0 and young >= 0 and shear >= 0):
        block.fail("a density or a modulus is negative")
    if not density:
        sections.deck.warn(f"{block.where}: has no DENSITY; its elements have no mass")
    number = max(sections.deck.materials) + 1
    poisson = min(max(young / (2 * shear) - 1, 0.0), 0.4999) if shear > 0 else 0.3
    sections.deck.materials[number] = Material(
        number, "section", "", float(density), young, poisson, void=not young, where=block.where
    )
    axis = first_direction(block)
    return {"area": area, "iyy": i11, "izz": i22, "ixx": j, "second_axis": axis}, number
