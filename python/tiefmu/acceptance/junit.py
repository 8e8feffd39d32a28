"""JUnit XML, as test systems read it: one test case per criterion."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from .verdict import Verdict


def write(path: Path, name: str, verdicts: list[Verdict], seconds: float) -> None:
    """name: of the suite. Raises OSError."""
    failed = sum(not verdict.passed for verdict in verdicts)
    counts = {"tests": str(len(verdicts)), "failures": str(failed), "errors": "0", "skipped": "0"}
    counts["time"] = f"{seconds:.6f}"
    top = ElementTree.Element("testsuites", {"name": "tiefmu accept", **counts})
    suite = ElementTree.SubElement(top, "testsuite", {"name": name, **counts})
    for verdict in verdicts:
        case = ElementTree.SubElement(
            suite, "testcase", {"name": verdict.name, "classname": f"{name}.{verdict.kind}", "time": "0"}
        )
        unit = f" {verdict.unit}" if verdict.unit not in ("", "1") else ""
        said = "; ".join(filter(None, [f"{verdict.value!r}{unit}", f"asked: {verdict.asked}", verdict.where]))
        if not verdict.passed:
            ElementTree.SubElement(case, "failure", {"message": said, "type": verdict.kind}).text = said
        ElementTree.SubElement(case, "system-out").text = said
    ElementTree.indent(top)
    ElementTree.ElementTree(top).write(path, encoding="utf-8", xml_declaration=True)
