"""Choices of elements, and masks that add up to sets."""

from collections.abc import Callable
from typing import NoReturn

import numpy as np

from .model import Deck


def combine(mask: np.ndarray, signed) -> np.ndarray:
    for sign, other in signed:
        mask = mask | other if sign else mask & ~other
    return mask


class Selected:
    """A choice of elements: kinds[kind] is a bool per element."""

    def __init__(self, kinds: dict[str, np.ndarray]):
        self.kinds = kinds

    @staticmethod
    def of_parts(deck: Deck, parts: set[int]) -> "Selected":
        wanted = np.array(sorted(parts), np.int64)
        return Selected({kind: np.isin(one.part, wanted) for kind, one in deck.elements.items()})

    @staticmethod
    def of_ids(deck: Deck, kinds: tuple[str, ...], ids: np.ndarray, fail: Callable[[str], NoReturn]) -> "Selected":
        found, seen = {}, np.zeros(len(ids), bool)
        for kind in kinds:
            if kind in deck.elements:
                one = deck.elements[kind]
                found[kind] = np.isin(one.id, ids[ids > 0])
                seen |= np.isin(np.abs(ids), one.id)
        if not seen.all():
            fail(f"element {abs(ids[~seen][0])} is not in the deck")
        return Selected(found)

    @staticmethod
    def of_ranges(deck: Deck, kinds: tuple[str, ...], ranges: list) -> "Selected":
        found = {}
        for kind in kinds:
            if kind in deck.elements:
                ids = deck.elements[kind].id
                found[kind] = np.logical_or.reduce([(ids >= a) & (ids <= b) for a, b in ranges] or [ids < 0])
        return Selected(found)

    def plus(self, other: "Selected") -> "Selected":
        found = dict(self.kinds)
        for kind, mask in other.kinds.items():
            found[kind] = found[kind] | mask if kind in found else mask
        return Selected(found)

    def minus(self, other: "Selected") -> "Selected":
        return Selected({k: mask & ~other.kinds[k] if k in other.kinds else mask for k, mask in self.kinds.items()})

    def only(self, kinds: tuple[str, ...]) -> "Selected":
        return Selected({kind: mask for kind, mask in self.kinds.items() if kind in kinds})

    def nodes(self, deck: Deck) -> np.ndarray:
        mask = np.zeros(len(deck.node_id), bool)
        for kind, which in self.kinds.items():
            nodes = deck.elements[kind].nodes[which]
            mask[nodes[nodes >= 0]] = True
        return mask
