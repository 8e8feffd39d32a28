"""Which keywords of an input file are used, which are left aside and why that is safe, which are not read."""

USED = {
    "HEADING", "INCLUDE", "NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "PART", "END PART", "ASSEMBLY", "END ASSEMBLY",
    "INSTANCE", "END INSTANCE", "TIE", "SHELL SECTION", "SHELL GENERAL SECTION", "SOLID SECTION", "MEMBRANE SECTION",
    "BEAM SECTION", "BEAM GENERAL SECTION", "MATERIAL", "DENSITY", "ELASTIC", "HYPERELASTIC", "MASS", "ROTARY INERTIA",
    "SPRING", "DASHPOT", "ORIENTATION", "BOUNDARY", "DLOAD", "CLOAD", "INITIAL CONDITIONS", "RIGID BODY", "COUPLING",
    "KINEMATIC", "KINEMATIC COUPLING", "DISTRIBUTING", "MPC", "STEP", "END STEP",
    "HYPERFOAM", "USER MATERIAL", "HYPOELASTIC", "POROUS ELASTIC", "EOS", "FABRIC", "LOW DENSITY FOAM",
    "MULLINS EFFECT", "ANISOTROPIC HYPERELASTIC", "CAVITY", "ACOUSTIC MEDIUM", "GASKET THICKNESS BEHAVIOR",
}  # fmt: skip

# Left aside: why that changes nothing of the tie -> keywords.
SAFE = {
    "control and output": {
        "PREPRINT", "RESTART", "OUTPUT", "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT", "ENERGY OUTPUT",
        "INCREMENTATION OUTPUT", "INTEGRATED OUTPUT", "INTEGRATED OUTPUT SECTION", "NODE PRINT", "NODE FILE",
        "EL PRINT", "EL FILE", "ELEMENT FILE", "CONTACT PRINT", "CONTACT FILE", "FACE PRINT", "SECTION PRINT",
        "SECTION FILE", "ENERGY PRINT", "ENERGY FILE", "MODAL OUTPUT", "FILE OUTPUT", "FILE FORMAT", "FILTER",
        "MONITOR", "PRINT", "DIAGNOSTICS", "BULK VISCOSITY", "DYNAMIC", "STATIC", "FREQUENCY", "MODAL DYNAMIC",
        "BUCKLE", "HEAT TRANSFER", "COUPLED TEMPERATURE-DISPLACEMENT", "DYNAMIC TEMPERATURE-DISPLACEMENT", "VISCO",
        "STEADY STATE DYNAMICS", "ANNEAL", "CONTROLS", "SECTION CONTROLS", "SOLUTION TECHNIQUE", "SOLVER CONTROLS",
        "TIME POINTS", "PHYSICAL CONSTANTS", "CONSTRAINT CONTROLS", "NO PRINT", "USER OUTPUT VARIABLES",
        "SURFACE SECTION", "DISPLAY BODY",
    },
    "tables for other keywords, none of which is a density or an elastic modulus": {
        "AMPLITUDE", "PLASTIC", "CYCLIC HARDENING", "RATE DEPENDENT", "DAMAGE INITIATION", "DAMAGE EVOLUTION",
        "DAMAGE STABILIZATION", "SHEAR FAILURE", "TENSILE FAILURE", "EXPANSION", "CONDUCTIVITY", "SPECIFIC HEAT",
        "LATENT HEAT", "CREEP", "DEPVAR", "CRUSHABLE FOAM", "CRUSHABLE FOAM HARDENING", "VISCOELASTIC",
        "DRUCKER PRAGER", "DRUCKER PRAGER HARDENING", "CAP PLASTICITY", "CAST IRON PLASTICITY", "POTENTIAL",
        "CONCRETE DAMAGED PLASTICITY", "CONCRETE COMPRESSION HARDENING", "CONCRETE TENSION STIFFENING",
        "DEFORMATION PLASTICITY", "INELASTIC HEAT FRACTION", "FAIL STRESS", "FAIL STRAIN", "NO COMPRESSION",
        "NO TENSION", "USER DEFINED FIELD", "TRANSVERSE SHEAR STIFFNESS", "TRANSVERSE SHEAR", "HOURGLASS STIFFNESS",
        "SECTION ORIENTATION", "NORMAL", "UNIAXIAL TEST DATA", "BIAXIAL TEST DATA", "PLANAR TEST DATA",
        "VOLUMETRIC TEST DATA", "SIMPLE SHEAR TEST DATA", "CONTACT DAMPING", "FRICTION", "SURFACE BEHAVIOR",
        "SURFACE INTERACTION", "GAP CONDUCTANCE", "GAP HEAT GENERATION", "COHESIVE BEHAVIOR",
        "SURFACE PROPERTY ASSIGNMENT",
    },
    "contact is the host's": {
        "CONTACT", "CONTACT INCLUSIONS", "CONTACT EXCLUSIONS", "CONTACT PROPERTY ASSIGNMENT", "CONTACT CONTROLS",
        "CONTACT CONTROLS ASSIGNMENT", "CONTACT FORMULATION", "CONTACT INITIALIZATION ASSIGNMENT",
        "CONTACT INITIALIZATION DATA", "CONTACT CLEARANCE", "CONTACT CLEARANCE ASSIGNMENT", "CONTACT INTERFERENCE",
        "CONTACT STABILIZATION", "CLEARANCE", "GAP", "CHANGE FRICTION",
    },
    "the host's: what loads masters is in their motion, and loads on slaves are inputs": {
        "DSLOAD", "TEMPERATURE", "CFLUX", "DFLUX", "DSFLUX", "FILM", "SFILM", "RADIATE", "SRADIATE", "FIELD",
        "PRE-TENSION SECTION", "BASE MOTION", "INERTIA RELIEF", "CECHARGE", "LOAD CASE", "END LOAD CASE",
    },
    "its elements are named where they are read": {"COHESIVE SECTION", "GASKET SECTION", "CONNECTOR SECTION"},
}  # fmt: skip

# Matter for masses or motions and are not read: each gets a warning with its line.
GONE = "its nodes are treated as if it were not there"
MATTERS = {
    "EQUATION": GONE,
    "DISTRIBUTING COUPLING": GONE,
    "SHELL TO SOLID COUPLING": GONE,
    "EMBEDDED ELEMENT": GONE,
    "FASTENER": GONE,
    "FASTENER PROPERTY": GONE,
    "TIED": GONE,
    "RELEASE": GONE,
    "CYCLIC SYMMETRY MODEL": GONE,
    "CONTACT PAIR": "a contact of type TIED would bind its nodes; others are the host's",
    "NONSTRUCTURAL MASS": "its mass is left out",
    "POINT MASS": "its mass is left out",
    "BEAM ADDED INERTIA": "its mass is left out",
    "ADDED MASS": "its mass is left out",
    "SUBSTRUCTURE PROPERTY": "its mass is left out",
    "MATRIX INPUT": "its mass is left out",
    "USER ELEMENT": "its elements add no mass",
    "NODAL THICKNESS": "thicknesses are those of the sections",
    "DISTRIBUTION": "what varies by it is taken as constant",
    "DISTRIBUTION TABLE": "what varies by it is taken as constant",
    "TRANSFORM": "directions of conditions at its nodes are taken as global",
    "DAMPING": "its damping is left out",
    "FIXED MASS SCALING": "masses are those without scaling",
    "VARIABLE MASS SCALING": "masses are those without scaling",
    "MASS ADJUST": "masses are those without adjustment",
    "MODEL CHANGE": "all elements and contacts are taken as present",
    "IMPERFECTION": "nodes stay where they are written",
    "IMPORT": "what it brings is not known",
    "ADJUST": "nodes stay where they are written",
}
CONNECTORS = "connectors are not read; they are left out"
REFUSED = {
    "PARAMETER": "its values stand where numbers are read; write them out",
    "MANIFEST": "the file is made of other files that are not read; write it out",
}


def plain(name: str) -> str:
    return name.replace(" ", "").replace("-", "")


REASON = {plain(name): why for why, names in SAFE.items() for name in names}
WARNING = {plain(name): text for name, text in MATTERS.items()}
KNOWN = {plain(name) for name in USED}
REFUSED_PLAIN = {plain(name): text for name, text in REFUSED.items()}
