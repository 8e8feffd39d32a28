"""Times the kernels and the FMU's calls, prints a table, writes bench/latest.csv.

    make bench                 all of it
    python bench/run.py --n 1e5
"""

import argparse
import csv
import platform
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

import tiefmu

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
COLUMNS = ["case", "n", "threads", "ns", "bytes", "triad_gb_s"]


def program() -> Path:
    """The benchmark program, built with the release preset."""
    cmake = Path(sys.executable).with_name("cmake")
    quiet = {"cwd": ROOT, "check": True, "stdout": subprocess.DEVNULL}
    subprocess.run([cmake, "--preset", "release", f"-DPython_EXECUTABLE={sys.executable}", "-DTIEFMU_PYTHON=OFF"], **quiet)
    subprocess.run([cmake, "--build", "--preset", "release", "--target", "tiefmu_bench"], **quiet)
    return ROOT / "build" / "release" / "tiefmu_bench"


def run(*arguments) -> list[list[str]]:
    output = subprocess.run([str(a) for a in arguments], check=True, capture_output=True, text=True).stdout
    return list(csv.reader(output.splitlines()))


def surface(slaves: int) -> dict:
    """A scene of driven masters with four slaves on each quad, without offset."""
    side = max(1, round((slaves / 4) ** 0.5))
    nodes = [[j * (side + 1) + i + 1, i, j, 0] for j in range(side + 1) for i in range(side + 1)]
    segments, first = [], len(nodes) + 1
    for j in range(side):
        for i in range(side):
            a = j * (side + 1) + i + 1
            segments.append([len(segments) + 1, a, a + 1, a + side + 2, a + side + 1])
            for k in range(4):
                nodes.append([len(nodes) + 1, i + 0.3 + 0.4 * (k % 2), j + 0.3 + 0.4 * (k // 2), 0])
    slave_ids = [node[0] for node in nodes if node[0] >= first]
    return {
        "title": f"{len(slave_ids)} slaves",
        "mesh": {"nodes": nodes, "segments": segments},
        "tie": [{"name": "surface", "segments": "all", "slaves": slave_ids}],
    }


ONE_SLAVE = {
    "title": "One slave",
    "mesh": {"nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [5, 0.3, 0.6, 0.4]],
             "segments": [[1, 1, 2, 3, 4]]},
    "node": [{"nodes": [1, 2, 3, 4], "rotations": True}, {"nodes": [5], "mass": 0.7}],
    "tie": [{"name": "weld", "segments": "all", "slaves": [5]}],
}


def build_and_unpack(scene: dict, folder: Path, name: str) -> Path:
    fmu = tiefmu.build(tiefmu.load(scene), folder / f"{name}.fmu")
    target = folder / name
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(target)
    return target


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=float, nargs="*", default=[1e2, 1e3, 1e4, 1e5, 1e6], help="numbers of slaves")
    parser.add_argument("--output", type=Path, default=HERE / "latest.csv")
    options = parser.parse_args()
    bench = program()
    rows = []
    for n in options.n:
        rows += run(bench, "kernels", int(n))
    for coupling in ("default", "default-rotations", "optimized"):
        rows += run(bench, "memory", coupling, 100_000)
    with tempfile.TemporaryDirectory() as folder:
        one = build_and_unpack(ONE_SLAVE, Path(folder), "one")
        many = build_and_unpack(surface(10_000), Path(folder), "many")
        rows += run(bench, "fmu", one) + run(bench, "fmu", many)
        start = time.perf_counter()
        tiefmu.build(tiefmu.load(surface(10_000)), Path(folder) / "timed.fmu")
        rows.append(["build-1e4", "10000", "1", f"{(time.perf_counter() - start) * 1e9:.0f}", "0", "0"])
        start = time.perf_counter()
        tiefmu.build(tiefmu.load(ROOT / "scenes" / "spotweld.toml"), Path(folder) / "spotweld.fmu")
        rows.append(["build-spotweld", "2", "1", f"{(time.perf_counter() - start) * 1e9:.0f}", "0", "0"])
    with options.output.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])

    print(f"{platform.machine()}, {compiler()}; ns per slave and cycle, per call, per value or per build")
    print(f"{'case':24}{'n':>10}{'threads':>9}{'ns':>16}{'bytes':>8}{'x bytes/triad':>15}")
    for case, n, threads, ns, moved, triad in rows:
        multiple = float(ns) / (float(moved) / float(triad)) if float(triad) else None
        print(f"{case:24}{n:>10}{threads:>9}{float(ns):>16,.2f}{moved:>8}" + (f"{multiple:>15.2f}" if multiple else ""))
    print(f"written to {options.output}")


def compiler() -> str:
    return subprocess.run(["c++", "--version"], capture_output=True, text=True).stdout.splitlines()[0]


if __name__ == "__main__":
    main()
