"""/PROP and /MAT of a Radioss deck."""

import re

from ..model import Deck, Material, Property
from . import layers
from .cards import Block, Cards

PROPERTY_NAMES = {
    "VOID": 0,
    "SHELL": 1,
    "TRUSS": 2,
    "BEAM": 3,
    "SPRING": 4,
    "SOL_ORTH": 6,
    "SPR_GENE": 8,
    "SH_ORTH": 9,
    "SH_COMP": 10,
    "SH_SANDW": 11,
    "SPR_PUL": 12,
    "SPR_BEAM": 13,
    "SOLID": 14,
    "FLUID": 14,
    "POROUS": 15,
    "SH_FABR": 16,
    "STACK": 17,
    "INT_BEAM": 18,
    "PLY": 19,
    "TSHELL": 20,
    "TSH_ORTH": 21,
    "TSH_COMP": 22,
    "SPR_MAT": 23,
    "SPR_AXI": 25,
    "SPR_TAB": 26,
    "SPR_BDAMP": 27,
    "NSTRAND": 28,
    "SPR_PRE": 32,
    "KJOINT": 33,
    "SPH": 34,
    "STITCH": 35,
    "PREDIT": 36,
    "CONNECT": 43,
    "SPR_CRUS": 44,
    "KJOINT2": 45,
    "SPR_MUSCLE": 46,
}
SHELL_TYPES = (1, 9, 10, 11, 16, 17, 51)  # 11, 16, 17 and 51 have layers: layers.py
SOLID_TYPES = (6, 14, 20, 21, 22)
SPRING_TYPES = (4, 8, 13)

# Laws whose second card starts with E and nu; and with E only.
YOUNG_POISSON = {
    *(0, 1, 2, 3, 4, 10, 13, 16, 21, 22, 23, 24, 27, 32, 35, 36, 43, 44, 48, 49, 52, 53, 54, 57, 60, 63, 64, 65, 66),
    *(70, 71, 72, 73, 74, 76, 78, 79, 80, 84, 87, 90, 93, 103, 104, 106, 107, 109, 110, 115, 117, 119, 121, 122, 124),
    *(128, 187),
}
# Laws of two or three moduli along axes: number of them, and whether nu12 follows.
AXES = {12: (3, False), 14: (3, False), 15: (2, True), 19: (2, True), 25: (2, True), 28: (3, False), 68: (3, False)}
YOUNG_ONLY = {33, 58}
CONNECTIONS = {59, 83}  # of solids of type 43, whose moduli count per length
UNDAMPED = {1, 2, 3, 22, 23}  # dm of a shell does not count: cdleni.F
LAW_NAMES = {
    "VOID": 0,
    "ELAST": 1,
    "PLAS_JOHNS": 2,
    "PLAS_ZERIL": 2,
    "HYDPLA": 3,
    "HYD_JCOOK": 4,
    "JWL": 5,
    "HYDRO": 6,
    "HYD_VISC": 6,
    "DPRAG1": 10,
    "BOUND": 11,
    "3D_COMP": 12,
    "RIGID": 13,
    "COMPSO": 14,
    "CHANG": 15,
    "GRAY": 16,
    "THERM": 18,
    "FABRI": 19,
    "BIMAT": 20,
    "DPRAG": 21,
    "DAMA": 22,
    "PLAS_DAMA": 23,
    "CONC": 24,
    "COMPSH": 25,
    "SESAM": 26,
    "PLAS_BRIT": 27,
    "HONEYCOMB": 28,
    "HILL": 32,
    "FOAM_PLAS": 33,
    "BOLTZMAN": 34,
    "FOAM_VISC": 35,
    "PLAS_TAB": 36,
    "BIPHAS": 37,
    "VISC_TAB": 38,
    "KELVINMAX": 40,
    "LEE_T": 41,
    "OGDEN": 42,
    "HILL_TAB": 43,
    "COWPER": 44,
    "ZHAO": 48,
    "STEINB": 49,
    "VISC_HONEY": 50,
    "GURSON": 52,
    "TSAI_TAB": 53,
    "PREDIT": 54,
    "BARLAT3": 57,
    "FABR_A": 58,
    "CONNECT": 59,
    "PLAS_T3": 60,
    "VISC_HYP": 62,
    "HANSEL": 63,
    "UGINE_ALZ": 64,
    "ELASTOMER": 65,
    "COSSER": 68,
    "FOAM_TAB": 70,
    "HILL_MMC": 72,
    "SAMP": 76,
    "SPR_SEATBELT": 114,
}


def number_of(word: str, prefix: str, names: dict[str, int]) -> int | None:
    """Number of a type such as TYPE13, LAW2, LAW02 or PLAS_JOHNS."""
    match = re.fullmatch(rf"{prefix}0*(\d+)", word)
    return int(match[1]) if match else names.get(word)


def read_properties(deck: Deck, blocks: list[Block], default_shell: tuple[int, int]) -> set[int]:
    """/PROP: fills properties; returns ids of those that are not understood. default_shell: Ishell, Ish3n."""
    unknown = set()
    for block in blocks:
        number = block.id(2, "property")
        kind = number_of(block.word(1), "TYPE", PROPERTY_NAMES)
        title, cards = block.titled()
        refuse_unit(block, 3)
        if number in deck.properties or number in unknown:
            first = deck.properties.get(number)
            block.fail(f"property {number} is repeated" + (f"; the first one stands in {first.where}" if first else ""))
        name = block.word(1)
        if kind in SHELL_TYPES:
            values = shell(cards, default_shell)
            found = Property(number, "shell", name, title, values, block.where)
            layers.read(block, cards, kind, values)
        elif kind == 19:
            material, thickness = cards.read(0, "ir")
            values = {"material": material + block.offsets.material, "thickness": thickness}
            found = Property(number, "ply", name, title, values, block.where)
        elif kind in SOLID_TYPES:
            found = Property(number, "solid", name, title, solid(cards), block.where)
        elif kind in SPRING_TYPES:
            found = Property(number, "spring", name, title, spring(deck, block, cards, kind), block.where)
        elif kind == 2:
            found = Property(number, "truss", name, title, {"area": cards.read(0, "r")[0]}, block.where)
        elif kind == 3:
            dm, df = cards.read(1, "rr")
            area, iyy, izz, ixx = cards.read(2, "rrrr")
            values = {"area": area, "iyy": iyy, "izz": izz, "ixx": ixx, "dm": dm, "df": df or 0.01}
            found = Property(number, "beam", name, title, values, block.where)
        elif kind == 43:  # mass alone: sini43.F
            found = Property(number, "void", name, title, {"connects": True}, block.where)
        elif kind == 0:
            thickness = cards.read(0, "r")[0] if len(cards) and cards.need(0).strip() else 0.0
            found = Property(number, "void", name, title, {"thickness": thickness}, block.where)
        else:
            unknown.add(number)
            found = Property(number, "other", name, title, {}, block.where)
        deck.properties[number] = found
    return unknown


def refuse_unit(block: Block, place: int):
    """A block in units of its own would be misread; units that are those of /BEGIN are none of its own."""
    word = block.word(place)
    if not block.source.old and word.isdecimal() and word.strip("0") and int(word) not in block.source.same_units:
        block.fail(f"its unit {word} is not supported; give it in the units of /BEGIN")


def shell(cards: Cards, default_shell: tuple[int, int]) -> dict:
    ishell, _, ish3n = cards.read(0, "iii")
    ishell, ish3n = ishell or default_shell[0], ish3n or default_shell[1]
    dm, dn = cards.read(1, "rrrrr")[3:]
    _, _, thickness, _, _, _, position = cards.read(2, "iirr.iii")
    formulation = {12: "qbat", 22: "qeph", 23: "qeph", 24: "qeph"}.get(ishell, "q4")
    if formulation == "qeph":
        dn = dn or 0.015
    offset = {3: -0.5, 4: 0.5}.get(position, 0.0) if cards.block.source.version >= 2024 else 0.0
    return {
        "thickness": thickness,
        "formulation": formulation,
        "triangle": "dkt18" if ish3n == 30 else "c0",
        "dm": dm,
        "dn": dn,
        "offset": offset,
    }


def solid(cards: Cards) -> dict:
    tetra10, _, tetra4 = cards.read(0, "....iii")
    qb = cards.read(1, "rr")[1]
    return {"qb": qb or 0.05, "rotary": tetra4 == 1, "tetra10": 2 if 2 in (tetra10, tetra4) else 0}


def spring(deck: Deck, block: Block, cards: Cards, kind: int) -> dict:
    """TYPE4 axial, TYPE8 general, TYPE13 beam."""
    name = {4: "axial", 8: "general", 13: "beam"}[kind]
    values: dict = {"type": name, "skew": 0}
    if kind == 4:
        values["mass"], _, _, per_length = cards.read(0, "r...iii")
        values["inertia"], axes = 0.0, 1
    elif kind == 8:
        values["mass"], values["inertia"], values["skew"], *_ = cards.read(0, "rriiii")
        per_length, axes = 0, 6
    else:
        values["mass"], values["inertia"], values["skew"], _, _, _, per_length = cards.read(0, "rriiiii")
        axes = 6
    values["per_length"] = bool(per_length)
    if values["skew"]:
        values["skew"] += block.offsets.other
    step = 2 if block.source.old else 3
    stiffness, damping, nonlinear = [0.0] * 6, [0.0] * 6, []
    for axis in range(axes):
        stiffness[axis], damping[axis] = cards.read(1 + axis * step, "rr")
        functions = cards.read(2 + axis * step, "iiiii")
        nonlinear += [number for place, number in enumerate(functions) if number and place != 1]
    values |= {
        "stiffness": stiffness[:3],
        "damping": damping[:3],
        "rotational_stiffness": stiffness[3:],
        "rotational_damping": damping[3:],
        "nonlinear": nonlinear,
    }
    return values


def read_materials(deck: Deck, blocks: list[Block]) -> set[int]:
    """/MAT: fills materials; returns ids of those whose elastic constants are not read."""
    unread = set()
    for block in blocks:
        word = block.word(1)
        law = number_of(word, "LAW", LAW_NAMES)
        number = block.id(2, "material")
        refuse_unit(block, 3)
        title, cards = block.titled()
        if number in deck.materials:
            block.fail(f"material {number} is repeated; the first one stands in {deck.materials[number].where}")
        found = Material(number, word, title, where=block.where)
        deck.materials[number] = found
        found.density = cards.read(0, "r")[0] if law not in (51, 151) and len(cards) else 0.0
        if law == 0:
            found.void = True
        elif law in YOUNG_POISSON:
            found.young, found.poisson = cards.read(1, "rr")
            if law == 70:
                found.young = max(found.young, cards.read(1, "rrr")[2])
        elif law == 38:
            found.young, tension, compression = cards.read(1, "rrr")
            found.poisson = max(tension, compression)
        elif law in YOUNG_ONLY:
            found.young = cards.read(1, "r")[0]
        elif law in CONNECTIONS:
            found.void, found.per_area = True, cards.read(1, "rri")[2] == 1
        elif law in AXES:
            moduli, poisson = AXES[law]
            read = cards.read(1, "r" * (moduli + poisson))
            found.young, found.poisson = max(read[:moduli]), read[moduli] if poisson else 0.0
        elif law == 42:
            found.poisson = cards.read(1, "r")[0] or 0.495
            mu, alpha = cards.read(2, "rrrrr"), cards.read(4, "rrrrr")
            found.young = sum(m * a for m, a in zip(mu, alpha)) * (1 + found.poisson)
        else:
            unread.add(number)
        found.undamped = law in UNDAMPED
        found.damping = 0.25 if law == 19 else 0.05 if law in (25, 27, 123, 125, 127) else 0.0
        for value, what in ((found.density, "density"), (found.young, "Young's modulus")):
            if not 0 <= value < 1e30:
                block.fail(f"material {number}: {what} {value:g} is negative or too large")
        if not -1 < found.poisson < 0.5:
            if found.poisson == 0.5:
                found.poisson = 0.4995
            else:
                block.fail(f"material {number}: Poisson's ratio {found.poisson:g} is not between -1 and 0.5")
    return unread
