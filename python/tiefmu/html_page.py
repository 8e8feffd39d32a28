"""HTML pages of one look: the documentation inside an FMU and the pages of the studies."""

from html import escape

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem; color: #1c2126; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 3rem; border-top: 1px solid #d0d5da; padding-top: 1.5rem; }
nav { columns: 2; } figure { margin: 1.5rem 0; } figure svg { width: 100%; height: auto; }
figcaption, caption { color: #56606a; text-align: left; padding: .5rem 0; }
.scroll { overflow: auto; max-height: 30rem; border: 1px solid #d0d5da; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
th, td { padding: .15rem .6rem; text-align: right; white-space: nowrap; border-bottom: 1px solid #e6e9ec; }
th { position: sticky; top: 0; background: #f3f5f7; } td:first-child, th:first-child { text-align: left; }
"""


def document(title: str, body: list[str]) -> str:
    """A whole page. title: plain text; body: HTML."""
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style>'
    return "\n".join(
        [
            "<!DOCTYPE html>",
            f'<html lang="en"><head>{head}</head><body>',
            f"<h1>{escape(title)}</h1>",
            *body,
            "</body></html>",
            "",
        ]
    )


def paragraph(text: str) -> str:
    return f"<p>{escape(text)}</p>"


def bullets(items: list[str]) -> str:
    """items: HTML."""
    return "<ul>\n" + "".join(f"<li>{item}</li>\n" for item in items) + "</ul>"


def table(header: list[str], rows: list[list], caption: str = "") -> str:
    """caption, header and cells: plain text, or numbers as they are."""
    above = f"<caption>{escape(caption)}</caption>" if caption else ""
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    body = "\n".join("<tr>" + "".join(f"<td>{escape(cell(value))}</td>" for value in row) + "</tr>" for row in rows)
    return f"<table>{above}<thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table>"


def cell(value) -> str:
    """Numbers to five digits, what is not there as a dash."""
    if isinstance(value, float):
        return f"{value:.5g}" if value == value else "-"
    return "-" if value is None else str(value)
