"""*MAT of an LS-DYNA deck: density and elastic constants, rigid bodies, springs."""

import re
from dataclasses import dataclass, field

from ..model import Material
from .cards import Block

# Names and numbers of materials whose first card is not MID, RO, E, PR. Of a name the longest that fits counts.
NUMBERS = {
    "ELASTIC": 1, "ORTHOTROPIC_ELASTIC": 2, "ANISOTROPIC_ELASTIC": 2, "PLASTIC_KINEMATIC": 3,
    "ELASTIC_PLASTIC_THERMAL": 4, "SOIL_AND_FOAM": 5, "VISCOELASTIC": 6, "BLATZ-KO_RUBBER": 7,
    "HIGH_EXPLOSIVE_BURN": 8, "NULL": 9, "ELASTIC_PLASTIC_HYDRO": 10, "STEINBERG": 11, "ISOTROPIC_ELASTIC_PLASTIC": 12,
    "ISOTROPIC_ELASTIC_FAILURE": 13, "SOIL_AND_FOAM_FAILURE": 14, "JOHNSON_COOK": 15, "POWER_LAW_PLASTICITY": 18,
    "STRAIN_RATE_DEPENDENT_PLASTICITY": 19, "RIGID": 20, "ORTHOTROPIC_THERMAL": 21, "COMPOSITE_DAMAGE": 22,
    "PIECEWISE_LINEAR_PLASTICITY": 24, "HONEYCOMB": 26, "MOONEY-RIVLIN_RUBBER": 27, "RESULTANT_PLASTICITY": 28,
    "FABRIC": 34, "3-PARAMETER_BARLAT": 36, "TRANSVERSELY_ANISOTROPIC_ELASTIC_PLASTIC": 37,
    "ENHANCED_COMPOSITE_DAMAGE": 54, "LOW_DENSITY_FOAM": 57, "LAMINATED_COMPOSITE_FABRIC": 58,
    "COMPOSITE_FAILURE": 59, "CRUSHABLE_FOAM": 63, "RATE_SENSITIVE_POWERLAW_PLASTICITY": 64,
    "LINEAR_ELASTIC_DISCRETE_BEAM": 66, "NONLINEAR_ELASTIC_DISCRETE_BEAM": 67,
    "NONLINEAR_PLASTIC_DISCRETE_BEAM": 68, "SID_DAMPER_DISCRETE_BEAM": 69, "CABLE_DISCRETE_BEAM": 71,
    "CONCRETE_DAMAGE": 72, "ELASTIC_SPRING_DISCRETE_BEAM": 74, "GENERAL_VISCOELASTIC": 76, "HYPERELASTIC_RUBBER": 77,
    "OGDEN_RUBBER": 77, "PLASTICITY_WITH_DAMAGE": 81, "FU_CHANG_FOAM": 83, "PLASTICITY_POLYMER": 89,
    "SIMPLIFIED_JOHNSON_COOK": 98, "SIMPLIFIED_JOHNSON_COOK_ORTHOTROPIC_DAMAGE": 99, "SPOTWELD": 100,
    "GURSON": 120, "MODIFIED_PIECEWISE_LINEAR_PLASTICITY": 123, "PLASTICITY_COMPRESSION_TENSION": 124,
    "KINEMATIC_HARDENING_TRANSVERSELY_ANISOTROPIC": 125, "MODIFIED_HONEYCOMB": 126, "ARRUDA_BOYCE_RUBBER": 127,
    "BARLAT_YLD2000": 133, "COHESIVE_MIXED_MODE": 138, "DAMAGE_3": 153, "DESHPANDE_FLECK_FOAM": 154,
    "CSCM": 159, "CSCM_CONCRETE": 159, "MODIFIED_CRUSHABLE_FOAM": 163, "ARUP_ADHESIVE": 169,
    "SIMPLIFIED_RUBBER": 181, "COHESIVE_ELASTIC": 184, "COHESIVE_TH": 185, "COHESIVE_GENERAL": 186, "SAMP-1": 187,
    "TABULATED_JOHNSON_COOK": 224, "COHESIVE_MIXED_MODE_ELASTOPLASTIC_RATE": 240, "TAILORED_PROPERTIES": 251,
    "TOUGHENED_ADHESIVE_POLYMER": 252,
}  # fmt: skip
YOUNG_POISSON = {
    *(1, 3, 18, 19, 20, 24, 26, 28, 36, 37, 63, 64, 81, 89, 98, 99, 100, 120, 123, 124, 125, 126, 133, 153, 154, 163),
    *(169, 224, 251, 252),
}
YOUNG_ONLY = {57, 83}
MODULI = {2, 22, 34, 54, 55, 58, 59}  # three moduli, then PRBA
SHEAR_BULK = {5: "GK", 6: "KG", 12: "G  K", 13: "G  K", 187: "KG"}  # which fields behind RO are G and K
NO_STIFFNESS = {9, 138, 184, 185, 186, 240}  # null material, cohesive zones
NOT_READ = {4, 8, 11, 14, 72, 76, 77, 127, 159, 181}  # whose first cards hold no moduli that stand for E and nu
SPRINGS = {
    "SPRING_ELASTIC": "S01", "DAMPER_VISCOUS": "S02", "SPRING_ELASTOPLASTIC": "S03", "SPRING_NONLINEAR_ELASTIC": "S04",
    "DAMPER_NONLINEAR_VISCOUS": "S05", "SPRING_GENERAL_NONLINEAR": "S06", "SPRING_MAXWELL": "S07",
    "SPRING_INELASTIC": "S08", "SPRING_TRILINEAR_DEGRADING": "S13", "SPRING_SQUAT_SHEARWALL": "S14",
    "SPRING_MUSCLE": "S15",
}  # fmt: skip


@dataclass
class Materials:
    """What materials say beside density and elastic constants, by material id. rigid: id -> CMO, CON1, CON2; springs:
    id -> law, stiffness, damping of *ELEMENT_DISCRETE; beams: id -> stiffnesses and dampings of a discrete beam (each
    six: translations, rotations); unread: ids whose elastic constants are not read."""

    rigid: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    springs: dict[int, tuple[str, float, float]] = field(default_factory=dict)
    beams: dict[int, tuple[list[float], list[float]]] = field(default_factory=dict)
    unread: set[int] = field(default_factory=set)


def number_of(name: str) -> int | str | None:
    """Number of a material such as 24 or S01; None where the name is not known. name: behind MAT_, without _TITLE."""
    match = re.match(r"0*(\d+)(?=_|$)", name) or re.match(r"(S\d\d)(?=_|$)", name)
    if match:
        return int(match[1]) if match[1].isdecimal() else match[1]
    found = [key for key in (*NUMBERS, *SPRINGS) if name == key or name.startswith(key + "_")]
    if not found:
        return None
    key = max(found, key=len)
    return NUMBERS.get(key, SPRINGS.get(key))


def read(deck, blocks: list[Block]) -> Materials:
    """Fills deck.materials."""
    found = Materials()
    for block in blocks:
        name = block.name.removeprefix("MAT_").removesuffix("_TITLE")
        first = 1 if block.has("TITLE") else 0
        title = block.text(0) if first else ""
        law = number_of(name)
        ident = block.id("material", block.read(first, "i")[0])
        if not ident:
            block.fail("material 0 is no id", first)
        if ident in deck.materials:
            block.fail(f"material {ident} is repeated; the first one stands in {deck.materials[ident].where}", first)
        material = Material(ident, name, title, where=block.where)
        deck.materials[ident] = material
        if isinstance(law, str):
            spring(found, block, first, ident, law)
            continue
        unit = block.origin.unit
        material.density = block.read(first, "irrrr")[1] * unit(length=-3, mass=1)
        constants(deck, found, block, first, material, law)
        material.young *= unit(length=-1, mass=1, time=-2)
        for value, what in ((material.density, "density"), (material.young, "Young's modulus")):
            if not 0 <= value < 1e30:
                block.fail(f"material {ident}: {what} {value:g} is negative or too large", first)
        if not -1 < material.poisson < 0.5:
            if material.poisson != 0.5:
                block.fail(f"material {ident}: Poisson's ratio {material.poisson:g} is not between -1 and 0.5", first)
            material.poisson = 0.4995
    return found


def constants(deck, found: Materials, block: Block, first: int, material: Material, law: int | None):
    """Young's modulus and Poisson's ratio from the first card."""
    _, _, *a = block.read(first, "irrrrrrr")
    if law in NO_STIFFNESS:
        material.void = True
        material.per_area = law != 9 and a[0] == 1
        if material.per_area:
            material.density *= block.origin.length  # which has been read as one per volume
    elif law in YOUNG_POISSON:
        material.young, material.poisson = a[0], a[1]
    elif law in YOUNG_ONLY:
        material.young = a[0]
    elif law in MODULI:
        material.young, material.poisson = max(a[:3]), a[3]
    elif law in SHEAR_BULK:
        places = SHEAR_BULK[law]
        g, k = a[places.index("G")], a[places.index("K")]
        if law == 6:
            g = a[1]
        if g > 0 and k > 0:
            material.young, material.poisson = 9 * k * g / (3 * k + g), (3 * k - 2 * g) / (2 * (3 * k + g))
        elif g > 0:
            material.young, material.poisson = 2.6 * g, 0.3
    elif law == 7:
        material.young, material.poisson = 2 * a[0] * 1.463, 0.463
    elif law in (10, 15):
        material.poisson = a[2] if law == 15 and a[2] else 0.3
        material.young = a[1] if law == 15 and a[1] else 2 * (1 + material.poisson) * a[0]
    elif law == 27:
        material.poisson = a[0]
        material.young = 4 * (1 + a[0]) * (a[1] + a[2])
    elif law == 66:
        translations_rotations(found, block, first, material.id)
    elif law in (67, 68, 69, 71, 74):
        pass
    elif law not in NOT_READ and a[0] > 0 and 0 <= a[1] < 0.5:
        material.young, material.poisson = a[0], a[1]
        deck.warn(
            f"{block.where}: is not known; its third and fourth field are taken as Young's modulus {a[0]:g} and "
            f"Poisson's ratio {a[1]:g}"
        )
    else:
        found.unread.add(material.id)
    if material.young < 0:
        deck.warn(f"{block.where}: Young's modulus comes from curve {-material.young:g}, which is not read")
        material.young = 0.0
        found.unread.add(material.id)
    if law == 20:
        cmo, con1, con2 = block.or_blank(first + 1, "rrr")
        found.rigid[material.id] = (cmo, con1, con2)
    if law == 100 and a[4] > 0:
        deck.warn(f"{block.where}: masses that its time step {a[4]:g} would add are left out")


def translations_rotations(found: Materials, block: Block, first: int, ident: int):
    unit = block.origin.unit
    force, moment = unit(mass=1, time=-2), unit(length=2, mass=1, time=-2)
    k = [v * (force if i < 3 else moment) for i, v in enumerate(block.read(first, "..rrrrrr"))]
    c = [v * (force if i < 3 else moment) * unit(time=1) for i, v in enumerate(block.or_blank(first + 1, "rrrrrr"))]
    found.beams[ident] = (k, c)


def spring(found: Materials, block: Block, first: int, ident: int, law: str):
    _, value = block.read(first, "ir")
    force = block.origin.unit(mass=1, time=-2)
    if law in ("S01", "S03"):
        found.springs[ident] = (law, value * force, 0.0)
    elif law == "S02":
        found.springs[ident] = (law, 0.0, value * force * block.origin.unit(time=1))
    else:
        found.springs[ident] = (law, 0.0, 0.0)
    if value < 0:
        block.fail(f"material {ident}: {value:g} is negative", first)
