"""Builds host_and_tie.ssp (SSP 1.0): the two FMUs, the velocities that go one way and the loads that come back.

python examples/host_and_tie/build_ssp.py [FILE]
"""

import sys
import tempfile
import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

import fmpy
import tiefmu

HERE = Path(__file__).resolve().parent
PARTS = ("host", "tie")
STOP_TIME, STEP = 1.0, 2**-9  # s
SSP1 = "http://ssp-standard.org/SSP1/SystemStructure"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"


def connections(descriptions) -> list[tuple[str, str, str, str]]:
    """(from part, output, to part, input): `v` of a node to `v`, `f` to `f_ext`."""
    names = {
        part: {v.name: v.causality for v in description.modelVariables} for part, description in descriptions.items()
    }
    found = []
    for source, target, here, there in (("host", "tie", ".v[", ".v["), ("tie", "host", ".f[", ".f_ext[")):
        for name, causality in names[source].items():
            other = name.replace(here, there)
            if (
                name.startswith("master")
                and here in name
                and causality == "output"
                and names[target].get(other) == "input"
            ):
                found.append((source, name, target, other))
    return found


def structure(descriptions) -> str:
    """SystemStructure.ssd."""
    # Inputs that nothing feeds are left out: they keep their start values, and FMPy would feed them from elsewhere.
    fed = {(target, there) for _, _, target, there in connections(descriptions)}
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<ssd:SystemStructureDescription xmlns:ssd="{SSP1}Description" xmlns:ssc="{SSP1}Common" xmlns:oms="{OMS}"'
        ' version="1.0" name="host_and_tie">',
        '  <ssd:System name="system">',
        "    <ssd:Elements>",
    ]
    for part, description in descriptions.items():
        lines += [
            f'      <ssd:Component name="{part}" type="application/x-fmu-sharedlibrary"'
            f' source="resources/{part}.fmu" implementation="CoSimulation">',
            "        <ssd:Connectors>",
        ]
        lines += [
            f'          <ssd:Connector name={quoteattr(v.name)} kind="{v.causality}"><ssc:Real/></ssd:Connector>'
            for v in description.modelVariables
            if v.causality == "output" or (part, v.name) in fed
        ]
        lines += ["        </ssd:Connectors>", "      </ssd:Component>"]
    lines += ["    </ssd:Elements>", "    <ssd:Connections>"]
    lines += [
        f'      <ssd:Connection startElement="{source}" startConnector={quoteattr(here)}'
        f' endElement="{target}" endConnector={quoteattr(there)}/>'
        for source, here, target, there in connections(descriptions)
    ]
    lines += [
        "    </ssd:Connections>",
        # OMSimulator's command line aborts without a step of its own; others pass over it.
        '    <ssd:Annotations><ssc:Annotation type="org.openmodelica"><oms:Annotations><oms:SimulationInformation>',
        f'      <oms:FixedStepMaster description="oms-ma" stepSize="{STEP}" absoluteTolerance="0.0001"'
        ' relativeTolerance="0.0001"/>',
        "    </oms:SimulationInformation></oms:Annotations></ssc:Annotation></ssd:Annotations>",
        "  </ssd:System>",
        f'  <ssd:DefaultExperiment startTime="0" stopTime="{STOP_TIME}"/>',
        "</ssd:SystemStructureDescription>",
        "",
    ]
    return "\n".join(lines)


def build(path: Path) -> Path:
    """Writes the system to `path` and returns it; the same scenes give the same bytes."""
    with tempfile.TemporaryDirectory() as folder:
        fmus = {part: tiefmu.build(tiefmu.load(HERE / f"{part}.toml"), Path(folder) / f"{part}.fmu") for part in PARTS}
        descriptions = {part: fmpy.read_model_description(str(fmu)) for part, fmu in fmus.items()}
        files = {
            "SystemStructure.ssd": structure(descriptions).encode(),
            **{f"resources/{part}.fmu": fmu.read_bytes() for part, fmu in fmus.items()},
        }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return path


if __name__ == "__main__":
    print(build(Path(sys.argv[1] if len(sys.argv) > 1 else "host_and_tie.ssp")))
