"""The weld against its reference, by FMPy alone; before: tiefmu build weld.toml --criteria criteria.toml"""

from pathlib import Path

import fmpy
import numpy as np

HERE = Path(__file__).parent


def read(name):
    return np.genfromtxt(HERE / name, delimiter=",", names=True, deletechars="")


def test_share_of_master_3():
    reference = read("reference.csv")  # kN over ms
    run = fmpy.simulate_fmu(str(HERE / "weld.fmu"), input=read("load.csv"), stop_time=0.01, output_interval=5e-5)
    expected = 1e3 * np.interp(run["time"], 1e-3 * reference["time"], reference["force"])
    assert np.abs(run["master[3].f[3]"] - expected).max() < 0.2 + 0.02 * expected.max()
