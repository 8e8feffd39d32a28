"""Steps an FMI 3.0 FMU with fmuloader: one array is set, scalars are read. CASE.json ANSWER.json"""

import json
import sys
import xml.etree.ElementTree as xml
import zipfile
from pathlib import Path

from fmuloader.fmi3 import Fmi3Slave

case = json.loads(Path(sys.argv[1]).read_text())
with zipfile.ZipFile(case["fmu"]) as archive:
    description = xml.fromstring(archive.read("modelDescription.xml"))
reference = {v.get("name"): int(v.get("valueReference")) for v in description.find("ModelVariables")}
slave = Fmi3Slave(case["fmu"], model_identifier=description.find("CoSimulation").get("modelIdentifier"))
slave.instantiate_co_simulation("host", instantiation_token=description.get("instantiationToken"))
slave.enter_initialization_mode(start_time=0.0)
slave.exit_initialization_mode()
rows = []
for k, values in enumerate(case["values"]):
    slave.set_float64([reference[case["array"]]], values)
    slave.do_step(k * case["step"], case["step"])
    rows.append(slave.get_float64([reference[name] for name in case["scalars"]]))
slave.terminate()
slave.free_instance()
Path(sys.argv[2]).write_text(json.dumps(rows))
