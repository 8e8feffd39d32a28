"""Units of a Radioss deck: what /BEGIN says."""

from ...units import LENGTHS, MASSES, TIMES
from .. import units
from ..model import Deck
from .cards import Block

PREFIXES = {
    "": 0, "y": -24, "z": -21, "a": -18, "f": -15, "p": -12, "n": -9, "mu": -6, "m": -3, "c": -2, "d": -1,
    "da": 1, "h": 2, "k": 3, "M": 6, "G": 9, "T": 12, "P": 15, "E": 18, "Z": 21, "Y": 24,
}  # fmt: skip
NAMES = {"Mg": "t", "mum": "um", "mus": "us"}  # of a scene, where they differ
KNOWN = (LENGTHS, MASSES, TIMES)


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


def words_of(line: bytes) -> list[str]:
    """Words for mass, length and time of a card."""
    text = line.decode("latin-1")
    words = [text[i : i + 20].strip() for i in (0, 20, 40)]
    return words if all(words) else text.split()


def read(deck: Deck, begin: Block | None, named: list[Block]):
    """Sets deck.units (length, mass, time) from /BEGIN; SceneError for a unit that is none. named: /UNIT."""
    words = words_of(begin.lines[2]) if begin is not None and len(begin.lines) > 2 else []
    if len(words) != 3:
        return None
    for block in named:
        cards = block.titled()[1]
        if len(cards) and words_of(cards.need(0)) == words and block.word(1).isdecimal():
            block.source.same_units.add(int(block.word(1)))
    mass, length, time = words
    found = (unit(length, "m", 1.0), unit(mass, "g", 1e-3), unit(time, "s", 1.0))
    for word, value in zip((length, mass, time), found):
        if value is None and begin is not None:
            begin.fail(f"'{word}' is no unit", 2)
    deck.units = found
    return found


def check(deck: Deck, begin: Block | None, said):
    units.check(deck, begin.where if begin is not None else f"{deck.file}: /BEGIN", said is not None)
