"""Which keywords of an LS-DYNA deck are used, which are left aside and why that is safe, which are not understood.

A keyword is found by its longest beginning, at a _: CONTROL is every keyword of that family.
"""

USED = {
    "NODE", "ELEMENT_SHELL", "ELEMENT_SOLID", "ELEMENT_TSHELL", "ELEMENT_BEAM", "ELEMENT_DISCRETE", "ELEMENT_MASS",
    "ELEMENT_MASS_NODE_SET", "ELEMENT_MASS_PART", "ELEMENT_MASS_PART_SET", "ELEMENT_INERTIA", "PART", "SECTION",
    "MAT", "SET_NODE", "SET_SEGMENT", "SET_PART", "SET_SHELL", "SET_SOLID", "SET_TSHELL", "SET_BEAM", "SET_DISCRETE",
    "CONTACT", "DEFINE_BOX", "DEFINE_CURVE", "DEFINE_TRANSFORMATION", "DEFINE_SD_ORIENTATION", "BOUNDARY_SPC_NODE",
    "BOUNDARY_SPC_SET",
    "BOUNDARY_PRESCRIBED_MOTION", "INITIAL_VELOCITY", "LOAD_BODY_X", "LOAD_BODY_Y", "LOAD_BODY_Z", "LOAD_BODY_PARTS",
    "CONSTRAINED_NODAL_RIGID_BODY", "CONSTRAINED_EXTRA_NODES_NODE", "CONSTRAINED_EXTRA_NODES_SET",
    "CONSTRAINED_RIGID_BODIES", "CONTROL_BULK_VISCOSITY", "CONTROL_UNITS", "TITLE",
}  # fmt: skip
# Answered while files are read.
FILES = {
    "KEYWORD", "END", "INCLUDE", "INCLUDE_TRANSFORM", "INCLUDE_PATH", "INCLUDE_PATH_RELATIVE", "PARAMETER",
    "PARAMETER_LOCAL", "PARAMETER_TYPE", "PARAMETER_EXPRESSION", "PARAMETER_EXPRESSION_LOCAL", "PARAMETER_DUPLICATION",
}  # fmt: skip

# Left aside: beginning of a keyword -> why that changes nothing of the tie.
SAFE = {
    "control and output": {
        "CONTROL", "DATABASE", "COMMENT", "TERMINATION", "INTERFACE", "CASE", "CHANGE", "DELETE",
        "STRESS_INITIALIZATION", "PERTURBATION", "SENSOR", "PROJECT",
    },
    "measures, or is for looking at": {"ELEMENT_SEATBELT_ACCELEROMETER", "ELEMENT_PLOTEL"},
    "tables for other keywords": {
        "DEFINE", "EOS", "HOURGLASS", "INTEGRATION", "MAT_ADD", "MAT_THERMAL", "FUNCTION", "SET", "PART_ANNEAL",
        "PART_ADAPTIVE_FAILURE", "PART_SENSOR",
    },
    "the host's: what loads or touches masters is in their motion, and loads on slaves are inputs": {
        "LOAD", "RIGIDWALL", "AIRBAG", "RAIL", "DAMPING_RELATIVE", "BOUNDARY_TEMPERATURE", "BOUNDARY_CONVECTION",
        "BOUNDARY_RADIATION", "BOUNDARY_FLUX", "BOUNDARY_NON_REFLECTING",
    },
    "initial states of elements, which do not change masses": {
        "INITIAL_STRESS", "INITIAL_STRAIN", "INITIAL_FOAM_REFERENCE_GEOMETRY", "INITIAL_TEMPERATURE",
        "INITIAL_AXIAL_FORCE_BEAM", "INITIAL_HISTORY_NODE", "INITIAL_INTERNAL_DOF",
    },
}  # fmt: skip
UNTREATED = "its nodes are treated as if it were not there"
# Matter for masses or motions and are not read: each gets a warning with its line.
MATTERS = {
    "CONSTRAINED": UNTREATED,
    "BOUNDARY": "nodes that it holds or moves are not known to be held or moved",
    "ELEMENT": "its elements add no mass and make no surface",
    "ELEMENT_SHELL_SOURCE_SINK": "its elements add no mass and make no surface",
    "ELEMENT_BEAM_PULLEY": UNTREATED,
    "ELEMENT_BEAM_SOURCE": UNTREATED,
    "ELEMENT_DISCRETE_SPHERE": "its particles add no mass",
    "DEFORMABLE_TO_RIGID": "its parts are taken as they start",
    "DAMPING": "its damping is left out",
    "INCLUDE": "its file is not read",
    "INITIAL": "its start is not taken",
    "LOAD_BODY": "its acceleration is not taken; give [model] gravity",
    "LOAD_GRAVITY_PART": "its acceleration is not taken; give [model] gravity",
    "NODE": "is not read",
    "PART_DUPLICATE": "its copies are left out",
    "PART_MOVE": "its part is left where it is",
    "PART_STACKED_ELEMENTS": "its parts are left out",
    "SPECIAL": "is not read",
}
EXACT = {  # used without words behind only
    "NODE", "ELEMENT_MASS", "LOAD_BODY_X", "LOAD_BODY_Y", "LOAD_BODY_Z", "INCLUDE", "INCLUDE_TRANSFORM", "INCLUDE_PATH",
    "PARAMETER",
}  # fmt: skip
PART_WORDS = {
    "PART", "INERTIA", "REPOSITION", "CONTACT", "PRINT", "ATTACHMENT", "NODES", "AVERAGED", "FIELD", "COMPOSITE",
    "LONG", "TSHELL", "TITLE",
}  # fmt: skip
EVERY: dict[str, tuple[str, str]] = {
    **{key: ("matters", what) for key, what in MATTERS.items()},
    **{key: ("safe", why) for why, keys in SAFE.items() for key in keys},
    **dict.fromkeys(USED | FILES, ("used", "")),
}


def beginning(name: str, known) -> str | None:
    """The longest of `known` that a keyword begins with."""
    found = [key for key in known if name == key or (name.startswith(key + "_") and key not in EXACT)]
    return max(found, key=len, default=None)


def place(name: str) -> tuple[str, str]:
    """("used", ""), ("safe", why), ("matters", what) or ("unknown", "") of a keyword."""
    key = beginning(name, EVERY)
    if key is None:
        first = name.split("_")[0]
        return ("matters", MATTERS[first]) if first in MATTERS else ("unknown", "")
    if key == "PART" and set(name.split("_")) - PART_WORDS:
        return "matters", "its parts are left out"
    return EVERY[key]
