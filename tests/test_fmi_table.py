"""docs/fmi.md: every exported function is in the table, and the tests that it names exist."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_the_table_is_complete_and_true():
    text = (ROOT / "docs" / "fmi.md").read_text()
    rows = [row.split("|")[1:3] for row in text[text.index("| function |") :].splitlines()[2:] if row.startswith("|")]
    functions = [name for names, _ in rows for name in re.findall(r"`(fmi2\w+)`", names)]
    exported = {
        name
        for path in (ROOT / "fmu").glob("*.cpp")
        for name in re.findall(r"^(?:const )?[\w*]+ (fmi2\w+)\(", path.read_text(), re.MULTILINE)
    }
    assert len(exported) == 44
    assert sorted(functions) == sorted(exported)
    assert all(re.search(r"`test_\w+::test_\w+`", tests) for _, tests in rows)
    named = re.findall(r"`(test_\w+)::(test_\w+)`", text)
    assert len(named) > 40
    for module, test in named:
        assert f"\ndef {test}(" in (ROOT / "tests" / f"{module}.py").read_text(), f"{module}::{test}"
