"""How messages call a block of cards, a keyword of a fixed-column deck, and its cards."""

from collections.abc import Sequence
from typing import NoReturn

from .._core import SceneError


class CardBlock:
    """Of a class with these members. file, number: where the keyword stands; lines: its cards; numbers: their lines."""

    file: str
    number: int
    lines: list[bytes]
    numbers: Sequence[int]

    @property
    def called(self) -> str:
        """The keyword in messages."""
        raise NotImplementedError

    def file_of(self, card: int) -> str:
        return self.file

    @property
    def where(self) -> str:
        return f"{self.file}: line {self.number}: {self.called}"

    def at(self, card: int) -> str:
        """How messages call a card; one that is missing by the last before it."""
        number = self.numbers[card] if card < len(self.numbers) else (self.numbers or [self.number])[-1]
        return f"{self.file_of(card)}: line {number}: {self.called}"

    def fail(self, text: str, card: int | None = None) -> NoReturn:
        raise SceneError(f"{self.where if card is None else self.at(card)}: {text}")
