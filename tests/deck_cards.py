"""Writes Radioss starter decks for tests: fixed columns, 10 and 20 wide (since 5.1) or 8 and 16 wide (4.x)."""

from pathlib import Path


class RadiossDeck:
    """Blocks in order. Values of a card: int (narrow), float (wide), str (as it is), None (a blank narrow field)."""

    def __init__(self, version: int = 2021, units=("kg", "m", "s")):
        self.old, self.lines = version < 50, ["#RADIOSS STARTER"]
        self.narrow, self.wide = (8, 16) if self.old else (10, 20)
        if self.old:
            self.lines += [f"/VERS/{version}"]
        self.lines += ["/BEGIN", "deck", f"{version:>10}         0"]
        if units:
            self.lines += ["".join(f"{unit:>20}" for unit in units)] * 2

    def card(self, *values):
        text = ""
        for value in values:
            if value is None:
                text += " " * self.narrow
            elif isinstance(value, float):
                text += f"{value:>{self.wide}.12g}"
            elif isinstance(value, int):
                text += f"{value:>{self.narrow}}"
            else:
                text += value
        self.lines.append(text)

    def block(self, keyword: str, *cards, title: str | None = None):
        """A keyword with its cards; title: on the keyword's line in old formats, else the first card."""
        self.lines.append(keyword + (f"/{title}" if self.old and title is not None else ""))
        if title is not None and not self.old:
            self.lines.append(title)
        for card in cards:
            self.card(*(card if isinstance(card, tuple) else (card,)))
        return self

    def nodes(self, positions: dict[int, tuple]):
        return self.block("/NODE", *[(number, *map(float, x)) for number, x in positions.items()])

    def elastic(self, number=1, density=7800.0, young=2.1e11, poisson=0.3, law="LAW1"):
        return self.block(f"/MAT/{law}/{number}", (density,), (young, poisson), title=f"material {number}")

    def shell(self, number=1, thickness=1e-3, ishell=0, ish3n=0, dm=0.0, dn=0.0, kind="TYPE1"):
        flags = (ishell, 0, ish3n)
        rows = [flags, (0.0, 0.0, 0.0, dm, dn), (0, 0, thickness)]
        return self.block(f"/PROP/{kind}/{number}", *rows, title=f"shell {number}")

    def solid(self, number=1, qb=0.0, rotary=0):
        rows = [(0, 0, None, 0, None, 0, rotary), (0.0, qb)]
        return self.block(f"/PROP/TYPE14/{number}", *rows, title=f"solid {number}")

    def spring(self, number=1, kind=13, mass=0.2, inertia=0.02, k=(), c=(), per_length=0, skew=0, function=0):
        """k, c: one (TYPE4) or six values."""
        if kind == 4:
            rows = [(mass, None, None, None, 0, 0, per_length)]
        else:
            rows = [(mass, inertia, skew, 0, 0, 0, per_length if kind == 13 else 0, 0)]
        for axis in range(len(k)):
            rows += [(float(k[axis]), float(c[axis]) if c else 0.0), (function if axis == 0 else 0, 0, 0, 0)]
            if not self.old:
                rows.append((0.0, 0.0))
        return self.block(f"/PROP/TYPE{kind}/{number}", *rows, title=f"spring {number}")

    def part(self, number=1, prop=1, material=1, thickness=0.0, subset=0):
        return self.block(f"/PART/{number}", (prop, material, subset, thickness), title=f"part {number}")

    def elements(self, keyword: str, part: int, rows: dict[int, tuple], thickness: dict[int, float] | None = None):
        blank = {"SHELL": 1, "SH3N": 2}.get(keyword, 0)
        cards = []
        for number, nodes in rows.items():
            card = (number, *nodes)
            if keyword == "TETRA10":
                cards += [(number,), nodes]
                continue
            if thickness and number in thickness:
                card += (None,) * blank + (0.0, float(thickness[number]))
            cards.append(card)
        return self.block(f"/{keyword}/{part}", *cards)

    def node_group(self, number: int, nodes, title="nodes"):
        nodes = list(nodes)
        return self.block(
            f"/GRNOD/NODE/{number}", *[tuple(nodes[i : i + 10]) for i in range(0, len(nodes), 10)], title=title
        )

    def surface(self, number: int, kind: str, ids, title="surface"):
        return self.block(f"/SURF/{kind}/{number}", tuple(ids), title=title)

    def tie(self, number=1, group=1, surface=1, ignore=0, spotflag=0, search=0, distance=0.0, title="weld"):
        card = (group, surface, ignore, spotflag, 0, search, 0, None, float(distance))
        return self.block(f"/INTER/TYPE2/{number}", card, title=title)

    def text(self) -> str:
        return "\n".join([*self.lines, "/END", ""])

    def write(self, path: Path) -> Path:
        path.write_text(self.text())
        return path
