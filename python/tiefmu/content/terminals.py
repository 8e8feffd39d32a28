"""terminalsAndIcons.xml: what belongs to one node, as one plug. FMI 2.0.4 takes the file as FMI 3.0 defines it."""

from ..scene import Scene


def terminals(scene: Scene) -> bytes:
    """One terminal a port, a master (that has variables) and a slave, named like them. Members are called by what
    follows the node in the variable's name, e.g. v[1]: a tie's master matches any FMU with a terminal of the same
    members."""
    members, ids = {}, {}  # of each (prefix, number, or name of a port)
    for number, block in enumerate(scene.start.variables):
        prefix = block["prefix"]
        if prefix not in ("master", "slave", "port"):
            continue
        short = block["name"].removeprefix(prefix + ".")
        own = [f"{short}[{k}]" for k in (1, 2, 3)] if block["components"] == 3 else [short]
        names = iter(scene.start.variable_names(number))
        for place, node in zip(block["labels"] or block["numbers"].tolist(), block["ids"].tolist()):
            members.setdefault((prefix, place), []).extend(
                f'<TerminalMemberVariable variableName="{next(names)}" memberName="{member}" variableKind="signal"/>\n'
                for member in own
            )
            ids[prefix, place] = node
    parts = ['<?xml version="1.0" encoding="UTF-8"?>\n<fmiTerminalsAndIcons fmiVersion="3.0">\n<Terminals>\n']
    for prefix, place in sorted(members):
        node = "" if prefix == "port" else f", node {ids[prefix, place]}"
        parts.append(f'<Terminal name="{prefix}[{place}]" matchingRule="plug" description="{prefix}{node}">\n')
        parts += members[prefix, place]
        parts.append("</Terminal>\n")
    parts.append("</Terminals>\n</fmiTerminalsAndIcons>\n")
    return "".join(parts).encode()


def array_terminals(variables: list[dict]) -> bytes:
    """Of FMI 3.0: one terminal for all masters, and so on; members are called by what follows the dot: v, f, ..."""
    members: dict[str, list[str]] = {}
    for row in variables:
        owner, _, short = row["name"].partition(".")
        if owner.removeprefix("free_").removeprefix("slave_") in ("master", "slave", "port"):
            members.setdefault(owner, []).append(
                f'<TerminalMemberVariable variableName="{row["name"]}" memberName="{short}" variableKind="signal"/>\n'
            )
    parts = ['<?xml version="1.0" encoding="UTF-8"?>\n<fmiTerminalsAndIcons fmiVersion="3.0">\n<Terminals>\n']
    for owner, lines in sorted(members.items()):
        parts += [f'<Terminal name="{owner}" matchingRule="plug">\n', *lines, "</Terminal>\n"]
    parts.append("</Terminals>\n</fmiTerminalsAndIcons>\n")
    return "".join(parts).encode()
