"""The five quantities one asks about after a run: largest reaction, energy balance, drift, substeps, wall time."""

import math
import re

import numpy as np

from .fmu_instance import Fmu
from .report import of_folder
from .results import Result

REACTION = re.compile(r"((?:master|port)(?:\[.*\]\.|_.*_)f)(\[1\]|_1)")


def written(name: str, known) -> str:
    """A variable's name as the FMU has it, structured or flat."""
    return name if name in known else name.replace(".", "_")


class Reactions:
    """Finds the largest force of a tie on a master, or on a port of driven nodes, in blocks of rows."""

    def __init__(self, names: list[str]):
        """names: of the outputs."""
        found = [match for match in map(REACTION.fullmatch, names) if match]
        self.first = {match[1]: match[0] for match in found}  # name of its first component
        self.names = list(self.first)
        column = {name: 1 + k for k, name in enumerate(names)}
        self.columns = np.array(
            [[column[match[1] + match[2].replace("1", k)] for k in "123"] for match in found], dtype=int
        )
        self.square, self.where, self.time = -1.0, "", 0.0

    def write(self, block: np.ndarray) -> None:
        if not self.names:
            return
        square = (block[:, self.columns] ** 2).sum(axis=2)
        row, place = np.unravel_index(np.argmax(square), square.shape)
        if not square[row, place] <= self.square:
            self.square, self.where = float(square[row, place]), self.names[place]
            self.time = float(block[row, 0])


def energy_scale(result: Result) -> float:
    """The largest energy of the run, J."""
    names = [written(f"energy.{kind}", result.columns) for kind in ("kinetic", "strain", "external")]
    return max(map(result.largest, names))


def substeps(fmu: Fmu, step: float) -> int | None:
    """In a communication step of `step` s, at the limit of the start; None where the FMU has no report of tiefmu."""
    found = of_folder(fmu.folder)
    if found is None:
        return None
    longest = found["integrator_limit"]

    def parameter(name: str, default: float) -> float:
        variable = fmu.variables.get(written(f"integrator.{name}", fmu.variables))
        return default if variable is None else float(variable.start)

    longest *= parameter("safety", 1.0)
    if parameter("time_step", 0.0) > 0:
        longest = min(longest, parameter("time_step", 0.0))
    return max(1, math.ceil(step / longest * (1 - 1e-12)))


def lines(fmu: Fmu, result: Result, reactions: Reactions, step: float) -> list[str]:
    """One line each. step: of communication, s."""
    variable = fmu.variables.get(reactions.first.get(reactions.where, ""))
    node = re.search(r"\(node \d+\)", (variable and variable.description) or "")
    residual = written("energy.residual", result.columns)
    balance = part(result.largest(residual), energy_scale(result)) if residual in result.columns else ""
    words = {
        "largest reaction": f"{math.sqrt(reactions.square):.6g} N at {reactions.where}{' ' + node[0] if node else ''}, "
        f"t = {reactions.time:.6g} s"
        if reactions.names
        else "none: no reaction is an output",
        "energy balance": f"residual {balance} of the largest energy"
        if balance
        else 'not shown: expose = ["energy"] in [interface]',
        "drift": f"{result.largest('drift'):.2g} m"
        if "drift" in result.columns
        else 'not shown: expose = ["drift"] in [interface]',
    }
    count = substeps(fmu, step)
    if count is not None:
        words["substeps"] = f"{count} a step, by the limit at the start"
    words["wall time"] = f"{result.seconds:.3g} s, {result.seconds / max(result.steps, 1) * 1e6:.3g} us a step"
    return [f"  {name:<17} {value}" for name, value in words.items()]


def part(value: float, of: float) -> str:
    return f"{value / of:.2g}" if of > 0 else ("0" if value == 0 else "infinitely much")
