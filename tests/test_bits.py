"""The same bits whatever the C library picks for the processor, and own functions against 50 digits."""

import ctypes
import hashlib
import math
import os
import re
import subprocess
import sys
from decimal import Decimal, getcontext
from pathlib import Path

import numpy as np
import pytest
import tiefmu
from fmu_scenes import SETTINGS, scene
from tiefmu import _core
from tiefmu.content.reference_results import reference
from tiefmu.package import model_guid

SCENES = [path for path in sorted((Path(__file__).parents[1] / "scenes").iterdir()) if path.suffix in (".toml", ".rad")]
HIDDEN = "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX512F,-AVX512VL,-AVX,-SSE4_1"

# Functions of the C library that round in no stated way, so that each system (glibc: each processor) has its own.
VARIANT = {
    stem + suffix
    for stem in re.findall(
        r"\w+",
        "sin cos sincos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 exp10 expm1 log log2 log10 "
        "log1p pow cbrt hypot fma erf erfc tgamma lgamma csqrt cabs cexp clog cpow carg csin ccos",
    )
    for suffix in ("", "f", "l")
}


def everything(tables) -> str:
    """Hash of what a scene becomes and of what it does: GUID, resource, reference results, all numbers after a run
    with turns of up to half a radian a step."""
    loaded = tiefmu.load(tables)
    description = _core.Description(loaded.model, loaded.name, loaded.title)
    digest = hashlib.sha256(model_guid(loaded, description).encode())
    digest.update(loaded.model.resource(""))
    for data in reference(loaded, description.step_size).values():
        digest.update(data)
    simulation = loaded.simulation()
    rng = np.random.default_rng(3)
    for field, scale in (("velocity", 0.1), ("spin", 0.5), ("node_force", 1e-3), ("slave_force", 1e-3)):
        if field in simulation.fields:
            simulation.set(field, scale * rng.integers(-9, 10, simulation.get(field).shape))
    simulation.initialise(0.0)
    step = min(1.0, 5 * simulation.integrator_limit)
    try:
        for _ in range(10):
            simulation.step(step)
    except RuntimeError as error:  # what runs away does so alike
        digest.update(str(error).encode())
    for field in simulation.fields:
        digest.update(simulation.get(field).tobytes())
    return digest.hexdigest()


def all_scenes():
    """Hash of each scene, and of the C library's own sine."""
    library = ctypes.CDLL("libm.so.6")
    library.sin.restype, library.sin.argtypes = ctypes.c_double, [ctypes.c_double]
    sines = np.array([library.sin(0.001 * k) for k in range(20000)])
    print("libm", hashlib.sha256(sines.tobytes()).hexdigest())
    for path in SCENES:
        print(path.name, everything(path))
    for k, settings in enumerate(SETTINGS):
        print(k, everything(scene(np.random.default_rng(k), *settings)))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="glibc's own way to hide what a processor can do")
def test_the_same_bits_without_fused_multiply_add():
    """One process with glibc's functions for this processor, one with those for the oldest."""
    code = "import test_bits; test_bits.all_scenes()"
    said = []
    for tunables in ("", HIDDEN):
        environment = os.environ | {"GLIBC_TUNABLES": tunables, "PYTHONPATH": str(Path(__file__).parent)}
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        said.append(dict(line.split() for line in done.stdout.splitlines()))
    here, hidden = said
    if " fma " in Path("/proc/cpuinfo").read_text():
        assert here.pop("libm") != hidden.pop("libm")  # else nothing was hidden
    assert len(here) >= len(SCENES) + len(SETTINGS)
    assert [name for name in here if here[name] != hidden[name]] == []


def imports(library: Path) -> set[str]:
    done = subprocess.run(["nm", "-D", "--undefined-only", library], capture_output=True, text=True, check=True)
    return {line.split()[-1].split("@")[0] for line in done.stdout.splitlines()}


def test_no_function_is_imported_that_rounds_in_its_own_way():
    """What FMU and module import of the C library's functions is exact: sqrt, floor, fmod."""
    library = next((Path(_core.__file__).parent / "binaries").glob("tiefmu.*"))
    found = imports(library)
    assert "malloc" in found  # nm says something
    assert found & VARIANT == set()
    assert imports(Path(_core.__file__)) & VARIANT == set()


# --------------------------------------------------------------------------------- own functions, against 50 digits

getcontext().prec = 50
PI = Decimal("3.14159265358979323846264338327950288419716939937510")


def sine_and_cosine(angle: float) -> tuple[Decimal, Decimal]:
    x = Decimal(angle) % (2 * PI)
    sine, cosine, term = Decimal(0), Decimal(0), Decimal(1)
    for k in range(1, 80):
        if k % 2:
            cosine += term if k % 4 == 1 else -term
        else:
            sine += term if k % 4 == 2 else -term
        term *= x / k
    return sine, cosine


def test_sine_and_cosine():
    rng = np.random.default_rng(1)
    angles = [0.0, 5e-324, 1e-300, 1e5, *(k * math.pi / 4 for k in range(-9, 10)), *rng.normal(size=300).tolist()]
    angles += (10 ** rng.uniform(-9, 5, 300) * rng.choice([-1, 1], 300)).tolist()
    for angle in angles:
        for own, exact in zip(_core.kernels.sine_cosine(angle), sine_and_cosine(angle)):
            assert abs(Decimal(own) - exact) < Decimal("2.2e-16"), angle
    for angle in (1e6, -3e9, 1e15):  # no more than the rounding of the angle itself
        for own, exact in zip(_core.kernels.sine_cosine(angle), sine_and_cosine(angle)):
            assert abs(Decimal(own) - exact) < Decimal(math.ulp(angle)), angle
    for angle in (math.inf, -math.inf, math.nan):
        assert all(map(math.isnan, _core.kernels.sine_cosine(angle)))


def test_angle_of_a_point():
    """sin(angle) x = cos(angle) y: no arcus tangens needed."""
    rng = np.random.default_rng(2)
    points = [(0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (1e-300, 1.0), (1.0, 5e-324), (3.0, 4.0)]
    points += np.abs(rng.normal(size=(400, 2)) * 10 ** rng.uniform(-8, 8, (400, 1))).tolist()
    points += [(k / 8, 1.0) for k in range(9)] + [(np.nextafter(k / 8, 0), 1.0) for k in range(1, 9, 2)]
    for y, x in points:
        angle = _core.kernels.angle_of(y, x)
        sine, cosine = sine_and_cosine(angle)
        length = (Decimal(x) ** 2 + Decimal(y) ** 2).sqrt()
        assert abs(sine * Decimal(x) - cosine * Decimal(y)) / length < Decimal("2.3e-16"), (y, x)
    assert math.isnan(_core.kernels.angle_of(math.nan, 1.0)) and math.isnan(_core.kernels.angle_of(1.0, math.nan))
