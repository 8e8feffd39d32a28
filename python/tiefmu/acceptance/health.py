"""Criteria of health: what a run or a scene says of itself."""

import math
import re

import numpy as np

from .. import key_figures
from ..errors import RunStopped, UsageError
from ..fmu_instance import Fmu
from ..report import of_folder
from ..results import Result
from ..signals import Experiment
from .criteria import HEALTH, Health
from .verdict import Curve, Verdict

MOTION = re.compile(r"(\w+)\[.*\]\.([vwft])\[[123]\]")  # what a run at half the step is compared by
NOISE = 1e-9  # 1/m or m between translations and rotations: far below any part's share, far above rounding
EXPOSED = {  # criterion: (output, what exposes it)
    "energy_residual": ("energy.residual", "energy"),
    "drift": ("drift", "drift"),
    "power_residual": ("power_residual", "power_residual"),
}


def outputs(health: Health, names: list[str]) -> set[str]:
    """Those of `names` that the criteria need. Raises UsageError where the FMU does not show one."""
    wanted = set()
    for key, (name, exposed) in EXPOSED.items():
        if getattr(health, key) is None:
            continue
        if name not in names:
            raise UsageError(f'{key}: the FMU does not show it; expose = ["{exposed}"] in [interface] of its scene')
        wanted |= {other for other in names if other.split(".")[0] == name.split(".")[0]}
    if health.power_residual is not None or health.half_step is not None:
        wanted |= {name for name in names if MOTION.fullmatch(name)}
    if health.stability_margin is not None:
        wanted |= {"stable_time_step"} & set(names)
    return wanted


def verdicts(health: Health, fmu: Fmu, plan: Experiment, result: Result, half: Result | None) -> list[Verdict]:
    """half: the run at half the communication step, if asked for."""
    found = []
    if health.energy_residual is not None:
        scale = key_figures.energy_scale(result) or 1.0
        worst, curve = result.largest("energy.residual") / scale, result["energy.residual"] / scale
        found.append(over_time(HEALTH["energy_residual"], worst, health.energy_residual, "1", result, curve))
        found[-1].where = "largest residual over largest energy"
    if health.drift is not None:
        found.append(over_time(HEALTH["drift"], result.largest("drift"), health.drift, "m", result, result["drift"]))
        found[-1].where = "largest change of an offset's length"
    if health.power_residual is not None:
        scale = power_scale(result)
        curve = result["power_residual"] / max(scale, 1e-300)
        worst = result.largest("power_residual") / max(scale, 1e-300)
        found.append(over_time(HEALTH["power_residual"], worst, health.power_residual, "1", result, curve))
        found[-1].where = "over largest force times largest velocity"
    if health.stability_margin is not None:
        found.append(stability(health.stability_margin, fmu, plan, result))
    if health.added_mass is not None:
        found.append(added_mass(health.added_mass, fmu))
    if health.dropped is not None:
        count = len(report(fmu, "dropped")["dropped"])
        found.append(
            Verdict(HEALTH["dropped"], "health", count, count <= health.dropped, f"at most {health.dropped}", "1")
        )
        found[-1].bars = [("dropped", float(count)), ("tied", float(len(report(fmu, "dropped")["slaves"])))]
    if half is not None and health.half_step is not None:
        found.append(half_step(health.half_step, result, half))
    return found


def over_time(name: str, value: float, most: float, unit: str, result: Result, curve: np.ndarray) -> Verdict:
    return Verdict(
        name,
        "health",
        value,
        bool(value <= most),  # not where it is nan
        f"at most {most:g}",
        unit,
        axis=f"{name} [{unit}]",
        curves=[Curve("run", result["time"], np.abs(curve))],
        limits=[most],
    )


def power_scale(result: Result) -> float:
    """Largest force times largest velocity of the run, W."""
    force = max((result.largest(name) for name in result.names if ".f[" in name), default=0.0)
    return force * max((result.largest(name) for name in result.names if ".v[" in name), default=0.0)


def report(fmu: Fmu, key: str) -> dict:
    found = of_folder(fmu.folder)
    if found is None:
        raise UsageError(f"{key}: {fmu.name} was not made by tiefmu, so it does not say this")
    return found


def stability(least: float, fmu: Fmu, plan: Experiment, result: Result) -> Verdict:
    """How far the substep stays below the limit of the integrator, as a part of it; the limit of the start follows the
    highest frequency of the run."""
    found = report(fmu, "stability_margin")
    count = key_figures.substeps(fmu, plan.step)
    assert count is not None
    limit = np.full(len(result.rows), found["integrator_limit"])
    if "stable_time_step" in result.columns and found["stable_time_step"] > 0:
        limit = limit * (result["stable_time_step"] / found["stable_time_step"])
    margin = 1 - plan.step / count / limit
    worst = int(np.argmin(margin))
    return Verdict(
        HEALTH["stability_margin"],
        "health",
        float(margin[worst]),
        bool(margin[worst] >= least),
        f"at least {least:g}",
        "1",
        f"substeps of {plan.step / count:.4g} s below a limit of {limit[worst]:.4g} s"
        if limit[worst] < 1e30
        else "no limit: nothing that is integrated",
        axis="1 - substep / limit [1]",
        curves=[Curve("run", result["time"], margin)],
        limits=[least],
    )


def added_mass(most: float, fmu: Fmu) -> Verdict:
    """The largest added over own mass of a master that moves."""
    rows = [row for row in report(fmu, "added_mass")["masters"] if row["motion"] != "fixed"]
    ratios = [(ratio(row["added_mass"], row["mass"]), row["id"]) for row in rows]
    worst, node = max(ratios, default=(0.0, 0))
    bare = f"node {node} has no own mass in the scene" if worst == math.inf else f"node {node}"
    verdict = Verdict(
        HEALTH["added_mass"], "health", worst, worst <= most, f"at most {most:g} of the own mass", "1", bare
    )
    verdict.bars = [(f"node {i}", part) for part, i in sorted(ratios, reverse=True)[:20] if part < math.inf]
    verdict.axis, verdict.limits = "added over own mass [1]", [most]
    return verdict


def ratio(added: float, own: float) -> float:
    return added / own if own > 0 else (math.inf if added > 0 else 0.0)


def half_step(most: float, result: Result, half: Result) -> Verdict:
    """Relative L2 difference of velocities and loads over the run, the worst of the kinds, at the steps of the coarse
    run. A kind that is but rounding beside another of motion or of loads (NOISE) is taken relative to that one."""
    time, fine = result["time"], half["time"]
    place = np.clip(np.searchsorted(fine, time), 1, len(fine) - 1)
    place = place - (time - fine[place - 1] < fine[place] - time)
    common = np.isclose(fine[place], time, rtol=1e-9, atol=0)
    if common.sum() < 2:
        raise UsageError("half_step: the run and that at half the step share no times")
    kinds: dict[str, list[str]] = {}
    for name in result.names:
        match = MOTION.fullmatch(name)
        if match:
            kinds.setdefault(f"{match[1]}.{match[2]}", []).append(name)
    worst, what, curve = 0.0, "no motion and no load", np.zeros(int(common.sum()))
    finer = {kind: np.array([half[name][place[common]] for name in names]) for kind, names in kinds.items()}
    norms = {kind: float(np.linalg.norm(b)) for kind, b in finer.items()}
    for kind, names in kinds.items():
        a, b = np.array([result[name][common] for name in names]), finer[kind]
        alike = "vw" if kind[-1] in "vw" else "ft"
        scale = max(norms[kind], *(NOISE * norms[other] for other in norms if other[-1] in alike))
        error = float(np.linalg.norm(a - b)) / scale if scale > 0 else float(np.linalg.norm(a))
        if not np.isfinite(error):
            raise RunStopped(f"half_step: {kind} holds values that are not finite")
        if error >= worst:
            largest = float(np.sqrt((b**2).sum(axis=0)).max())
            worst, what = error, kind
            curve = np.sqrt(((a - b) ** 2).sum(axis=0)) / max(largest, 1e-300)
    return Verdict(
        HEALTH["half_step"],
        "health",
        worst,
        worst <= most,
        f"at most {most:g}",
        "1",
        f"{what}: relative L2 difference from the run at half the communication step",
        axis=f"difference of {what} over its largest [1]",
        curves=[Curve("run", time[common], curve)],
    )
