"""The command `tiefmu import`."""

import sys
from pathlib import Path

from ..errors import UsageError
from . import import_deck


def add_parser(commands):
    command = commands.add_parser(
        "import",
        help="write the scene of a finite-element deck's ties",
        description="Reads the ties of a Radioss, Abaqus, CalculiX or LS-DYNA deck, with the masses, inertias, "
        "stiffnesses and rotations that the solver would give their nodes, and writes a scene file, with mesh and node "
        "properties beside it. What was decided and why stands at the head of the scene file.",
        epilog="example: tiefmu import crash.k --tie 'lower weld' -o weld.toml",
    )
    command.add_argument("deck", metavar="DECK", type=Path, help="deck, e.g. model_0000.rad, job.inp or crash.k")
    command.add_argument(
        "--tie",
        metavar="NAME",
        action="append",
        help="title or id of a tie to take; may be given several times (default: all)",
    )
    command.add_argument(
        "--free",
        metavar="NAME",
        action="append",
        default=[],
        help="title or id of a part, instance or node set whose masters the FMU moves itself; may be given several "
        "times (default: the host moves all masters)",
    )
    command.add_argument(
        "-o", "--output", metavar="SCENE", type=Path, help="scene file to write (default: name of the deck + .toml)"
    )
    command.set_defaults(command=run)


def run(options):
    output = options.output or Path(f"{options.deck.stem}.toml")
    if output.suffix.lower() != ".toml":
        raise UsageError(f"{output}: a scene file is called NAME.toml")
    found = import_deck(options.deck, output, options.tie, tuple(options.free))
    for line in found.deck.warnings:
        print(f"warning: {line}", file=sys.stderr)
    scene = found.scene
    print(
        f"{output}: {plural(len(scene.tables['tie']), 'tie')}, {plural(len(scene.node_id), 'node')}, "
        f"{plural(len(scene.segment_id), 'segment')}, {plural(len(scene.tables.get('spring', [])), 'spring')}; "
        f"with {output.stem}.mesh.npz and {output.stem}.nodes.csv"
    )


def plural(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
