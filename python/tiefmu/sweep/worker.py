"""What runs on a worker: the FMU of a variant is built once and unpacked once; instances are reset between cases."""

import copy
import hashlib
import tempfile
import threading
import uuid
from pathlib import Path

import numpy as np

from ..acceptance.criteria import read
from ..acceptance.judge import Judge
from ..errors import RunError, SceneError, StepTooLong, UsageError
from ..fmu_instance import Fmu, Instance
from ..loading import load
from ..package import build
from ..run import experiment, simulate
from ..schema import suggestion
from ..signals import Experiment

MESH_FILES = ("file", "properties")  # keys of [mesh] that name files
KEPT = 16  # unpacked FMUs that a thread of a worker holds
_here = threading.local()  # an instance belongs to one thread


def given(data):
    """What the client has, as a task: a worker gets it once."""
    return data


def build_variant(raw: dict, files: dict[str, bytes]) -> bytes | str:
    """The FMU of a scene as bytes, or the message of what is wrong with it. files: what the scene names."""
    with tempfile.TemporaryDirectory(prefix="tiefmu-") as folder:
        places = {}  # none outside the folder, wherever the scene has its files
        for number, (name, data) in enumerate(files.items()):
            places[name] = f"{number}/{Path(name).name}"
            (Path(folder) / str(number)).mkdir()
            (Path(folder) / places[name]).write_bytes(data)
        if isinstance(raw.get("mesh"), dict):
            named = {key: raw["mesh"].get(key) for key in MESH_FILES}
            moved = {key: places[name] for key, name in named.items() if isinstance(name, str) and name in places}
            raw = raw | {"mesh": raw["mesh"] | moved}
        try:
            scene = load(raw, folder=Path(folder))
            return build(scene, Path(folder) / "variant.fmu").read_bytes()
        except (SceneError, UsageError) as error:
            return str(error)


class Task:
    """What all cases of a sweep share. criteria: path -> bytes of the criteria and their files; run: stop time, step,
    name of the input among `files`; key: its own."""

    def __init__(self, parameters, criteria: dict[str, bytes], signals: list[str], run, files: dict[str, bytes]):
        self.parameters, self.criteria, self.signals, self.run, self.files = parameters, criteria, signals, run, files
        self.key = uuid.uuid4().hex


class Ready:
    """An unpacked FMU with an instance, and all that its cases need."""

    def __init__(self, data: bytes, task: Task):
        self._folder = tempfile.TemporaryDirectory(prefix="tiefmu-")
        self.folder = Path(self._folder.name)
        (self.folder / "variant.fmu").write_bytes(data)
        for name, content in (task.criteria | task.files).items():
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        self.fmu = Fmu(self.folder / "variant.fmu", "FMU")
        self.fmu.__enter__()
        inputs = self.folder / task.run.input if task.run.input else None
        if task.criteria:
            path = self.folder / "criteria.toml"
            self.judge: Judge | None = Judge(self.fmu, read(path), self.folder, "criteria")
            plan = self.judge.plan(task.run.stop_time, task.run.step, inputs)
            wanted = set(self.judge.outputs) | set(task.signals)
        else:
            self.judge = None
            plan, wanted = experiment(self.fmu, task.run.stop_time, task.run.step, inputs), set(task.signals)
        self.plan = plan
        known = self.fmu.outputs()
        missing = next((name for name in task.signals if name not in known), None)
        if missing:
            raise UsageError(f"signals: '{missing}': no such output{suggestion(missing, known)}")
        for parameter in task.parameters:
            settable = [v.name for v in self.fmu.variables.values() if v.causality in ("input", "parameter")]
            if parameter.start and parameter.start not in settable:
                what = f"start '{parameter.start}': no input or parameter of the FMU"
                raise UsageError(f"{what}{suggestion(parameter.start, settable)}")
            if parameter.input and not plan.inputs.names:
                raise UsageError(f"input '{parameter.input}': there is no input to vary; name one in [run]")
            if parameter.input and parameter.input not in ("*", *plan.inputs.names):
                what = f"input '{parameter.input}': no column of the input"
                raise UsageError(f"{what}{suggestion(parameter.input, plan.inputs.names)}")
        self.outputs = [name for name in known if name in wanted]
        if self.judge:
            self.judge.outputs = self.outputs
        self.instance: Instance | None = None

    def close(self) -> None:
        if self.instance:
            self.instance.free()
        self.fmu.__exit__()
        self._folder.cleanup()

    def run(self, task: Task, values: list) -> dict:
        """A row of the table: numbers, passed, message. A run that stops is a row with its message."""
        factors = np.ones(len(self.plan.inputs.names))
        start_values = {}
        for parameter, value in zip(task.parameters, values):
            if parameter.input:
                chosen = [parameter.input in ("*", name) for name in self.plan.inputs.names]
                factors[chosen] *= value
            elif parameter.start:
                start_values[parameter.start] = float(value)
        inputs = copy.copy(self.plan.inputs)
        inputs.table = inputs.table * factors
        plan = Experiment(self.plan.start, self.plan.stop, self.plan.step, inputs)
        row: dict = {"message": ""}
        try:
            if self.instance:
                self.instance.reset()
            else:
                self.instance = Instance(self.fmu, self.outputs)
            if self.judge:
                judgement = self.judge.judge(self.instance, plan, start_values=start_values)
                row["passed"] = judgement.passed
                row |= {verdict.name: float(verdict.value) for verdict in judgement.verdicts}
                assert judgement.result
                result = judgement.result
            else:
                result = simulate(self.instance, plan, self.outputs, start_values=start_values)
            for name in task.signals:
                row.setdefault("time", result["time"].tolist())
                row[name] = result[name].tolist()
        except (RunError, UsageError, StepTooLong) as error:
            row = {"message": str(error)}
            if self.instance:  # it may be in any state
                self.instance.free()
                self.instance = None
        return row


def ready(data: bytes, task: Task) -> Ready:
    """Unpacked before, or now; the oldest goes where there are too many."""
    if not hasattr(_here, "held"):
        _here.held = {}
    held: dict[str, Ready] = _here.held
    key = task.key + hashlib.sha256(data).hexdigest()
    if key not in held:
        while len(held) >= KEPT:
            held.pop(next(iter(held))).close()
        held[key] = Ready(data, task)
    return held[key]


def run_batch(data: bytes | str, task: Task, cases: list[tuple[int, list]]) -> list[tuple[int, dict]]:
    """Number and row of each case. data: of build_variant."""
    if isinstance(data, str):
        return [(number, {"message": data}) for number, _ in cases]
    try:
        held = ready(data, task)
    except (RunError, UsageError) as error:
        return [(number, {"message": str(error)}) for number, _ in cases]
    return [(number, held.run(task, values)) for number, values in cases]
