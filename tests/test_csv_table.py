"""CSV files in the spellings of loggers, spreadsheets and test systems: all of them the same numbers."""

from pathlib import Path

import numpy as np
import pytest
from tiefmu.csv_table import read_table
from tiefmu.errors import RunError

TIME, FORCE = [0.0, 0.25, 0.5, 0.5, 1.0], [0.0, -1.5, 1234.5, 2e-3, 7.0]
ROWS = [f"{t},{f}" for t, f in zip(TIME, FORCE)]
GERMAN = [f"{t};{f};".replace(".", ",") for t, f in zip(TIME, FORCE)]

SPELLINGS = {
    "plain": ("\n".join(["time,force", *ROWS]), "utf-8"),
    "with a mark and Windows' line ends": ("\r\n".join(["time,force", *ROWS, ""]), "utf-8-sig"),
    "UTF-16 with tabs": ("\r\n".join(["time\tforce", *(row.replace(",", "\t") for row in ROWS)]), "utf-16"),
    "semicolons, decimal commas, one at the end": ("\n".join(["time;force;", *GERMAN]), "utf-8"),
    "blanks and quotes": ("\n".join([' "time" , "force" ', *(row.replace(",", " , ") for row in ROWS)]), "utf-8"),
    "lines above the header": ("\n".join(["Prüfstand 3;;", "Messung;17,5;", "", "time;force;", *GERMAN]), "cp1252"),
    "a line of units": ("\n".join(["time,force", "ms,kN", *ROWS]), "utf-8"),
    "a line of units, one of which is a number": ("\n".join(["time,force", "[ms],1", *ROWS]), "utf-8"),
    "columns nobody asks for": (
        "\n".join(["note,time,,force", *(f"x,{t},,{f}" for t, f in zip(TIME, FORCE))]),
        "utf-8",
    ),
    "rows of other columns": (
        "\n".join(["time,force,other", *(f"{row},\n{t},,1" for row, t in zip(ROWS, TIME)), ",,"]),
        "utf-8",
    ),
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_spellings(tmp_path, spelling):
    text, encoding = SPELLINGS[spelling]
    path = tmp_path / "in.csv"
    path.write_bytes(text.encode(encoding))
    found = read_table(path, lambda header: None, ["force"])
    assert found.names == ["time", "force"]
    np.testing.assert_array_equal(found.values, np.column_stack([TIME, FORCE]))
    assert found.unit == ("ms" if "units" in spelling else "")


@pytest.mark.parametrize(
    "clock, below, unit",
    [
        ("Time [ms]", "", "ms"),
        ("Zeit / s", "", "s"),
        ("t_us", "", "us"),
        ("Time (ms)", "[s],N\n", "s"),  # the line of units is about the values
        ("time", "", ""),
        ("Time [h]", "", ""),
    ],
)
def test_the_unit_of_time(tmp_path, clock, below, unit):
    path = tmp_path / "in.csv"
    path.write_text(f"{clock},force\n{below}0,1\n1,2\n")
    found = read_table(path, lambda header: None, ["force"], clock)
    assert (found.unit, found.values.tolist()) == (unit, [[0, 1], [1, 2]])


@pytest.mark.parametrize(
    "text, line",
    [
        ("", "is empty; expected a header with 'time' and names of columns"),
        ("a;b\nZeit [ms];Kraft [kN]\n0;1\n", "has no column 'time'; found a, b"),
        ("Messung 17\nZeit [ms];Kraft [kN]\n0;1\n", "has no column 'time'; found Zeit [ms], Kraft [kN]"),
        ("time,force\ns,N\n", "has no values below its header"),
        ("time,force\n0,1\n1,\n2,x\n", "line 4: force: expected a number, found 'x'"),
        ("time,force\n0,1\n1,nan\n", "line 3: force: nan is not a finite number"),
        ("time,force\n0,1\n1,2,3\n", "line 3: expected 2 values, found 3"),
        ("time,force\n0,1,5\n", "line 2: expected 2 values, found 3"),
        ("time,force\n0,\n1,\n", "no line has values of time and force"),
        ("time,force\n0,1\n2,\n1,2\n0.5,3\n", "line 5: time goes back from 1 to 0.5 s; times must not decrease"),
        ("time,force,force\n0,1,2\n", "column 'force' is repeated"),
        ("time,fo\0rce\n0,1\n", "not a CSV file: holds zero bytes, as binary files do"),
    ],
)
def test_what_is_wrong(tmp_path, text, line):
    path = Path(tmp_path) / "in.csv"
    path.write_text(text)
    with pytest.raises(RunError) as error:
        read_table(path, lambda header: None, ["force"])
    assert str(error.value) == f"{path}: {line}"
