"""Builds the example scenes, runs each as an FMU, checks what must hold in any run, writes CSVs and pictures."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .decks import is_deck
from .errors import UsageError
from .package import build
from .plot import plot
from .report import report
from .run import run, write_outputs
from .scene import load

if TYPE_CHECKING:
    from fmpy.simulation import SimulationResult

SCENES = Path(__file__).resolve().parents[2] / "scenes"  # of the checkout


@dataclass
class Check:
    """Something that must hold: `name` value (limit)."""

    name: str
    value: float
    limit: float

    @property
    def held(self) -> bool:
        return self.value <= self.limit


def demo(out: Path, scenes: Path = SCENES) -> bool:
    """Runs every scene and every deck of the folder; True if every check held.

    Inputs are NAME.csv beside it, if there. Writes NAME.fmu, NAME.csv and NAME.png to `out`.
    Raises SceneError, UsageError, RunError.
    """
    paths = sorted([*scenes.glob("*.toml"), *(path for path in scenes.iterdir() if is_deck(path))])
    if not paths:
        raise UsageError(f"{scenes}: no scenes here; give the folder with --scenes")
    out.mkdir(parents=True, exist_ok=True)
    print(
        f"{'scene':<22} {'slaves':>7} {'masters':>7} {'variables':>9} {'steps':>6} {'t end [s]':>10} {'build':>7} "
        f"{'run':>7}  checks"
    )
    held = True
    for path in paths:
        began = time.perf_counter()
        scene = load(path)
        fmu = build(scene, out / f"{path.stem}.fmu")
        built = time.perf_counter()
        inputs = path.with_suffix(".csv")
        result = run(fmu, inputs=inputs if inputs.is_file() else None)
        ran = time.perf_counter()
        write_outputs(result, out / f"{path.stem}.csv")
        plot(result, out / f"{path.stem}.png", scene.title or path.stem)
        found = report(scene)
        checks = check(result)
        held = held and all(one.held for one in checks)
        print(
            f"{path.stem:<22} {len(found['slaves']):>7} {len(found['masters']):>7} "
            f"{sum(found['variables'].values()):>9} {len(result) - 1:>6} {result['time'][-1]:>10.4g} "
            f"{built - began:>6.2f}s {ran - built:>6.2f}s  "
            + ", ".join(
                f"{one.name} {one.value:.1e}{'' if one.held else f' FAILED (limit {one.limit:.0e})'}" for one in checks
            ),
            flush=True,
        )
    print(f"{'all checks held' if held else 'A CHECK FAILED'}; FMUs, results and pictures are in {out}")
    return held


def check(result: "SimulationResult") -> list[Check]:
    """Finite numbers everywhere, and what the scene exposes of its own balances."""
    names = result.dtype.names
    checks = [Check("not finite", int(sum((~np.isfinite(result[name])).sum() for name in names)), 0)]

    def largest(name: str) -> float:
        return float(np.abs(result[name]).max())

    if "drift" in names:
        checks.append(Check("drift [m]", largest("drift"), 1e-12))
    if "power_residual" in names:
        force = max((largest(name) for name in names if ".f[" in name), default=0.0)
        speed = max((largest(name) for name in names if ".v[" in name), default=0.0)
        checks.append(Check("power residual", largest("power_residual") / max(force * speed, 1e-300), 1e-9))
    if "energy.residual" in names:
        scale = max(largest("energy.kinetic"), largest("energy.strain"), largest("energy.external"), 1e-300)
        checks.append(Check("energy residual", largest("energy.residual") / scale, np.inf))  # depends on the step
    return checks
