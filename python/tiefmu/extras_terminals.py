"""terminalsAndIcons.xml: what belongs to one node, as one plug. FMI 2.0.4 takes the file as FMI 3.0 defines it."""

from .scene import Scene


def terminals(scene: Scene) -> bytes:
    """One terminal a master (that has variables) and a slave, named like them. Members are called by what follows the
    node in the variable's name, e.g. v[1]: a tie's master matches any FMU with a terminal of the same members."""
    members, ids = {}, {}  # of each (prefix, number); `#` stands for the number
    for block in scene.start.variables:
        prefix = block["prefix"]
        if prefix not in ("master", "slave"):
            continue
        short = block["name"].removeprefix(prefix + ".")
        names = [f"{short}[{k}]" for k in (1, 2, 3)] if block["components"] == 3 else [short]
        lines = "".join(f'<TerminalMemberVariable variableName="{prefix}[#].{name}" memberName="{name}" '
                        'variableKind="signal"/>\n' for name in names)
        for number, node in zip(block["numbers"].tolist(), block["ids"].tolist()):
            members.setdefault((prefix, number), []).append(lines)
            ids[prefix, number] = node
    parts = ['<?xml version="1.0" encoding="UTF-8"?>\n<fmiTerminalsAndIcons fmiVersion="3.0">\n<Terminals>\n']
    for prefix, number in sorted(members):
        parts.append(f'<Terminal name="{prefix}[{number}]" matchingRule="plug" '
                     f'description="{prefix}, node {ids[prefix, number]}">\n')
        parts.append("".join(members[prefix, number]).replace("#", str(number)))
        parts.append("</Terminal>\n")
    parts.append("</Terminals>\n</fmiTerminalsAndIcons>\n")
    return "".join(parts).encode()
