"""Numbers in the columns of a deck, as Fortran reads them: single ones and whole columns at once."""

import math
from collections.abc import Callable

import numpy as np

from ..mesh.fortran_numbers import number

LARGEST_ID = 10**18
UNDERSCORE = ord("_")


def column(text: np.ndarray, dtype, refuse: Callable[[int, str], None]) -> np.ndarray:
    """Numbers of one column (n, width) of characters; blank is 0. dtype: np.int64 or float; refuse(row, word) is called
    for what is no number."""
    text = np.ascontiguousarray(text)
    width = text.shape[1]
    empty = (text == 32).all(axis=1)
    if empty.any():
        text[empty, -1] = ord("0")
    if dtype is float:
        text[(text == ord("D")) | (text == ord("d"))] = ord("e")
    words = text.reshape(-1).view(f"S{width}")
    if not (text == UNDERSCORE).any():  # NumPy takes 1_000, as Python does
        try:
            numbers = words.astype(dtype)
            if np.all(np.abs(numbers) < (LARGEST_ID if dtype is np.int64 else np.inf)):
                return numbers
        except (ValueError, OverflowError):
            pass
    found = np.empty(len(words), dtype)
    for row, item in enumerate(words.tolist()):
        word = item.decode("latin-1").strip()
        try:
            found[row] = whole(word) if dtype is np.int64 else real(word)
        except (ValueError, OverflowError):
            refuse(row, word)
    return found


def whole(text: str) -> int:
    if not text:
        return 0
    number = int(text)
    if abs(number) >= LARGEST_ID or "_" in text:
        raise ValueError
    return number


def real(text: str) -> float:
    """Fortran's numbers: 1.5, 1.D-3, .3, 1.5-3; blank: 0. ValueError for what is none, or not finite."""
    found = number(text)
    if not math.isfinite(found):
        raise ValueError
    return found
