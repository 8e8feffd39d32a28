"""`tiefmu sweep` that is interrupted, goes on, or loses a worker."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import sweep_files
from sweep_files import SWEEP, in_this_process, rows
from tiefmu.cli import main
from tiefmu.errors import UsageError
from tiefmu.sweep import command
from tiefmu.sweep.journal import Journal


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sweep_files.write()
    return tmp_path


def test_going_on_after_an_interruption(folder, monkeypatch):
    add = command.Journal.add

    def interrupted(journal, found):
        add(journal, found)
        if len(journal.rows) >= 5:
            raise KeyboardInterrupt

    monkeypatch.setattr(command.Journal, "add", interrupted)
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--workers", "1"]) == 130
    journal = Path(".out.parquet.journal")
    done = len(journal.read_text().splitlines()) - 1
    assert 5 <= done < 12 and not Path("out.parquet").exists()
    journal.write_text(journal.read_text() + '[11, {"pe')  # cut in the middle of a line
    seen = []

    def counted(journal, found):
        seen.extend(found)
        add(journal, found)

    monkeypatch.setattr(command.Journal, "add", counted)
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--workers", "1", "--resume"]) == 0
    assert len(seen) == 12 - done
    assert not journal.exists()
    for row, whole in zip(rows(), in_this_process(SWEEP), strict=True):
        assert {key: row[key] for key in whole} == whole


def test_ctrl_c_says_how_to_go_on(folder):
    """As a terminal does it: to all processes of the sweep. One line, no traceback of a worker."""
    Path("sweep.toml").write_text(SWEEP.replace("[0.5, 1.0, 2.0]", str([0.1 * k for k in range(1, 601)])))
    sweep = subprocess.Popen(
        [sys.executable, "-m", "tiefmu.cli", "sweep", "sweep.toml", "-o", "out.parquet", "--workers", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # ignored in a job in the background
    )
    try:
        wait_for(lambda: journal_rows() > 10 or sweep.poll() is not None)
        os.killpg(sweep.pid, signal.SIGINT)
        out, error = sweep.communicate(timeout=120)
    finally:
        if sweep.poll() is None:
            os.killpg(sweep.pid, signal.SIGKILL)
    assert (sweep.returncode, out) == (130, "")
    done = journal_rows()
    assert error == f"out.parquet: interrupted, {done} of 2400 cases are finished; --resume goes on with the others\n"


def test_finished_cases_are_not_thrown_away(folder, capsys):
    """Without --resume, with a damaged journal."""
    journal = Path(".out.parquet.journal")
    journal.write_text('{"sweep": "x"}\n[0, {"peak": 1.0, "message": ""}]\n')
    before = journal.read_bytes()
    assert main(["sweep", "sweep.toml", "-o", "out.parquet"]) == 2
    assert capsys.readouterr().err == (
        "error: .out.parquet.journal: holds 1 finished cases of an interrupted sweep; --resume goes on with them, "
        "without this file it starts anew\n"
    )
    for damaged in (b"\xff\n", b"[]\n", b"7\n", b'["x", {}]\n', b'[1, "x"]\n'):
        journal.write_bytes(b'{"sweep": "x"}\n' + damaged)
        with pytest.raises(UsageError) as error:
            Journal(journal, "x", True)
        assert str(error.value) == ".out.parquet.journal: line 2: is damaged; remove it to lose but its case"
        assert journal.read_bytes().endswith(damaged)
    journal.write_bytes(before)
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--resume"]) == 2
    assert "is of another sweep" in capsys.readouterr().err
    assert journal.read_bytes() == before


def test_a_worker_that_is_killed_in_mid_sweep(folder):
    """Scheduler and workers are processes of their own; one worker dies at its first rows."""
    Path("sweep.toml").write_text(SWEEP.replace("[0.5, 1.0, 2.0]", str([0.1 * k for k in range(1, 61)])))
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    processes = [
        subprocess.Popen([*dask, "--port", "0", "--no-dashboard", "--scheduler-file", "scheduler.json"], **quiet)
    ]
    try:
        wait_for(lambda: Path("scheduler.json").exists() and Path("scheduler.json").read_text().endswith("}"))
        address = json.loads(Path("scheduler.json").read_text())["address"]
        start = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
        workers = [subprocess.Popen([*start, "--no-nanny"], **quiet) for _ in range(2)]
        processes += workers
        sweep = subprocess.Popen(
            [sys.executable, "-m", "tiefmu.cli", "sweep", "sweep.toml", "-o", "out.parquet", "--scheduler", address],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(sweep)
        wait_for(lambda: journal_rows() > 10)
        workers[0].send_signal(signal.SIGKILL)
        assert journal_rows() < 240 and sweep.poll() is None
        out, error = sweep.communicate(timeout=120)
        assert sweep.returncode == 0, error
        assert "240 cases" in out
    finally:
        for process in processes:
            process.kill()
            process.wait()
    found = rows()
    assert not any(row["message"] for row in found)
    for row, expected in zip(found, in_this_process(Path("sweep.toml").read_text())):
        assert {key: row[key] for key in expected} == expected


def journal_rows() -> int:
    path = Path(".out.parquet.journal")
    return len(path.read_text().splitlines()) - 1 if path.exists() else 0


def wait_for(holds, seconds=120.0) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)
