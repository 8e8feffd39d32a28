"""Writing a scene file."""

import json


def text(tables: dict) -> str:
    """A scene as TOML: single values first, then tables, then arrays of tables; one row of a list of lists a line."""
    lines = [f"{key} = {value(item)}" for key, item in tables.items() if not is_table(item) and not is_array(item)]
    for key, item in tables.items():
        if is_table(item):
            lines += ["", f"[{key}]", *pairs(item)]
    for key, item in tables.items():
        for table in item if is_array(item) else []:
            lines += ["", f"[[{key}]]", *pairs(table)]
    return "\n".join(lines) + "\n"


def is_table(item) -> bool:
    return isinstance(item, dict)


def is_array(item) -> bool:
    return isinstance(item, list) and bool(item) and isinstance(item[0], dict)


def pairs(table: dict) -> list[str]:
    return [f"{key} = {value(item)}" for key, item in table.items()]


def value(item) -> str:
    if isinstance(item, bool):
        return "true" if item else "false"
    if isinstance(item, (list, tuple)):
        if item and isinstance(item[0], (list, tuple)):
            return "[\n" + "".join(f"  {value(row)},\n" for row in item) + "]"
        return "[" + ", ".join(map(value, item)) + "]"
    if isinstance(item, str):
        return json.dumps(item, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(item)
