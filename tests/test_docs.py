"""What pages and comments point at is there: sections and equations of docs/theory.md, its sources, files, headings."""

import re
import subprocess
from pathlib import Path
from typing import get_args

import pytest
import tiefmu
from fmu_scenes import extras
from tiefmu.schema import TABLES

ROOT = Path(__file__).resolve().parents[1]
TEXT = {".cpp", ".hpp", ".ipp", ".py", ".pyi", ".md", ".toml", ".txt", ".yaml", ""}
THEORY = (ROOT / "docs/theory.md").read_text()
PAGES = sorted(path.relative_to(ROOT).as_posix() for path in [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])

SECTIONS = set(re.findall(r"^## (\d+)\. ", THEORY, re.M))
EQUATIONS = re.findall(r" {2,}\((\d+\.\d+)\)$", THEORY, re.M)
SOURCES = re.findall(r"^- \*\*\[(.+?)\]\*\* ", THEORY, re.M)

# "theory 7", "theory (2.7)", "theory 2 and 3", "theory (4.1), (4.2)", "theory 2-7"
ONE = r"(?:\(\d+\.\d+\)|\d+(?!\.?\d))"
CITATION = re.compile(rf"\btheory ({ONE}(?:(?:, | and | to |-){ONE})*)", re.I)
NAME = r"[A-ZÀ-Ž][\w'-]+"
SOURCE = re.compile(rf"\[({NAME}(?: & {NAME}| et al\.)? \d{{4}})\]")
YEAR = re.compile(rf"\b{NAME}(?: et al\.)?,? \(?(?:1[89]\d\d|20[01]\d)\b(?!-)")


def files() -> list[Path]:
    """Text files of the project: what git tracks, or in an unpacked archive everything that is not built."""
    found = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if found.returncode == 0:
        paths = [ROOT / name for name in found.stdout.split("\0") if name]
    else:
        paths = [p for p in ROOT.rglob("*") if not {".venv", "build", "out"} & set(p.relative_to(ROOT).parts)]
    return [p for p in paths if p.suffix in TEXT and p.is_file() and p != Path(__file__).resolve()]


def comments(path: Path) -> str:
    """The text with its lines joined, so that a citation may run over a line's end."""
    return re.sub(r"\s*\n\s*(?://|#)?\s*", " ", path.read_text(errors="replace"))


def test_equations_are_numbered_in_order():
    assert {str(k) for k in range(1, 11)} == SECTIONS
    numbers = [tuple(map(int, number.split("."))) for number in EQUATIONS]
    for section in sorted({first for first, _ in numbers}):
        found = [second for first, second in numbers if first == section]
        assert found == list(range(1, len(found) + 1)), f"section {section}"
        assert section in range(1, 10)


def test_citations_of_the_theory_resolve():
    wrong, count = [], 0
    for path in files():
        for match in CITATION.finditer(comments(path)):
            for one in re.findall(ONE, match[1]):
                count += 1
                if one.strip("()") not in (EQUATIONS if one.startswith("(") else SECTIONS):
                    wrong.append(f"{path.relative_to(ROOT)}: {match[0]}")
    assert not wrong
    assert count > 50  # the pattern still finds them
    for number in re.findall(r"\((\d+\.\d+)\)", THEORY):
        assert number in EQUATIONS, f"docs/theory.md: ({number})"


def test_sources_are_listed():
    assert sorted(SOURCES) == SOURCES and len(SOURCES) == len(set(SOURCES))
    for path in files():
        for key in SOURCE.findall(comments(path)):
            assert key in SOURCES, f"{path.relative_to(ROOT)}: [{key}] is not in docs/theory.md"


def test_papers_are_cited_by_their_key():
    """Author and year outside brackets is a citation that the test above would not see."""
    wrong = []
    for path in files():
        if path.suffix in {".cpp", ".hpp", ".ipp", ".py"}:
            for match in YEAR.finditer(SOURCE.sub("", comments(path))):
                wrong.append(f"{path.relative_to(ROOT)}: {match[0]}")
    assert not wrong


def anchors(page: Path) -> set[str]:
    """Of the page's headings, as GitHub makes them."""
    lines = re.sub(r"```.*?```", "", page.read_text(), flags=re.S).splitlines()
    headings = [line.lstrip("#").strip().lower() for line in lines if line.startswith("#")]
    return {re.sub(r"[^\w\- ]", "", text).replace(" ", "-") for text in headings}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?```|`[^`\n]*`", "", (ROOT / page).read_text(), flags=re.S)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (ROOT / page).parent / path if path else ROOT / page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


INTERFACE = (ROOT / "docs/interface.md").read_text()


def test_the_interface_page_names_every_key_of_a_scene():
    for table, model in TABLES.items():
        assert f"`[{table}]`" in INTERFACE or f"`[[{table}]]`" in INTERFACE or f"`{table}`" in INTERFACE, table
        for key, field in model.model_fields.items():
            if table == "units":
                continue
            assert re.search(rf"`{key}`|`{key}[ =:]", INTERFACE), f"{table}.{key}"
            for value in get_args(field.annotation):
                if isinstance(value, str):
                    assert f'`"{value}"`' in INTERFACE, f"{table}.{key} = {value}"


def every_variable() -> set[str]:
    """Names without numbers and components, of scenes that show all there are."""
    nodes = [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [5, 0.3, 0.4, 0.2], [6, 0.3, 0.4, 1.2]]
    found = set()
    for motion, ports in (("free", []), ("driven", []), ("driven", ["masters", "slaves"])):
        scene = {
            "mesh": {"nodes": nodes, "segments": [[1, 1, 2, 3, 4]]},
            "node": [
                {"nodes": "all", "motion": motion, "rotations": True, "mass": 1.0, "inertia": 1.0},
                {"nodes": [6], "motion": "free"},
            ],
            "tie": [{"segments": "all", "slaves": [5]}],
            "spring": [{"nodes": [5, 6], "kind": "bushing", "stiffness": 1.0, "rotational_stiffness": 1.0}],
            "model": {"inertia": "consistent", "reaction": "split"},
            "integrator": {"threads": 1},
            "interface": {"expose": [*extras(), *(["port.r"] if ports else [])]},
        }
        if ports:
            members = {"masters": [1, 2, 3, 4], "slaves": [5]}
            scene["interface"]["ports"] = [{"name": name, "nodes": members[name]} for name in ports]
        found |= set(tiefmu.report(tiefmu.load(scene))["variables"])
    return found


def test_the_interface_page_names_every_variable():
    documented = set()
    for line in INTERFACE.splitlines():
        prefix = ""
        for name in re.findall(r"`([^`]+)`", line):
            name = re.sub(r"\[\w+\]", "", name)
            prefix = name.split(".")[0] if not name.startswith(".") else prefix
            documented.add(prefix + name if name.startswith(".") else name)
    found = every_variable()
    assert len(found) > 40
    assert found <= documented


def test_files_that_contributing_names_are_there():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    named = re.findall(r"`((?:src|fmu|modelDescription|python|tests|docs|bench)/[\w/.*]+|test_\w+\.py)`", text)
    assert len(named) > 20
    for name in named:
        assert list(ROOT.glob(f"tests/{name}" if name.startswith("test_") else name)), name
