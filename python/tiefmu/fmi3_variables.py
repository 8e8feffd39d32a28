"""The arrays of an FMI 3.0 FMU, element by element: every element a variable as FMI 2.0 has it, under the same name."""

import re
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np


@dataclass
class Element:
    """Of an array, or a scalar. array: its FMPy variable; place: in it, C order. The rest as in FMPy's descriptions of
    FMI 2.0 FMUs; type is Real for Float64."""

    name: str
    array: Any
    place: int
    start: str | None
    description: str | None

    @property
    def type(self) -> str:
        return "Real" if self.array.type == "Float64" else self.array.type

    @property
    def causality(self) -> str:
        return self.array.causality

    @property
    def variability(self) -> str | None:
        return self.array.variability

    @property
    def unit(self) -> str | None:
        return self.array.unit

    @property
    def declaredType(self) -> Any:
        return self.array.declaredType

    @property
    def valueReference(self) -> int:
        return self.array.valueReference


def elements(description: Any, xml: bytes) -> list[Element]:
    """Of all variables but the independent one, in the order of the description. xml: its text, as FMPy reads no more
    than one start value of a String.

    What tiefmu wrote has the names of its FMI 2.0 FMUs: master[2].v[3] is an element of the array master.v, number 2 by
    ascending id in master.node. Elements of other arrays have indices from 1: x[2,3].
    """
    lists = lists_of(description, xml)
    found = []
    for variable in description.modelVariables:
        if variable.causality == "independent":
            continue
        starts = (variable.start or "").split() if variable.type != "String" else []
        size = int(np.prod(variable.shape or ()))
        for place in range(size):
            start = starts[place] if len(starts) == size else starts[0] if len(starts) == 1 else None
            found.append(Element("", variable, place, start, variable.description))
        for element, (name, what) in zip(found[-size:] if size else [], names(variable, size, lists)):
            element.name = name
            if what:
                element.description = f"{(variable.description or '').split(';')[0]} ({what})"
    return found


def lists_of(description: Any, xml: bytes) -> dict[str, list]:
    """Ids and names of elements, by the name of their constant."""
    lists: dict[str, list] = {
        v.name: [int(text) for text in v.start.split()]
        for v in description.modelVariables
        if v.type == "Int64" and v.name.endswith(".node") and v.start
    }
    if b"<String" in xml:
        for each in ElementTree.fromstring(xml).iter("String"):
            if each.get("name", "").endswith(".name"):
                lists[each.get("name", "")] = [start.get("value", "") for start in each.iter("Start")]
    return lists


def names(variable: Any, size: int, lists: dict[str, list]) -> list[tuple[str, str]]:
    """Name of each element, and whose it is: "node 101", "port flange" or nothing."""
    shape = variable.shape or ()
    whole, short = re.sub("^(free|slave)_", "", variable.name).split(".", 1) if "." in variable.name else ("", "")
    last = ".name" if whole == "port" else ".node"
    all_of, own = lists.get(whole + last), lists.get(variable.name + last, lists.get(whole + last))
    if not shape:
        return [(variable.name, "")]
    components = size // shape[0] if shape[0] else 0
    if all_of is None or own is None or len(own) != shape[0] or components not in (1, 3) or variable.type != "Float64":
        indices = [",".join(str(k + 1) for k in index) for index in np.ndindex(*shape)]
        return [(f"{variable.name}[{index}]", "") for index in indices]
    number = {item: k for k, item in enumerate(sorted(all_of), 1)} if last == ".node" else {item: item for item in own}
    result = []
    for item in own:
        what = f"{'port' if whole == 'port' else 'node'} {item}"
        head = f"{whole}[{number[item]}].{short}"
        result += [(f"{head}[{k}]" if components == 3 else head, what) for k in range(1, components + 1)]
    return result
