"""Studies: speed against accuracy, coupling to a host, stability. One module each, with charts, tables and a page."""

from . import coupling, speed_accuracy, stability


def add_parser(commands):
    """Registers `study` with its sub-commands."""
    study = commands.add_parser(
        "study",
        help="speed, accuracy and stability, measured",
        description="Measures speed against accuracy, coupling and stability; writes CSV, charts and a page.",
        epilog="example: tiefmu study coupling scenes/heavy_slave.toml",
    )
    studies = study.add_subparsers(required=True, metavar="STUDY")
    for module in (speed_accuracy, coupling, stability):
        module.add_parser(studies)
