"""Writes LS-DYNA keyword decks for tests: fixed columns, comma format, long format or ten columns for integers."""

from pathlib import Path

WIDTHS = {"i": 10, "r": 10, "s": 10, "I": 8, "F": 8, "R": 16, "Q": 20}


class DynaDeck:
    """Keywords in order. form: fixed, comma, long, i10. A card is a text (as it is), or a layout as in
    tiefmu.decks.dyna.cards and its values; None is a blank field."""

    def __init__(self, form: str = "fixed", bare: bool = False):
        self.form = form
        first = {"long": "*KEYWORD LONG=Y", "i10": "*KEYWORD I10=Y"}.get(form, "*KEYWORD")
        self.lines = [] if bare else [first]

    def card(self, layout: str, *values) -> str:
        words = ["" if value is None else self.word(value) for value in values]
        if self.form == "comma":
            return ",".join(words)
        found = ""
        for letter, word in zip(layout, words):
            width = 20 if self.form == "long" else WIDTHS[letter]
            width = 10 if self.form == "i10" and width == 8 else width
            assert len(word) <= width, (word, width)
            found += word.ljust(width) if letter == "s" else word.rjust(width)
        return found

    @staticmethod
    def word(value) -> str:
        """A number in the shortest way."""
        if not isinstance(value, float):
            return str(value)
        found = min((repr(value), f"{value:g}", f"{value:.12g}"), key=lambda text: (float(text) != value, len(text)))
        return found if "." in found or "e" in found else found + "."

    def block(self, keyword: str, *cards, title: str | None = None):
        self.lines.append(f"*{keyword}")
        if title is not None:
            self.lines.append(title)
        self.lines += [card if isinstance(card, str) else self.card(*card) for card in cards]
        return self

    def nodes(self, positions: dict[int, tuple]):
        return self.block("NODE", *[("IRRR", number, *map(float, x)) for number, x in positions.items()])

    def elastic(self, number=1, density=7800.0, young=2.1e11, poisson=0.3, name="ELASTIC"):
        return self.block(f"MAT_{name}", ("irrr", number, density, young, poisson))

    def shell(self, number=1, thickness=1e-3, elform=2):
        return self.block("SECTION_SHELL", ("ii", number, elform), ("rrrr", *[thickness] * 4))

    def solid(self, number=1, elform=1):
        return self.block("SECTION_SOLID", ("ii", number, elform))

    def part(self, number=1, section=1, material=1, title=None):
        return self.block("PART", ("iii", number, section, material), title=title or f"part {number}")

    def elements(self, keyword: str, part: int, rows: dict[int, tuple]):
        return self.block(f"ELEMENT_{keyword}", *[("I" * 10, n, part, *nodes) for n, nodes in rows.items()])

    def list_of(self, kind: str, number: int, ids, option="_LIST"):
        """A set: kind NODE, PART, SHELL, ..."""
        ids = list(ids)
        rows = [("i" * 8, *ids[i : i + 8]) for i in range(0, len(ids), 8)]
        return self.block(f"SET_{kind}{option}", ("i", number), *rows)

    def segments(self, number: int, rows):
        return self.block("SET_SEGMENT", ("i", number), *[("iiii", *row) for row in rows])

    def tie(
        self, slave=1, master=1, types=(4, 3), number=1, title="weld", name="TIED_SHELL_EDGE_TO_SURFACE",
        thickness=(0.0, 0.0), scale=(1.0, 1.0), boxes=(0, 0), option="_ID",
    ):  # fmt: skip
        head = (
            [("is", number, title) if self.form == "comma" else self.card("i", number) + title]
            if option == "_ID"
            else []
        )
        rows = [("i" * 6, slave, master, *types, *boxes), ("rr", 0.0, 0.0), ("rrrrrr", 0.0, 0.0, *thickness, *scale)]
        return self.block(f"CONTACT_{name}{option}", *head, *rows)

    def text(self) -> str:
        return "\n".join([*self.lines, "*END", ""])

    def write(self, path: Path) -> Path:
        path.write_text(self.text())
        return path
