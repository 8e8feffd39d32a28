"""Writes the input CSVs of the scenes that have no mesh script: python scenes/make_inputs.py"""

from pathlib import Path

import numpy as np

HERE = Path(__file__).parent


def write(name, columns):
    """columns: {"time": ..., variable name: ...}, one value per row, SI."""
    rows = zip(*columns.values())
    lines = [",".join(columns)] + [",".join(f"{x:.9g}" for x in row) for row in rows]
    (HERE / f"{name}.csv").write_text("\n".join(lines) + "\n")


def bump(t, start, length):
    """A half wave of sin^2: 0 outside [start, start + length], 1 in the middle."""
    return np.where((t > start) & (t < start + length), np.sin(np.pi * (t - start) / length) ** 2, 0.0)


def spotweld():
    # 2 ms: the quad lifts and rolls, then twists; both welds are pulled out of the plane and sheared meanwhile.
    t = np.linspace(0, 2e-3, 201)
    lift, roll, twist = bump(t, 0, 1e-3), bump(t, 0.2e-3, 1e-3), bump(t, 1.0e-3, 0.8e-3)
    columns = {"time": t}
    for i, (x, y) in enumerate([(-1, -1), (1, -1), (1, 1), (-1, 1)], start=1):
        columns[f"master[{i}].v[3]"] = 0.5 * lift + 20 * roll * 0.005 * y + 0.3 * twist * x * y
        columns[f"master[{i}].w[1]"] = 20 * roll
    for j in (1, 2):
        columns[f"slave[{j}].f[3]"] = 800 * bump(t, 0, 2e-3)
        columns[f"slave[{j}].f[1]"] = 300 * bump(t, 0.5e-3, 1.5e-3)
    write("spotweld", columns)


def rivet():
    # 0.05 ms of up to 4 x 250 N on the lower sheet's middle quad, the rest of the 1 ms is the answer.
    t = np.linspace(0, 1e-3, 501)
    write("rivet", {"time": t} | {f"master[{i}].f_ext[3]": 250 * bump(t, 0, 5e-5) for i in RIVET_MASTERS})


def heavy_slave():
    # 20 ms: the quad is shaken upwards and rocks about y; the bolt is pulled sideways at the end.
    t = np.linspace(0, 0.02, 401)
    p = 0.01
    shake, rock = bump(t, 0, p), bump(t, 0.004, p)
    rate = np.pi / p  # d/dt of sin^2 is rate * sin(2 ...)
    d_shake = np.where(shake > 0, rate * np.sin(2 * np.pi * t / p), 0.0)
    d_rock = np.where(rock > 0, rate * np.sin(2 * np.pi * (t - 0.004) / p), 0.0)
    velocity, acceleration = {"time": t}, {}
    for i, x in enumerate([-1, 1, 1, -1], start=1):
        velocity[f"master[{i}].v[3]"] = 0.2 * shake - 0.05 * rock * x
        acceleration[f"master[{i}].a[3]"] = 0.2 * d_shake - 0.05 * d_rock * x
    pull = {"slave[1].f[1]": 50 * bump(t, 0.012, 0.008)}
    write("heavy_slave", velocity | pull)
    write("heavy_slave_split", velocity | acceleration | pull)


def pin_weld():
    # 2 ms: the upper sheet's quad lifts, rolls about its edge y = 0 and shears.
    t = np.linspace(0, 2e-3, 201)
    lift, roll, shear = bump(t, 0, 1e-3), bump(t, 0.2e-3, 1e-3), bump(t, 1.0e-3, 0.8e-3)
    columns = {"time": t}
    for i, y in ((5, 0), (6, 0), (7, 0.01), (8, 0.01)):  # nodes 15, 16, 18, 19
        columns[f"master[{i}].v[3]"] = 0.05 * lift + 5 * roll * y
        columns[f"master[{i}].v[1]"] = 0.05 * shear
        columns[f"master[{i}].w[1]"] = 5 * roll
    write("pin_weld", columns)


RIVET_MASTERS = (1, 2, 3, 4)  # nodes 6, 7, 10, 11

if __name__ == "__main__":
    spotweld()
    rivet()
    heavy_slave()
    pin_weld()
