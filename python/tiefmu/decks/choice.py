"""Which ties of a deck are taken: all, or those that the user names by title or id."""

import difflib

from .._core import SceneError
from .model import Deck, Tie


class Choice:
    """The ties of a deck. keyword: for messages; wanted: titles or ids, or None for all."""

    def __init__(self, deck: Deck, keyword: str, wanted: list[str] | None):
        self.deck, self.keyword = deck, keyword
        self.typed = {name.strip().lower(): name.strip() for name in wanted or []}
        self.asked = list(self.typed) if wanted else None
        self.known: list[str] = []
        self.found: set[str] = set()

    def wants(self, name: str, number: int | None = None) -> bool:
        """Whether the tie of this title and id is asked for."""
        self.known.append(name)
        if self.asked is None:
            return True
        hit = [word for word in self.asked if word == name.lower() or word == str(number)]
        self.found.update(hit)
        return bool(hit)

    def add(self, tie: Tie, number: int | str):
        """Takes a tie; ties of one name are told apart by their number."""
        while any(tie.name == other.name for other in self.deck.ties):
            tie.name += f" ({number})"
        self.deck.ties.append(tie)

    def finish(self):
        """SceneError where a tie that is asked for is missing, or there is none at all."""
        where = f"{self.deck.file}: {self.keyword}"
        missing = [word for word in self.asked or [] if word not in self.found]
        if missing:
            close = difflib.get_close_matches(missing[0], [name.lower() for name in self.known], 1, 0.5)
            names = [name for name in self.known if close and name.lower() == close[0]]
            known = ", ".join(self.known[:8])
            hint = f"; did you mean '{names[0]}'?" if names else f"; it has: {known}" if known else ""
            raise SceneError(f"{where}: no tie is called '{self.typed[missing[0]]}'{hint}")
        if not self.deck.ties:
            raise SceneError(f"{where}: the deck has no tie")
