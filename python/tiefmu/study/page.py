"""A self-contained HTML page of sections, each with text, charts (SVG inside the page) and a table."""

import html
import re
from dataclasses import dataclass, field
from pathlib import Path

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem; color: #1c2126; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 3rem; border-top: 1px solid #d0d5da; padding-top: 1.5rem; }
nav { columns: 2; } figure { margin: 1.5rem 0; } figure svg { width: 100%; height: auto; }
figcaption { color: #56606a; } .scroll { overflow: auto; max-height: 30rem; border: 1px solid #d0d5da; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
th, td { padding: .15rem .6rem; text-align: right; white-space: nowrap; border-bottom: 1px solid #e6e9ec; }
th { position: sticky; top: 0; background: #f3f5f7; } td:first-child, th:first-child { text-align: left; }
"""


@dataclass
class Section:
    """text: paragraphs (plain text); figures: (caption, path of an SVG); header, rows: a table, numbers as they are."""

    title: str
    text: list[str] = field(default_factory=list)
    figures: list[tuple[str, Path]] = field(default_factory=list)
    header: list[str] = field(default_factory=list)
    rows: list[list] = field(default_factory=list)


def write(path: Path, title: str, intro: list[str], sections: list[Section]):
    """Writes the page. Raises OSError."""
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f"<title>{html.escape(title)}</title>",
        f"<style>{STYLE}</style></head><body>",
        f"<h1>{html.escape(title)}</h1>",
        *map(paragraph, intro),
        "<nav>",
    ]
    parts += [f'<p><a href="#s{n}">{html.escape(section.title)}</a></p>' for n, section in enumerate(sections)]
    parts.append("</nav>")
    for n, section in enumerate(sections):
        parts.append(f'<h2 id="s{n}">{html.escape(section.title)}</h2>')
        parts += map(paragraph, section.text)
        parts += [
            f"<figure>{svg(file, f's{n}f{k}-')}<figcaption>{html.escape(caption)}</figcaption></figure>"
            for k, (caption, file) in enumerate(section.figures)
        ]
        if section.rows:
            parts.append('<div class="scroll">' + table(section.header, section.rows) + "</div>")
    path.write_text("\n".join([*parts, "</body></html>", ""]), encoding="utf-8")


def paragraph(text: str) -> str:
    return f"<p>{html.escape(text)}</p>"


def table(header: list[str], rows: list[list]) -> str:
    head = "".join(f"<th>{html.escape(name)}</th>" for name in header)
    body = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(cell(value))}</td>" for value in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table>"


def cell(value) -> str:
    """Numbers to four digits, what is not there as a dash."""
    if isinstance(value, float):
        return f"{value:.4g}" if value == value else "-"
    return "-" if value is None else str(value)


def svg(file: Path, prefix: str) -> str:
    """The <svg> of the file, its ids made unique on the page."""
    text = file.read_text(encoding="utf-8")
    text = text[text.index("<svg") :]
    text = re.sub(r'(\bid="|href="#|url\(#)', lambda match: match[0] + prefix, text)
    return text
