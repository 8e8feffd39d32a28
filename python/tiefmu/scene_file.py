"""Writing a scene file."""

import re

import tomli_w


def toml_text(tables: dict) -> str:
    """A scene as TOML: single values first, then tables, then arrays of tables; a short list, as a row of a list of
    lists, stands on one line."""
    single = {key: item for key, item in tables.items() if not isinstance(item, dict) and not is_array(item)}
    parts = [tomli_w.dumps(single)] if single else []
    parts += [tomli_w.dumps({key: item}) for key, item in tables.items() if isinstance(item, dict)]
    for key, item in tables.items():
        for table in item if is_array(item) else []:
            # as [[key]], and never as an inline table
            parts.append(tomli_w.dumps({key: table}).replace(f"[{key}]", f"[[{key}]]", 1))
    return re.sub(r"\[\n((?: +[^\[\]\n]*,\n)+) *\]", on_one_line, "\n".join(parts))


def is_array(item: object) -> bool:
    return isinstance(item, list) and bool(item) and isinstance(item[0], dict)


def on_one_line(match: re.Match) -> str:
    """A list without lists in it."""
    line = "[" + " ".join(line.strip() for line in match[1].splitlines()).removesuffix(",") + "]"
    return line if len(line) <= 100 else match[0]
