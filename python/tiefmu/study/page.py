"""A self-contained HTML page of sections, each with text, charts (SVG inside the page) and a table."""

import re
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from ..html_page import document, paragraph, table


@dataclass
class Section:
    """text: paragraphs (plain text); figures: (caption, path of an SVG); header, rows: a table, numbers as they are."""

    title: str
    text: list[str] = field(default_factory=list)
    figures: list[tuple[str, Path]] = field(default_factory=list)
    header: list[str] = field(default_factory=list)
    rows: list[list] = field(default_factory=list)


def write(path: Path, title: str, intro: list[str], sections: list[Section]) -> None:
    """Writes the page. Raises OSError."""
    parts = [*map(paragraph, intro), "<nav>"]
    parts += [f'<p><a href="#s{n}">{escape(section.title)}</a></p>' for n, section in enumerate(sections)]
    parts.append("</nav>")
    for n, section in enumerate(sections):
        parts.append(f'<h2 id="s{n}">{escape(section.title)}</h2>')
        parts += map(paragraph, section.text)
        parts += [
            f"<figure>{svg(file, f's{n}f{k}-')}<figcaption>{escape(caption)}</figcaption></figure>"
            for k, (caption, file) in enumerate(section.figures)
        ]
        if section.rows:
            parts.append('<div class="scroll">' + table(section.header, section.rows) + "</div>")
    path.write_text(document(title, parts), encoding="utf-8")


def svg(file: Path, prefix: str) -> str:
    """The <svg> of the file, its ids made unique on the page."""
    text = file.read_text(encoding="utf-8")
    text = text[text.index("<svg") :]
    return re.sub(r'(\bid="|href="#|url\(#)', lambda match: match[0] + prefix, text)
