"""Writes Abaqus and CalculiX input files for tests."""

from pathlib import Path


class InputDeck:
    """Blocks in order; a row is a text, or a tuple of values."""

    def __init__(self):
        self.lines = ["*HEADING", "deck"]

    def block(self, keyword: str, *rows) -> "InputDeck":
        self.lines.append(f"*{keyword}")
        self.lines += [row if isinstance(row, str) else ", ".join(map(str, row)) for row in rows]
        return self

    def nodes(self, positions: dict[int, tuple]) -> "InputDeck":
        return self.block("NODE", *[(number, *map(float, x)) for number, x in positions.items()])

    def elements(self, kind: str, name: str, rows: dict[int, tuple]) -> "InputDeck":
        return self.block(f"ELEMENT, TYPE={kind}, ELSET={name}", *[(number, *nodes) for number, nodes in rows.items()])

    def elastic(self, name="steel", density=7800.0, young=2.1e11, poisson=0.3) -> "InputDeck":
        self.block(f"MATERIAL, NAME={name}").block("DENSITY", (density,))
        return self.block("ELASTIC", (young, poisson))

    def shell(self, name: str, thickness=1e-3, material="steel", options="") -> "InputDeck":
        return self.block(f"SHELL SECTION, ELSET={name}, MATERIAL={material}{options}", (thickness, 5))

    def solid(self, name: str, material="steel") -> "InputDeck":
        return self.block(f"SOLID SECTION, ELSET={name}, MATERIAL={material}", ",")

    def mass(self, number: int, node: int, mass: float) -> "InputDeck":
        self.elements("MASS", f"mass {number}", {number: (node,)})
        return self.block(f'MASS, ELSET="mass {number}"', (mass,))

    def tie(self, slave: str, master: str, options="", name="weld") -> "InputDeck":
        return self.block(f"TIE, NAME={name}{options}", (slave, master))

    def text(self) -> str:
        return "\n".join([*self.lines, ""])

    def write(self, path: Path) -> Path:
        path.write_text(self.text())
        return path
