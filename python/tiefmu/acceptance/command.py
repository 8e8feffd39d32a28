"""`tiefmu accept`, and the criteria inside an FMU."""

import argparse
from pathlib import Path

from .. import run as running
from ..arguments import check_folder_of, positive
from ..errors import RunStopped, UsageError
from ..fmu_instance import Fmu, Instance
from ..models import fmu_of
from . import junit, pictures
from .criteria import files, read
from .judge import Judge, Judgement

FOLDER = "extra/tiefmu/acceptance"  # inside an FMU
FILE = "criteria.toml"


def add_parser(commands) -> None:
    accept = commands.add_parser(
        "accept",
        help="run a scene or an FMU and judge it by criteria",
        description="Runs the FMU and judges it: signals against references, limits, health. Prints a table. Exit "
        "status 0: passed, 1: failed, 2: bad input. Criteria: docs/acceptance.md.",
        epilog="example: tiefmu accept weld.fmu criteria.toml --input test17.csv --junit weld.xml --pictures out/weld",
    )
    accept.add_argument("model", metavar="SCENE-or-FMU", help="scene (TOML), deck or FMU")
    accept.add_argument(
        "criteria", metavar="CRITERIA", type=Path, nargs="?", help="criteria (TOML); default: those inside the FMU"
    )
    accept.add_argument("--input", metavar="CSV", type=Path, help="inputs over time (default: of the criteria)")
    accept.add_argument("--stop-time", metavar="T", type=positive, help="end, s (default: of the criteria)")
    accept.add_argument("--step", metavar="H", type=positive, help="communication step, s (default: of the criteria)")
    accept.add_argument("--junit", metavar="FILE", type=Path, help="file to write the verdicts to, as JUnit XML")
    accept.add_argument("--pictures", metavar="DIR", type=Path, help="folder to write a picture per criterion to")
    accept.set_defaults(command=run_accept)


def run_accept(options: argparse.Namespace) -> int:
    if options.junit:
        check_folder_of(options.junit)
        if options.junit.is_dir():
            raise UsageError(f"{options.junit}: is a folder; give a file")
    if options.pictures and options.pictures.exists() and not options.pictures.is_dir():
        raise UsageError(f"{options.pictures}: is a file; give a folder")
    with fmu_of(options.model) as (path, _), Fmu(path, options.model) as fmu:
        criteria, folder, name = options.criteria, None, str(options.criteria)
        if criteria is None:
            criteria, name = fmu.folder / FOLDER / FILE, f"{options.model}: {FILE}"
            if not criteria.is_file():
                raise UsageError(f"{options.model}: holds no criteria; give them as a file, or to `tiefmu build`")
        folder = criteria.parent
        judge = Judge(fmu, read(criteria), folder, name)
        plan = judge.plan(options.stop_time, options.step, options.input)
        instance = Instance(fmu, judge.outputs)
        try:
            with running.progress(plan) as bar:
                judgement = judge.judge(instance, plan, bar)
        except RunStopped as error:
            judgement = judge.stopped(str(error))
        finally:
            instance.free()
    print(*table(options.model, judge.criteria.title, judgement), sep="\n")
    if options.junit:
        seconds = judgement.result.seconds if judgement.result else 0.0
        junit.write(options.junit, Path(options.model).stem, judgement.verdicts, seconds)
    if options.pictures:
        pictures.draw(judgement.verdicts, options.pictures)
    return 0 if judgement.passed else 1


def table(model: str, title: str, judgement: Judgement) -> list[str]:
    result, verdicts = judgement.result, judgement.verdicts
    lines = [f"{model}: {title}" if title else model]
    if result:
        lines[0] += f": {result.steps} steps to t = {result.last[0]:g} s in {result.seconds:.3g} s"
    width = max(len(verdict.name) for verdict in verdicts)
    for verdict in verdicts:
        word = "passed" if verdict.passed else "FAILED"
        lines.append(f"  {word}  {verdict.name:<{width}}  {pictures.number(verdict):<14} {verdict.asked}")
        if verdict.where:
            lines.append(f"{'':<{width + 12}}{verdict.where}")
    failed = sum(not verdict.passed for verdict in verdicts)
    lines.append(f"{len(verdicts)} criteria, {failed} failed" if failed else f"all {len(verdicts)} criteria passed")
    return lines


def packed(path: Path) -> dict[str, bytes]:
    """What `tiefmu build --criteria` puts into the FMU: the criteria and the files they name. Raises UsageError."""
    criteria = read(path)
    found = {f"{FOLDER}/{FILE}": path.read_bytes()}
    for name in files(criteria):
        if Path(name).is_absolute() or ".." in Path(name).parts or "\\" in name:
            raise UsageError(f"{path}: {name}: must lie beside the criteria or below, to be packed with them")
        found[f"{FOLDER}/{Path(name).as_posix()}"] = (path.parent / name).read_bytes()
    return found
