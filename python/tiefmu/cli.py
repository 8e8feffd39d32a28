"""The command line: build, info, run, accept, report, sweep, demo, import, study, advise."""

import argparse
import contextlib
import io
import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from . import __version__, advise, study
from .acceptance import command as accept_command
from .arguments import Parser, check_ending, check_folder_of, existing, is_fmu, positive, whole
from .binaries import libraries, stale
from .decks import command as import_command
from .demo import SCENES, demo
from .errors import RunError, SceneError, UsageError
from .loading import load
from .models import fmu_of, show_warnings
from .package import build
from .platforms import BY_FOLDER
from .plot import check_picture, plot
from .report import counted, lumping_line, of_fmu, report, summary, text
from .results import check_format
from .run import run
from .sweep import command as sweep_command
from .view import page as report_command
from .view.vtk import FIELDS, FRAMES, NODE_FIELDS, write_ties

SHOWN = 20  # outputs that `run` prints


def main(arguments: list[str] | None = None) -> int:
    """Runs a command; returns the exit status: 0, 1 (a check or a criterion failed), 2 (bad input), 130 (Ctrl-C)."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # of another encoding, as files on Windows: ? for what it lacks
        sys.stdout.reconfigure(errors="replace")
    options = parser().parse_args(arguments)
    try:
        status = options.command(options) or 0
        sys.stdout.flush()
        return status
    except (SceneError, UsageError, RunError) as error:
        return fail(str(error))
    except BrokenPipeError:  # somebody reads no further, as in `tiefmu info weld.toml | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        return fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except KeyboardInterrupt:
        return 130


def fail(message: str) -> int:
    print(f"error: {message}", file=sys.stderr)
    return 2


def parser() -> argparse.ArgumentParser:
    top = Parser(
        prog="tiefmu",
        description="Puts the tied interface of an explicit crash code into an FMI 2.0 or 3.0 "
        "co-simulation FMU. A scene is a TOML file; see scenes/ for examples.",
    )
    top.add_argument("--version", action="version", version=f"tiefmu {__version__}")
    commands = top.add_subparsers(required=True, metavar="COMMAND")

    build = commands.add_parser(
        "build",
        help="write the FMU of a scene",
        description="Reads, checks and searches the scene and writes its FMU.",
        epilog="example: tiefmu build weld.toml -o out/weld.fmu",
    )
    build.add_argument("scene", metavar="SCENE", help="scene file (TOML)")
    build.add_argument(
        "-o",
        "--output",
        metavar="FMU",
        type=Path,
        help="file to write (default: name of the scene + .fmu, in the current folder)",
    )
    build.add_argument(
        "--criteria", metavar="TOML", type=Path, help="criteria of acceptance to put into the FMU, with their files"
    )
    build.add_argument(
        "--platforms",
        metavar="NAMES",
        action="extend",
        type=lambda text: [name.strip() for name in text.split(",")],
        help=f"systems that the FMU is for, of {', '.join(BY_FOLDER)} (default: this one, linux64 and win64, "
        "in a checkout as far as `make binaries` has built them)",
    )
    build.add_argument(
        "--fmi",
        type=int,
        choices=(2, 3),
        default=2,
        help="version of the standard (default: 2); 3 has arrays for large ties",
    )
    build.set_defaults(command=run_build)

    info = commands.add_parser(
        "info",
        help="report how the slaves are tied, limits, what was left out",
        description="Prints the tie report of a scene, or the one that an FMU carries.",
        epilog="example: tiefmu info weld.toml --vtu ties.vtu",
    )
    info.add_argument("model", metavar="SCENE-or-FMU", help="scene (TOML), deck, or FMU made by tiefmu")
    info.add_argument("--json", action="store_true", help="the whole report as JSON")
    info.add_argument(
        "--vtu", metavar="VTU", type=Path, help="file to write the ties to, for ParaView: segments, slaves, projections"
    )
    info.add_argument(
        "--fields", metavar="NAME", nargs="+", help=f"of --vtu, default all: {', '.join([*FIELDS, *NODE_FIELDS])}"
    )
    info.set_defaults(command=run_info)

    run = commands.add_parser(
        "run",
        help="co-simulate a scene or an FMU with FMPy",
        description="Co-simulates with FMPy. CSV columns are `time` (s) and variable names such as slave[1].f[3], SI "
        "units; inputs without a column keep their start value, and are linear between the rows.",
        epilog="example: tiefmu run weld.fmu --input in.csv --output out.csv --plot out.png",
    )
    run.add_argument("model", metavar="SCENE-or-FMU", help="scene (TOML), deck or FMU")
    run.add_argument("--stop-time", metavar="T", type=positive, help="end, s (default: of the input, or of the FMU)")
    run.add_argument(
        "--step", metavar="H", type=positive, help="communication step, s (default: the FMU's, but at least 500 steps)"
    )
    run.add_argument("--input", metavar="CSV", type=Path, help="inputs over time")
    run.add_argument(
        "--output",
        metavar="FILE",
        type=Path,
        help="file to write the outputs to, row by row: .csv, .parquet or .h5 (for many variables)",
    )
    run.add_argument("--plot", metavar="PNG", type=Path, help="file to draw the outputs to, .png or .svg")
    run.add_argument(
        "--pvd",
        metavar="PVD",
        type=Path,
        help="file for ParaView: the moving mesh over time, with velocities and reactions; its VTU files lie in the "
        "folder PVD_frames",
    )
    run.add_argument("--frames", metavar="N", type=whole, help=f"most frames of --pvd (default: {FRAMES})")
    run.set_defaults(command=run_run)

    demo = commands.add_parser(
        "demo",
        help="build and run the example scenes",
        description="Builds the example scenes, runs each as an FMU, prints a summary, writes "
        "FMUs, CSVs and pictures. Inputs come from NAME.csv beside NAME.toml.",
        epilog="example: tiefmu demo --out out",
    )
    demo.add_argument("--out", metavar="DIR", type=Path, default=Path("out"), help="folder to write to (default: out)")
    demo.add_argument("--scenes", metavar="DIR", type=Path, help="folder of the scenes (default: the examples)")
    demo.set_defaults(command=run_demo)

    accept_command.add_parser(commands)
    report_command.add_parser(commands)
    sweep_command.add_parser(commands)
    import_command.add_parser(commands)
    study.add_parser(commands)
    advise.add_parser(commands)
    return top


def run_build(options: argparse.Namespace) -> None:
    scene = load(options.scene)
    criteria = accept_command.packed(options.criteria) if options.criteria else {}
    fmu = build(scene, options.output or Path(f"{scene.name}.fmu"), criteria, options.platforms, options.fmi)
    found = report(scene, arrays=options.fmi == 3)
    show_warnings(options.scene, found)
    if left := [name for name in stale() if not options.platforms or name in options.platforms]:
        print(
            f"warning: libraries for {', '.join(left)} are left out: they were made from other sources; run "
            "`make binaries` again",
            file=sys.stderr,
        )
    systems = ", ".join(library.text for library in libraries(options.platforms))
    arrays = " as arrays" if options.fmi == 3 else ""
    print(f"{fmu}: {summary(found)}{arrays}, {fmu.stat().st_size / 1024:.0f} KiB, for {systems}")
    if found["lumping"]:
        print(lumping_line(found["lumping"]))
    if found["notes"]:
        print(f"{counted(len(found['notes']), 'note')} on the scene: tiefmu info {options.scene}")


@contextlib.contextmanager
def stages(count: int) -> Iterator[Callable[[str], None]]:
    """A progress bar of so many stages, for what takes seconds; what is yielded begins the one that it names."""
    from tqdm import tqdm

    form = "{desc} |{bar}| {n_fmt} of {total_fmt}, {elapsed}"
    with tqdm(total=count, delay=2, disable=None, leave=False, bar_format=form, initial=-1) as bar:

        def begin(name: str) -> None:
            bar.set_description(name, refresh=False)
            bar.update()

        yield begin


def run_info(options: argparse.Namespace) -> None:
    if options.vtu:
        check_ending(options.vtu, ".vtu")
        check_folder_of(options.vtu)
    elif options.fields:
        raise UsageError("--fields: needs --vtu, the file whose fields they are")
    with stages(3 if options.vtu else 2) as stage:
        if is_fmu(options.model):
            found = of_fmu(existing(options.model))
        else:
            stage("reading and searching")
            scene = load(options.model)
            stage("report")
            found = report(scene, positions=bool(options.vtu))
        if options.vtu:
            stage(f"writing {options.vtu}")
            write_ties(found, options.vtu, options.fields)
    if options.json:
        json.dump(found, sys.stdout, allow_nan=False)
        print()
    else:
        print(text(options.model, found), end="")
        if options.vtu:
            print(f"wrote {options.vtu}")


def run_run(options: argparse.Namespace) -> None:
    files = [path for path in (options.output, options.plot, options.pvd) if path]
    for path in files:
        check_folder_of(path)
    if options.output:
        check_format(options.output)
    if options.plot:
        check_picture(options.plot)
    if options.pvd:
        check_ending(options.pvd, ".pvd")
    elif options.frames is not None:
        raise UsageError("--frames: needs --pvd, the file whose frames they are")
    pvd = (options.pvd, options.frames or FRAMES) if options.pvd else None
    with fmu_of(options.model, positions=pvd is not None) as (fmu, scene):
        result, found = run(
            fmu, options.stop_time, options.step, options.input, options.model, options.output, pvd, scene
        )
    if options.plot:
        plot(result, options.plot, Path(options.model).stem)
    print(
        f"{options.model}: {result.steps} steps to t = {result.last[0]:g} s, {counted(len(result.names), 'output')}"
        + "".join(f", wrote {path}" for path in files)
    )
    print(*found, sep="\n")
    if not files:
        for name, low, high, last in zip(result.names[:SHOWN], result.low[1:], result.high[1:], result.last[1:]):
            print(f"  {name:<24} from {low:<12.6g} to {high:<12.6g} at the end {last:.6g}")
        if len(result.names) > SHOWN:
            print(f"  ... and {len(result.names) - SHOWN} more (--output writes all)")


def run_demo(options: argparse.Namespace) -> int:
    return 0 if demo(options.out, options.scenes or SCENES) else 1


if __name__ == "__main__":
    sys.exit(main())
