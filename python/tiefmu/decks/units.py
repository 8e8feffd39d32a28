"""Units of a deck: whether densities and moduli agree with them, and the likely system of one that names none."""

import math

from ..units import LENGTHS, MASSES, TIMES
from .model import Deck, Material

KNOWN = (LENGTHS, MASSES, TIMES)
# Systems that people use, for decks that name none, or the wrong one.
SYSTEMS = [
    ("m", "kg", "s"),
    ("mm", "t", "s"),
    ("mm", "kg", "ms"),
    ("mm", "g", "ms"),
    ("cm", "g", "us"),
    ("mm", "g", "s"),
]
STEEL = 7850.0, 2.1e11
SPEEDS = 30.0, 20000.0  # m/s: sqrt(E / rho) of what parts are made of, from foam to ceramics


def factor(name, table) -> float:
    return float(table[name]) if isinstance(name, str) else float(name)


def name_of(material: Material) -> str:
    return f"material '{material.title}'" if material.title and not material.law else f"material {material.id}"


def check(deck: Deck, where: str, said: bool):
    """Compares sqrt(E / rho) with what materials can have; takes a likely system where the deck names none (said is
    false). where: begins the messages."""
    stiff = [m for m in deck.materials.values() if m.young > 0 and m.density > 0]
    if not stiff:
        if not said:
            deck.warn(f"{where}: names no units, and no material tells; m, kg and s are assumed")
        return
    material = max(stiff, key=lambda one: one.young)
    best = min(SYSTEMS, key=lambda system: misfit(material, system))
    fits = misfit(material, best) < 2.5 and plausible(material, best)
    name = ", ".join(best)
    if not said:
        if fits:
            deck.units = best
            deck.warn(
                f"{where}: names no units; {name} are taken, in which {name_of(material)} has "
                f"{density(material, best):.4g} kg/m3 and {modulus(material, best):.4g} Pa"
            )
        else:
            deck.warn(f"{where}: names no units; m, kg and s are assumed")
        return
    if not plausible(material, deck.units):
        speed = math.sqrt(modulus(material, deck.units) / density(material, deck.units))
        deck.warn(
            f"{where}: its units cannot be right: in them {name_of(material)} has "
            f"{density(material, deck.units):.4g} kg/m3, {modulus(material, deck.units):.4g} Pa and waves of "
            f"{speed:.4g} m/s"
            + (
                f"; in {name} it would have {density(material, best):.4g} and {modulus(material, best):.4g}"
                if fits
                else ""
            )
            + "; they are kept as the deck says"
        )


def density(material, system) -> float:
    length, mass, _ = (factor(name, table) for name, table in zip(system, KNOWN))
    return material.density * mass / length**3


def modulus(material, system) -> float:
    length, mass, time = (factor(name, table) for name, table in zip(system, KNOWN))
    return material.young * mass / length / time**2


def misfit(material, system) -> float:
    """How many powers of ten density and modulus are from steel."""
    return abs(math.log10(density(material, system) / STEEL[0])) + abs(math.log10(modulus(material, system) / STEEL[1]))


def plausible(material, system) -> bool:
    speed = math.sqrt(modulus(material, system) / density(material, system))
    return SPEEDS[0] <= speed <= SPEEDS[1] and 0.5 <= density(material, system) <= 3e4
