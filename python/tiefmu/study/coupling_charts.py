"""Chart and page of the coupling study."""

from dataclasses import asdict
from pathlib import Path

from .. import figures
from . import page
from .coupling_runs import OMEGA, WAYS, ZETA, Row, Study
from .hosts import EXTRAPOLATIONS

COLOURS = {
    "loads": "#b8860b",
    "full": "#b3402e",
    "split": "#1f5fa8",
    "split-lead-inside": "#56a7d8",
    "full-closed": "#8f4fa8",
    "free": "#222222",
    "spring-damper": "#3b7d4f",
}
STYLES = {"held": "-", "linear": "--", "quadratic": ":"}
MARKERS = {"held": "o", "linear": "s", "quadratic": "^"}


def draw(rows: list[Row], folder: Path, name: str) -> Path:
    """Errors of velocities and loads and the power residual over H omega, PNG and SVG; returns the latter."""
    from matplotlib.lines import Line2D

    panels = [
        ("error_velocity", "error of the slaves' velocities"),
        ("error_force", "error of the loads on the masters"),
        ("power_residual_relative", "power residual"),
    ]
    figure, axes = figures.pyplot().subplots(2, 2, figsize=(12, 9.5), sharex=True, layout="constrained")
    ways = [(way.name, style) for way in WAYS for style in way.extrapolations]
    for place, (reaction, style) in enumerate(ways):
        own = [row for row in rows if (row.reaction, row.extrapolation) == (reaction, style)]
        good = [row for row in own if row.status == "stable"]
        look = {"marker": MARKERS[style], "markersize": 4, "color": COLOURS[reaction], "fillstyle": "none"}
        for axis, (key, _) in zip(axes.flat, panels):
            axis.plot(
                [row.step_omega for row in good],
                [getattr(row, key) for row in good],
                STYLES[style],
                linewidth=1.3,
                **look,
            )
        last = axes[1, 1]
        last.plot([row.step_omega for row in good], [place] * len(good), linestyle="", **look)
        bad = [row.step_omega for row in own if row.status != "stable"]
        last.plot(bad, [place] * len(bad), "x", color=COLOURS[reaction], markersize=6)
    for axis, (_, title) in zip(axes.flat, panels):
        axis.set(xscale="log", yscale="log", title=title, ylabel="relative L2 error  [1]")
        axis.grid(alpha=0.3)
    axes[1, 0].set_ylabel("rms of the residual / rms of the power  [1]")
    axes[1, 1].set_yticks(range(len(ways)), [f"{reaction}, {style}" for reaction, style in ways])
    axes[1, 1].set(title="stable (open) or not (cross)", ylim=(len(ways) - 0.5, -0.5))
    for axis in axes[1]:
        axis.set_xlabel(r"communication step  $H\,\omega$  [rad]")
    handles = [Line2D([], [], color=c, label=r) for r, c in COLOURS.items()]
    handles += [
        Line2D(
            [],
            [],
            color="black",
            linestyle=STYLES[s],
            marker=MARKERS[s],
            markersize=4,
            fillstyle="none",
            label=f"load {s}" if s == "held" else f"extrapolated, {s}",
        )
        for s in EXTRAPOLATIONS
    ]
    handles.append(Line2D([], [], color="black", marker="x", linestyle="", label="unstable or diverged"))
    figure.legend(handles=handles, ncol=4, loc="outside lower center", frameon=False)
    figure.suptitle(
        f"{rows[0].scene}: {rows[0].host} host, slaves {rows[0].mass_ratio:.3g} times as heavy as its masters"
    )
    figures.save(figure, folder / f"{name}.png", folder / f"{name}.svg")
    return folder / f"{name}.svg"


INTRO = [
    "The packaged FMU runs under FMPy; the other side is a host in NumPy that carries the driven masters as point "
    f"masses. They stand on ground springs of {OMEGA:g} rad/s (or of the highest frequency of the scene's own springs) "
    f"with {100 * ZETA:g} % damping, unless the host is rigid. Between communication points it solves its own "
    "equations exactly under the tie's last load - held, or extrapolated linearly or quadratically - so the error is "
    "that of the coupling. Smooth pulses act on the slaves; the exact solution is the monolithic system.",
    "'split-lead-inside' is 'split' with reaction_lead = 1 in the scene: what the host holds runs ahead, and the loads "
    "that are compared with the exact ones do so, too. 'full-closed' is 'full' with a host that solves for its "
    "accelerations by the FMU's directional derivatives. 'free': the solver, in this process, owns the masters and the "
    "host has their springs; velocities are compared in the middle of a step, where they belong.",
    "'loads' is lumped, so its error cannot fall below that of lumping. 'spring-damper' exchanges a force: the slaves "
    "weigh nothing and hang on springs and dampers inside the FMU. The power residual is sum f.v at a communication "
    "point with the load that the host has used, minus with the load that the tie answers there.",
]


def section(study: Study, rows: list[Row], figure: Path) -> page.Section:
    return page.Section(
        study.source.name,
        [verdict(rows)],
        [("Error over communication step", figure)],
        list(Row.__dataclass_fields__),
        [list(asdict(row).values()) for row in rows],
    )


def verdict(rows: list[Row]) -> str:
    """Largest stable step of each reaction and extrapolation."""
    words = []
    for reaction in [way.name for way in WAYS]:
        for style in EXTRAPOLATIONS:
            own = [row for row in rows if (row.reaction, row.extrapolation) == (reaction, style)]
            good = [row.step_omega for row in own if row.status == "stable"]
            if own:
                words.append(
                    f"{reaction}, {style}: "
                    + (f"stable up to H omega = {max(good):.3g}" if good else "unstable at every step")
                )
    return "; ".join(words) + "."
