"""Which keywords of a Radioss deck are used, which are left aside and why that is safe, which are not understood."""

from .cards import Block

USED = {
    "BEGIN", "NODE", "CNODE", "SHELL", "SH3N", "BRICK", "TETRA4", "TETRA10", "PENTA6", "SPRING", "TRUSS", "BEAM",
    "PART", "PROP", "MAT", "GRNOD", "GRSHEL", "GRSH3N", "GRBRIC", "GRSPRI", "GRTRUS", "GRBEAM", "GRPART", "SURF",
    "SET", "SUBSET", "BOX", "ADMAS", "BCS", "IMPVEL", "IMPDISP", "IMPACC", "INIVEL", "GRAV", "RBODY", "FUNCT", "SKEW",
    "INTER", "TRANSFORM", "DEF_SHELL", "DEFAULT", "SUBMODEL", "UNIT", "TITLE", "VERS", "PARAMETER", "RBE2",
}  # fmt: skip

# Left aside: keyword -> why that changes nothing of the tie.
SAFE = {
    "control and output": {
        "ANALY", "ANIM", "ATH", "BTH", "CTH", "DTH", "ETH", "TH", "H3D", "STATE", "IOFLAG", "SPMD", "RANDOM", "PARITH",
        "SHFRA", "DEF_SOLID", "ALE", "AMS", "CAA", "KEY", "PRIVATE", "REFSTA", "STAMPING", "UPWIND", "VISION", "DT",
        "OUTP", "PRINT", "MEMORY", "ARCH", "CHECKSUM", "PERTURB", "IMPLICIT", "MON", "RUN", "TFILE", "NOISE", "ID",
    },
    "measures, changes nothing": {"ACCEL", "SENSOR", "SECT", "GAUGE", "CLUSTER"},
    "tables for other keywords": {"TABLE", "FUNC_2D", "MOVE_FUNCT", "FRAME", "LINE", "FAIL", "VISC", "EOS", "HEAT",
        "THERM_STRESS", "NONLOCAL", "DRAPE", "PLY", "LAMINATE", "STACK", "FRICTION", "SLIPRING", "RETRACTOR",
        "THERM", "EULER", "LEAK", "GRQUAD", "GRTRIA", "LEVSET", "ADMESH", "SPHGLO", "DFS"},
    "the host's: what loads or touches masters is in their motion, and loads on slaves are inputs": {
        "CLOAD", "PLOAD", "LOAD", "RWALL", "MONVOL", "CONVEC", "RADIATION", "IMPTEMP", "INITEMP", "IMPFLUX", "PRELOAD",
        "EREF", "XREF", "CENTRI", "PBLAST", "PFLUID",
    },
    "initial states of elements, which do not change masses": {
        "INISHE", "INISH3", "INIBRI", "INIBEAM", "INITRUSS", "INISPRI", "INICRACK", "INIQUA", "INIMAP1D", "INIMAP2D",
        "INIGRAV", "INIVOL",
    },
}  # fmt: skip
# Matter for masses or motions and are not read: each gets a warning with its line.
MATTERS = {
    "RBE3": "its nodes are treated as if it were not there",
    "RLINK": "its nodes are treated as if it were not there",
    "MPC": "its nodes are treated as if it were not there",
    "CYL_JOINT": "its nodes are treated as if it were not there",
    "GJOINT": "its nodes are treated as if it were not there",
    "FXBODY": "its nodes are treated as if it were not there",
    "RIVET": "it is left out",
    "NBCS": "nodes that it holds are not known to be held",
    "MERGE": "nodes stay apart",
    "BRIC20": "its elements add no mass and make no surface",
    "SHEL16": "its elements add no mass and make no surface",
    "QUAD": "its elements add no mass and make no surface",
    "TRIA": "its elements add no mass and make no surface",
    "XELEM": "its elements add no mass",
    "SPHCEL": "its particles add no mass",
    "DAMP": "its damping is left out",
}


def reason(name: str) -> str | None:
    """Why a keyword may be left aside; None where it may not."""
    return next((why for why, names in SAFE.items() if name in names), None)


NUMBERS = frozenset(b"0123456789+-.eEdD")


def encrypted(block: Block) -> bool:
    """An encrypted block says so, or holds lines of one long word that is no row of numbers."""
    if any("ENCRYPT" in word.upper() for word in block.key):
        return True
    for line in block.lines[1:4]:
        word = line.strip()
        if b"ENCRYPT" in word.upper() or (len(word) >= 60 and b" " not in word and set(word) - NUMBERS):
            return True
    return False
