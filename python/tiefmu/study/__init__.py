"""Studies: speed against accuracy, coupling to a host, stability. One module each, with charts, tables and a page."""

import importlib
from importlib.util import find_spec


def add_parser(commands):
    """Registers `study` with its sub-commands."""
    study = commands.add_parser("study", help="speed, accuracy and stability, measured",
                                description="Measures speed against accuracy, coupling and stability; writes CSV, "
                                "charts and a page.")
    studies = study.add_subparsers(required=True, metavar="STUDY")
    for name in ("speed_accuracy", "coupling", "stability"):
        if find_spec(f"{__name__}.{name}"):
            importlib.import_module(f".{name}", __name__).add_parser(studies)
