"""Numbers of text files as Fortran programs write them, one by one and in bulk."""

import re
import warnings

import numpy as np

from ..schema import shortened

EXPONENT = re.compile(r"(?<=[\d.])[dDeE]?(?=[+-])|[dD]")  # of 1.5D0, 1.5-3, 1.5E+3


class FieldError(ValueError):
    """A field that is no number. index: of the field; its text names it."""

    def __init__(self, index: int, text: str):
        super().__init__(text)
        self.index = index


def whole(items: list[str], blank: str = "") -> np.ndarray:
    """Whole numbers (n); blank: what an empty field stands for. FieldError for what is none."""
    if blank:
        items = [item if item.strip() else blank for item in items]
    try:
        values = list(map(int, items))
        if not any("_" in item for item in items):
            return np.array(values, np.int64)
    except (ValueError, OverflowError):
        pass
    for index, item in enumerate(items):
        if not re.fullmatch(r"\s*[+-]?\d+\s*", item, re.ASCII):
            raise FieldError(index, f"expected a whole number, found '{shortened(item.strip())}'")
        if abs(int(item)) >= 2**63:
            raise FieldError(index, f"{shortened(item.strip())} is no id")
    raise FieldError(0, "cannot be read")


def numbers(items: list[str]) -> np.ndarray:
    """Numbers (n), also 1.D0 and 1.5-3; blank: 0. FieldError for what is none."""
    try:
        if not any("_" in item for item in items):
            return np.array(list(map(float, items)))
    except ValueError:
        pass
    return np.array([number(item.strip(), index) for index, item in enumerate(items)])


def number(text: str, index: int = 0) -> float:
    if not text:
        return 0.0
    try:
        if "_" not in text:
            return float(EXPONENT.sub("e", text, count=1)) if EXPONENT.search(text) else float(text)
    except ValueError:
        pass
    raise FieldError(index, f"expected a number, found '{shortened(text)}'")


def table(lines: list[str], columns: int, dtype: type) -> np.ndarray | None:
    """Lines of `columns` fields between commas, as an array (n, columns); None where one of them needs a closer
    look."""
    if not lines or any(line.count(",") != columns - 1 for line in lines):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            values = np.fromstring(",".join(lines), dtype, sep=" , ")
        except (DeprecationWarning, ValueError):
            return None
    return values.reshape(-1, columns) if len(values) == len(lines) * columns else None
