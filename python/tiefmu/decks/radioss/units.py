"""Units of a Radioss deck: what /BEGIN says, and whether densities and moduli agree with it."""

import math

from ...units import LENGTHS, MASSES, TIMES
from ..model import Deck
from .cards import Block

PREFIXES = {
    "": 0, "y": -24, "z": -21, "a": -18, "f": -15, "p": -12, "n": -9, "mu": -6, "m": -3, "c": -2, "d": -1,
    "da": 1, "h": 2, "k": 3, "M": 6, "G": 9, "T": 12, "P": 15, "E": 18, "Z": 21, "Y": 24,
}  # fmt: skip
NAMES = {"Mg": "t", "mum": "um", "mus": "us"}  # of a scene, where they differ
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


def unit(word: str, symbol: str, base: float):
    """Name in a scene, or factor to SI, of a unit such as 'kg', 'mum' or '0.0254'; None where it is none.
    base: of the symbol without prefix in SI."""
    name = NAMES.get(word, word)
    if name in KNOWN["mgs".index(symbol)]:
        return name
    if word.endswith(symbol) and word[: -len(symbol)] in PREFIXES:
        return base * 10.0 ** PREFIXES[word[: -len(symbol)]]
    try:
        factor = float(word)
    except ValueError:
        return None
    return factor if 0 < factor < 1e30 else None


def factor(name, table) -> float:
    return float(table[name]) if isinstance(name, str) else float(name)


def read(deck: Deck, begin: Block | None):
    """Sets deck.units (length, mass, time) from /BEGIN; SceneError for a unit that is none."""
    words = []
    if begin is not None and len(begin.lines) > 2:
        line = begin.lines[2].decode("latin-1")
        words = [line[i : i + 20].strip() for i in (0, 20, 40)]
        if not all(words):
            words = line.split()
    if len(words) != 3:
        return None
    mass, length, time = words
    found = (unit(length, "m", 1.0), unit(mass, "g", 1e-3), unit(time, "s", 1.0))
    for word, value in zip((length, mass, time), found):
        if value is None and begin is not None:
            begin.fail(f"'{word}' is no unit", 2)
    deck.units = found
    return found


def check(deck: Deck, begin: Block | None, said):
    """Compares sqrt(E / rho) with what materials can have; takes a likely system where the deck names none."""
    stiff = [m for m in deck.materials.values() if m.young > 0 and m.density > 0]
    where = begin.where if begin is not None else f"{deck.file}: /BEGIN"
    if not stiff:
        if said is None:
            deck.warn(f"{where}: names no units, and no material tells; m, kg and s are assumed")
        return
    material = max(stiff, key=lambda one: one.young)
    best = min(SYSTEMS, key=lambda system: misfit(material, system))
    fits = misfit(material, best) < 2.5 and plausible(material, best)
    name = ", ".join(best)
    if said is None:
        if fits:
            deck.units = best
            deck.warn(
                f"{where}: names no units; {name} are taken, in which material {material.id} has "
                f"{density(material, best):.4g} kg/m3 and {modulus(material, best):.4g} Pa"
            )
        else:
            deck.warn(f"{where}: names no units; m, kg and s are assumed")
        return
    if not plausible(material, deck.units):
        speed = math.sqrt(modulus(material, deck.units) / density(material, deck.units))
        deck.warn(
            f"{where}: its units cannot be right: in them material {material.id} has "
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
