"""Builds the example scenes, runs each as an FMU, checks what must hold in any run, writes CSVs and pictures."""

import re
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .decks import is_deck
from .errors import UsageError
from .key_figures import energy_scale, part
from .loading import load
from .package import build
from .plot import plot
from .report import report
from .results import Result
from .run import run

PACKED = Path(__file__).resolve().parent / "scenes"  # in a wheel
SCENES = PACKED if PACKED.is_dir() else Path(__file__).resolve().parents[2] / "scenes"  # of the checkout


@dataclass
class Check:
    """Something that must hold in any run, in words, and the number it is judged by; held: None where there is no
    limit for it."""

    name: str
    held: bool | None
    number: str = ""

    def __str__(self) -> str:
        verdict = "" if self.held is None else ("yes" if self.held else "NO, FAILED")
        return f"{self.name}: {verdict}{' (' if verdict and self.number else ''}{self.number}" + (
            ")" if verdict and self.number else ""
        )


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
        result, _ = run(fmu, inputs=inputs if inputs.is_file() else None, output=out / f"{path.stem}.csv")
        ran = time.perf_counter()
        plot(result, out / f"{path.stem}.png", scene.title or path.stem)
        found = report(scene)
        checks = check(result)
        held = held and all(one.held is not False for one in checks)
        print(
            f"{path.stem:<22} {len(found['slaves']):>7} {len(found['masters']):>7} "
            f"{sum(found['variables'].values()):>9} {result.steps:>6} {result.last[0]:>10.4g} "
            f"{built - began:>6.2f}s {ran - built:>6.2f}s  " + "; ".join(map(str, checks)),
            flush=True,
        )
    print(f"{'all checks held' if held else 'A CHECK FAILED'}; FMUs, results and pictures are in {out}")
    return held


def check(result: Result) -> list[Check]:
    """Finite numbers everywhere, and what the scene exposes of its own balances."""
    finite = bool(np.isfinite([result.low, result.high]).all())
    checks = [Check("finite values", finite)]
    if "drift" in result.columns:
        drift = result.largest("drift")
        checks.append(Check("offsets keep their length", drift <= 1e-12, f"{drift:.1e} m"))
    if "power_residual" in result.columns:
        force, speed = (
            max(
                (result.largest(name) for name in result.names if re.search(rf"[._]{kind}[\[_]\d\]?$", name)),
                default=0.0,
            )
            for kind in "fv"  # in structured and in flat names
        )
        residual = result.largest("power_residual") / max(force * speed, 1e-300)
        checks.append(Check("power in is power out", residual <= 1e-9, f"{residual:.1e}"))
    if "energy.residual" in result.columns:  # depends on the step
        checks.append(Check("energy residual", None, part(result.largest("energy.residual"), energy_scale(result))))
    return checks
