"""Times the kernels, the FMU's calls and the work round them; prints one table, writes bench/latest.csv and the chart.

make bench                               all of it, in about ten minutes
python bench/run.py --n 1 1e3            cycles of these numbers of slaves only, without the rest and the chart
python bench/run.py --instructions       count instructions and make them the reference of tests/test_instructions.py
"""

import argparse
import csv
import datetime
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
LATEST, REFERENCE, CHART = HERE / "latest.csv", HERE / "instructions.csv", ROOT / "docs" / "bench.svg"
COLUMNS = ["case", "n", "threads", "value", "unit", "bytes", "triad_gb_s"]
FORMULATIONS = ["default", "default-rotations", "optimized"]
CONSISTENT = [f"{name}-consistent" for name in FORMULATIONS]
# Quads apart from each other, with one and with four slaves.
WELDS = [f"{name}-{kind}" for kind in ("welds1", "welds4") for name in FORMULATIONS]
# Surfaces whose loads change sign before every step; slaves of a quad a node's mass (light), or four times that.
FLIPPED = [f"{name}-{kind}" for kind in ("light-flipped", "flipped") for name in FORMULATIONS]
# One slave in steps of a hundred substeps: what a substep costs without what stands round a step.
LONG = [f"{name}-long" for name in FORMULATIONS]
SLAVES = [1, 4, 16, 100, 1_000, 10_000, 100_000, 1_000_000]
THREADS = [1, 2]
COUNTED = 1024  # slaves of the instruction counts: in the caches, and the rest of the program small beside them
GROWTH = [1_000, 10_000, 100_000]  # slaves of the scenes that are loaded and built


# ---------------------------------------------------------------------------------------------------------- measuring


def program() -> Path:
    """The benchmark program, built with the release preset; `nothing.so` lies beside it."""
    cmake = Path(sys.executable).with_name("cmake")
    path = {"cwd": ROOT, "check": True, "stdout": subprocess.DEVNULL}
    subprocess.run(
        [
            cmake,
            "--preset",
            "release",
            f"-DPython_EXECUTABLE={sys.executable}",
            "-DTIEFMU_PYTHON=OFF",
            f"-DCMAKE_MAKE_PROGRAM={cmake.with_name('ninja')}",
        ],
        **path,
    )
    subprocess.run([cmake, "--build", "--preset", "release", "--target", "tiefmu_bench", "tiefmu_nothing"], **path)
    return ROOT / "build" / "release" / "tiefmu_bench"


def run(*arguments) -> list[list[str]]:
    """Rows of a program that prints CSV."""
    print(*(Path(str(a)).name for a in arguments), file=sys.stderr, flush=True)
    output = subprocess.run([str(a) for a in arguments], check=True, stdout=subprocess.PIPE, text=True).stdout
    return list(csv.reader(output.splitlines()))


def cycles(bench: Path, slaves: list[int]) -> list[list[str]]:
    rows = []
    for n in slaves:
        for case in FORMULATIONS + CONSISTENT:
            for threads in THREADS if n >= 100 else [1]:
                rows += run(bench, "kernels", case, n, threads)
        for case in LONG if n == 1 else []:
            rows += run(bench, "kernels", case, n, 1)
        if n >= 10_000:
            for case in FORMULATIONS:
                rows += run(bench, "kernels", case, n, "shuffled", 1)
        for case in (WELDS if n in (1, 100, 10_000) else []) + (FLIPPED if n in (10_000, 1_000_000) else []):
            rows += run(bench, "kernels", case, n, 1) + run(bench, "kernels", f"{case}-consistent", n, 1)
    return rows


def ratios(rows: list[list[str]]) -> str:
    """What consistent inertia costs beside lumped, in the same run."""
    cost = {(case, int(n), int(threads)): float(value) for case, n, threads, value, *_ in rows}
    lines = [f"{'consistent to lumped':32}{'n':>9}{'threads':>9}{'ratio':>12}"]
    for (case, n, threads), value in cost.items():
        lumped = cost.get((case.removesuffix("-consistent"), n, threads))
        if case.endswith("-consistent") and lumped:
            lines.append(f"{case.removesuffix('-consistent'):32}{n:>9}{threads:>9}{value / lumped:>12.2f}")
    return "\n".join(lines)


def growth(bench: Path) -> list[list[str]]:
    """Search, memory, and what it takes to load a scene file and to build its FMU."""
    rows = []
    for n in (1_000, 10_000, 100_000, 1_000_000):
        rows += run(bench, "search", n)
    for n in (100_000, 1_000_000):
        rows += run(bench, "search", n, "shuffled")
    for case in FORMULATIONS + CONSISTENT:
        for n in (10_000, 100_000):
            rows += run(bench, "memory", case, n)
    for n in GROWTH:
        rows += run(sys.executable, HERE / "growth.py", n)
    return rows


def calls(bench: Path) -> list[list[str]]:
    import tiefmu
    from growth import ONE_SLAVE, surface

    rows, nothing = [], bench.with_name("nothing.so")
    with tempfile.TemporaryDirectory() as folder:
        for name, scene in (("one", ONE_SLAVE), ("many", surface(10_000)), ("free", surface(100_000, motion="free"))):
            fmu = tiefmu.build(tiefmu.load(scene), Path(folder) / f"{name}.fmu")
            with zipfile.ZipFile(fmu) as archive:
                archive.extractall(Path(folder) / name)
            rows += [[f"{name}-{row[0]}", *row[1:]] for row in run(bench, "fmu", Path(folder) / name, nothing)]
    return rows


# ------------------------------------------------------------------------------------------------------- instructions


def instructions(bench: Path) -> dict[str, float]:
    """Instructions per slave and cycle: the difference of two runs, so that nothing but cycles is counted."""
    valgrind = shutil.which("valgrind")
    if not valgrind:
        raise SystemExit("valgrind is missing; it counts instructions: apt-get install valgrind")
    few, many = 4, 24

    def total(case: str, count: int) -> int:
        done = subprocess.run(
            [
                valgrind,
                "--tool=callgrind",
                "--callgrind-out-file=/dev/null",
                bench,
                "cycles",
                case,
                str(COUNTED),
                str(count),
            ],
            check=True,
            capture_output=True,
            text=True,
        )
        line = next(line for line in done.stderr.splitlines() if "Collected" in line)
        return int(line.split()[-1])

    cases = FORMULATIONS + CONSISTENT + [f"{name}-flipped-consistent" for name in FORMULATIONS]
    return {case: (total(case, many) - total(case, few)) / (many - few) / COUNTED for case in cases}


def write_reference(counts: dict[str, float]) -> None:
    with REFERENCE.open("w", newline="") as file:
        file.write(f"# instructions per slave and cycle at {COUNTED} slaves; {compiler()}; {simd()}\n")
        csv.writer(file, lineterminator="\n").writerows(
            [["case", "instructions"], *([case, f"{count:.1f}"] for case, count in counts.items())]
        )


def reference() -> tuple[dict[str, float], str]:
    """The committed counts, and what they were made with: compiler and instruction set."""
    with REFERENCE.open(newline="") as file:
        made_with = file.readline().split("; ", 1)[1].strip()
        return {row["case"]: float(row["instructions"]) for row in csv.DictReader(file)}, made_with


# ------------------------------------------------------------------------------------------------------------- machine


def compiler() -> str:
    return subprocess.run(["c++", "--version"], capture_output=True, text=True).stdout.splitlines()[0]


def simd() -> str:
    """The widest vectors that valgrind lets a program see."""
    flags = cpuinfo("flags").split()
    return "AVX2" if "avx2" in flags and "fma" in flags else "SSE2"


def cpuinfo(key: str) -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return ""
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith(key)), "")


def made_with() -> list[str]:
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True).stdout
    return [
        f"{cpuinfo('model name') or platform.processor()}, {cpuinfo('siblings') or '?'} threads",
        compiler(),
        f"{datetime.date.today()}, commit {commit.strip() or 'unknown'}",
    ]


# -------------------------------------------------------------------------------------------------------------- output


def table(rows: list[list[str]]) -> str:
    lines = [f"{'case':32}{'n':>9}{'threads':>9}{'value':>12}  {'unit':26}{'bytes':>6}{'times bytes/triad':>19}"]
    for case, n, threads, value, unit, moved, triad in rows:
        line = f"{case:32}{n:>9}{threads:>9}{float(value):>12,.4g}  {unit:26}"
        if float(moved) and float(triad):
            line += f"{moved:>6}{float(value) / (float(moved) / float(triad)):>19.2f}"
        lines.append(line.rstrip())
    return "\n".join(lines)


def chart(rows: list[list[str]], made: list[str]) -> None:
    """ns per slave and cycle against the number of slaves; dotted: what a triad needs for the bytes that must move."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "bench"
    import matplotlib.pyplot as plt

    colours = dict(zip(FORMULATIONS, ["#0072B2", "#009E73", "#D55E00"]))
    figure, axes = plt.subplots(1, 2, figsize=(11, 5), layout="constrained", sharex=True, sharey=True)
    for axis, cases, title in ((axes[0], FORMULATIONS, "lumped inertia"), (axes[1], CONSISTENT, "consistent inertia")):
        for case in cases:
            colour = colours[case.removesuffix("-consistent")]
            for threads, style in ((1, "-o"), (2, "--s")):
                own = [row for row in rows if row[0] == case and row[2] == str(threads)]
                axis.plot(
                    [int(row[1]) for row in own],
                    [float(row[3]) for row in own],
                    style,
                    color=colour,
                    markersize=4,
                    label=f"{case.removesuffix('-consistent')}, {threads} thread" + "s" * (threads > 1),
                )
            triad = [float(row[5]) / float(row[6]) for row in rows if row[0] == case and float(row[5])]
            if triad:
                axis.axhline(statistics.median(triad), linestyle=":", color=colour, linewidth=1.5)
        shuffled = [row for row in rows if row[0] in [f"{case}-shuffled" for case in cases]]
        for row in shuffled:
            axis.plot(int(row[1]), float(row[3]), "x", color=colours[row[0].removesuffix("-shuffled")], markersize=7)
        axis.set(xscale="log", yscale="log", xlabel="slaves", title=title)
        axis.grid(alpha=0.25)
    axes[0].set_ylabel("ns per slave and cycle")
    axes[0].plot([], [], ":", color="#444", linewidth=1.5, label="bytes that must move / triad")
    axes[0].plot([], [], "x", color="#444", label="slaves shuffled")
    axes[0].legend(frameon=False, fontsize=8)
    figure.supxlabel("; ".join(made), fontsize=7, color="#555")
    figure.savefig(CHART, metadata={"Date": None})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=float, nargs="+", help="numbers of slaves")
    parser.add_argument("--instructions", action="store_true", help="only count instructions, and write the reference")
    options = parser.parse_args()
    bench, made = program(), made_with()
    if options.instructions:
        counts = instructions(bench)
        write_reference(counts)
        print("\n".join(f"{case:32}{count:10.1f} instructions per slave and cycle" for case, count in counts.items()))
        return
    if options.n:
        rows = cycles(bench, [int(n) for n in options.n])
        print(table(rows) + "\n\n" + ratios(rows))
        return
    rows = cycles(bench, SLAVES) + growth(bench) + calls(bench)
    rows += [
        [f"instructions-{case}", COUNTED, 1, f"{count:.1f}", "per slave and cycle", 0, 0]
        for case, count in instructions(bench).items()
    ]
    with LATEST.open("w", newline="") as file:
        file.writelines(f"# {line}\n" for line in made)
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])
    chart(rows, made)
    print("\n".join(made) + "\n" + table(rows) + "\n\n" + ratios(rows))
    print(f"written to {LATEST} and {CHART}")


if __name__ == "__main__":
    main()
