"""`tiefmu sweep`: cases in batches on dask.distributed."""

import argparse
import contextlib
import hashlib
import json
import logging
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..acceptance import command as acceptance
from ..acceptance.criteria import read as read_criteria
from ..arguments import check_folder_of, whole
from ..decks import is_deck
from ..errors import RunError, SceneError, UsageError, one_line
from ..results import needed
from ..scene import read_toml
from . import table, worker
from .design import Case, Sweep, cases, read, variant
from .journal import Journal

BATCH = 100  # cases a task at most: the scheduler's part of a case stays below 0.1 ms
AHEAD = 4  # tasks a worker waiting, so that 1e6 cases need no memory
TRIED = 10  # variants that may fail before the sweep is given up, if no other was built
RETRIES = 3  # of the cases of a worker that died


def add_parser(commands) -> None:
    sweep = commands.add_parser(
        "sweep",
        help="run variants of a scene, on this machine or a cluster",
        description="Runs the cases of a sweep file as FMUs on dask.distributed and writes a table with a row a case: "
        "parameters, the numbers of the criteria, signals. docs/sweep.md.",
        epilog="example: tiefmu sweep sweep.toml -o results.parquet --workers 8",
    )
    sweep.add_argument("sweep", metavar="SWEEP", type=Path, help="sweep file (TOML)")
    sweep.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="table, .parquet or .csv")
    sweep.add_argument("--workers", metavar="N", type=whole, help="processes here (default: one a core)")
    sweep.add_argument("--scheduler", metavar="TCP", help="an existing scheduler, tcp://HOST:PORT")
    sweep.add_argument("--resume", action="store_true", help="go on with what an interrupted run has finished")
    sweep.set_defaults(command=run_sweep)


def run_sweep(options: argparse.Namespace) -> int:
    needed("distributed", "sweep", "tiefmu sweep")
    check_folder_of(options.output)
    name, folder = str(options.sweep), options.sweep.parent
    sweep = read(options.sweep)
    table.check(options.output, bool(sweep.signals))
    todo = cases(sweep, name)
    check_columns(sweep, folder, name)
    task = shared(sweep, folder, name)
    raw, files = scene_of(sweep, folder)
    first_variant(raw, files, task, sweep, todo, name)
    journal = Journal(
        options.output.with_name(f".{options.output.name}.journal"), digest(task, raw, files, todo), options.resume
    )
    left = [case for case in todo if case.number not in journal.rows]
    try:
        if left:
            with client(options.scheduler, options.workers) as connected:
                run_cases(connected, sweep, task, raw, files, left, len(todo), journal)
    except KeyboardInterrupt:
        print(
            f"{options.output}: interrupted, {len(journal.rows)} of {len(todo)} cases are finished; --resume goes on "
            "with the others",
            file=sys.stderr,
        )
        raise
    finally:
        journal.close()
        if not journal.rows:
            journal.path.unlink()
    rows = [journal.rows[case.number] for case in todo]
    parameters = {p.title: [case.values[k] for case in todo] for k, p in enumerate(sweep.parameter)}
    table.write(options.output, parameters, rows)
    journal.path.unlink(missing_ok=True)
    stopped = sum(bool(row["message"]) for row in rows)
    failed = sum(row.get("passed") is False for row in rows)
    print(
        f"{options.output}: {len(rows)} cases"
        + (f", {failed} failed their criteria" if failed else "")
        + (f", {stopped} stopped (see the column message)" if stopped else "")
    )
    return 0


def check_columns(sweep: Sweep, folder: Path, name: str) -> None:
    """Raises UsageError where two columns of the table would have the same name."""
    criteria = read_criteria(folder / sweep.criteria).labels if sweep.criteria else []
    names = [("parameter", p.title) for p in sweep.parameter] + [("criterion", label) for label in criteria]
    seen = dict.fromkeys(("case", "passed", "time", "message"), "column") | dict.fromkeys(sweep.signals, "signal")
    for kind, label in names:
        if label in seen:
            raise UsageError(f"{name}: {kind} '{label}': the table has a {seen[label]} of that name; name it otherwise")
        seen[label] = kind


def shared(sweep: Sweep, folder: Path, name: str) -> worker.Task:
    criteria = {}
    if sweep.criteria:
        packed = acceptance.packed(folder / sweep.criteria)
        criteria = {path.removeprefix(acceptance.FOLDER + "/"): data for path, data in packed.items()}
    files = {}
    run = sweep.run.model_copy()
    if run.input:
        files["sweep_input.csv"] = (folder / run.input).read_bytes()
        run.input = "sweep_input.csv"
    return worker.Task(sweep.parameter, criteria, sweep.signals, run, files)


def scene_of(sweep: Sweep, folder: Path) -> tuple[dict | bytes, dict[str, bytes]]:
    """The scene as tables, with the files that it or a parameter names; or the FMU. Raises UsageError."""
    path = folder / sweep.scene
    if path.suffix.lower() == ".fmu":
        return path.read_bytes(), {}
    if is_deck(path):
        raise UsageError(f"{path}: is a deck, which has no keys that vary; tiefmu import makes a scene of it")
    try:
        raw = read_toml(path)
    except SceneError as error:
        raise UsageError(f"{path}: {error}") from None
    mesh = raw.get("mesh", {}) if isinstance(raw.get("mesh"), dict) else {}
    named = [mesh.get(key) for key in worker.MESH_FILES]
    for parameter in sweep.parameter:
        if parameter.scene in [f"mesh.{key}" for key in worker.MESH_FILES]:
            named += parameter.values or []
    given = [file for file in named if isinstance(file, str) and (path.parent / file).is_file()]
    return raw, {file: (path.parent / file).read_bytes() for file in given}


def first_variant(raw: dict | bytes, files: dict, task: worker.Task, sweep: Sweep, todo: list[Case], name: str) -> None:
    """What is wrong with all cases, or with the first TRIED variants, is said before any runs. Raises UsageError."""
    data: bytes | str = raw if isinstance(raw, bytes) else ""
    if not isinstance(raw, bytes):
        message, tried = "", set()
        for case in todo:
            key = scene_key(sweep, case)
            if key in tried:
                continue
            if len(tried) == TRIED:
                break
            tried.add(key)
            try:
                data = worker.build_variant(variant(raw, sweep, case.values), files)
            except UsageError as error:
                raise UsageError(f"{name}: parameter {error}") from None
            if isinstance(data, bytes):
                break
            message = message or f"{name}: case {case.number}: {data}"
    if isinstance(data, str):
        raise UsageError(message)
    try:
        worker.Ready(data, task).close()
    except (UsageError, RunError) as error:
        raise UsageError(f"{name}: {error}") from None


def digest(task: worker.Task, raw: dict | bytes, files: dict[str, bytes], todo: list[Case]) -> str:
    found = hashlib.sha256()
    for part in (task.criteria, task.files, files):
        for path, data in sorted(part.items()):
            found.update(path.encode() + b"\0" + hashlib.sha256(data).digest())
    found.update(raw if isinstance(raw, bytes) else json.dumps(raw, sort_keys=True, default=str).encode())
    found.update(json.dumps([task.signals, task.run.model_dump(), [case.values for case in todo]]).encode())
    found.update(json.dumps([parameter.model_dump() for parameter in task.parameters]).encode())
    return found.hexdigest()


@contextlib.contextmanager
def client(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """Raises UsageError where there is no such scheduler."""
    import dask
    from distributed import Client, LocalCluster

    quiet = {
        "distributed.logging.distributed": "error",
        "distributed.scheduler.allowed-failures": RETRIES,
        "distributed.worker.profile.enabled": False,  # it looks at the stack of every worker 100 times a second
        "distributed.admin.system-monitor.interval": "10s",
    }
    with dask.config.set(quiet):
        if scheduler:
            try:
                with Client(scheduler, timeout=10) as connected:
                    yield connected
            except OSError as error:
                raise UsageError(f"--scheduler {scheduler}: {error or 'no answer'}") from None
            return
        with sheltered():
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )  # fmt: skip
        with cluster, Client(cluster) as connected:
            yield connected


@contextlib.contextmanager
def sheltered() -> Iterator[None]:
    """Ctrl-C is for this process, which ends its workers: threads and processes begun inside never see it, this thread
    sees it afterwards."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # where the first process starts it, it unblocks signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def run_cases(
    connected: Any, sweep: Sweep, task: worker.Task, raw: dict | bytes, files: dict, left: list[Case], total: int,
    journal: Journal,
) -> None:  # fmt: skip
    """Batches of cases of one variant, so many at a time that all workers have work."""
    from distributed import as_completed
    from tqdm import tqdm

    batches = batched(sweep, left)
    # Not by scatter: what a lost worker held is then lost, while a task is done again.
    sent_task, sent_files = (connected.submit(worker.given, data, pure=False) for data in (task, files))
    given = connected.submit(worker.given, raw, pure=False) if isinstance(raw, bytes) else None
    variants: dict[str, Any] = {}
    running: dict[Any, list[Case]] = {}
    done = as_completed()

    def submit(batch: list[Case], again: bool = False) -> None:
        fmu = given
        if fmu is None:
            key = scene_key(sweep, batch[0])
            if key not in variants:
                while len(variants) > 4 * BATCH:
                    variants.pop(next(iter(variants)))  # what is needed lives on in the tasks that wait for it
                assert isinstance(raw, dict)
                made = variant(raw, sweep, batch[0].values)
                variants[key] = connected.submit(worker.build_variant, made, sent_files, pure=False)
            fmu = variants[key]
        pairs = [(case.number, case.values) for case in batch]
        future = connected.submit(worker.run_batch, fmu, sent_task, pairs, pure=False)
        running[future] = batch
        done.add(future)

    with tqdm(total=total, initial=total - len(left), unit="case", delay=1, disable=None, leave=False) as bar:

        def fill() -> None:
            most = AHEAD * max(1, len(connected.ncores()))
            while len(running) < most:
                batch = next(batches, None)
                if batch is None:
                    return
                submit(batch)

        fill()
        while running:
            future = next(done)
            batch = running.pop(future)
            try:
                rows = future.result()
            except Exception as error:  # KilledWorker: a case takes its worker down; which one, is found alone
                if len(batch) > 1:
                    for case in batch:
                        submit([case])
                    continue
                rows = [(batch[0].number, {"message": f"its worker died: {one_line(error)[:200]}"})]
            journal.add(rows)
            bar.update(len(rows))
            fill()


def scene_key(sweep: Sweep, case: Case) -> str:
    return json.dumps([value for p, value in zip(sweep.parameter, case.values) if p.scene])


def batched(sweep: Sweep, left: list[Case]) -> Iterator[list[Case]]:
    """Cases of one variant together, at most BATCH; small sweeps in smaller ones, so that each worker gets some."""
    groups: dict[str, list[Case]] = {}
    for case in left:
        groups.setdefault(scene_key(sweep, case), []).append(case)
    size = max(1, min(BATCH, len(left) // 32))
    for group in groups.values():
        for first in range(0, len(group), size):
            yield group[first : first + size]
