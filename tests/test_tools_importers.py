"""Other people's importers against a plain sequence of calls, bit by bit.

Values are compared, never exit statuses: some importers report an FMU that they refuse as a run of zeros.
"""

import numpy as np
import pytest
from tool_cases import build, coupled_case, plain, python_host, run_tool, same_bits, tie_case

# When each passes values on and reads them; what it does is documented nowhere but in its answers.
ORDER = {
    "fmuloader": {},  # the sequence is that of tests/tools/run_fmuloader.py
    "libcosim": {},
    "ecos": {"read_last": True},
    "cofmupy": {"exchange_first": False},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("importers")


@pytest.fixture(scope="module")
def tie(folder) -> str:
    return build("tie", folder)


@pytest.mark.parametrize("tool", ORDER)
def test_the_tie_alone(tool, tie, folder):
    case = tie_case(tie)
    same_bits(run_tool(tool, case, folder), plain(case))


@pytest.mark.parametrize("tool", ORDER)
def test_host_and_tie(tool, tie, folder):
    case = coupled_case(build("host", folder), tie)
    same_bits(run_tool(tool, case, folder), plain(case, **ORDER[tool]))


@pytest.mark.parametrize("tool", ["libcosim", "ecos"])
def test_host_in_python_and_tie(tool, tie, folder):
    """The same bits as a plain sequence of calls, and the scene's motion to rounding: two programs, one host."""
    case = coupled_case(python_host(folder), tie)
    found = run_tool(tool, case, folder)
    same_bits(found, plain(case, **ORDER[tool]))
    for name, values in plain(coupled_case(build("host", folder), tie), **ORDER[tool]).items():
        np.testing.assert_allclose(found[name], values, rtol=0, atol=1e-12 * np.abs(values).max())
