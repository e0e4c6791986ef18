"""One page of HTML that needs nothing else: no scripts, no links, pictures inside, to be printed as it is.

Every text that is handed in is escaped here, and here alone: names of files and what cameras write into them are
strangers' words.
"""

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

STYLE = """
body { font: 16px/1.5 Georgia, serif; color: #1a1a1a; background: #fdfdfb; max-width: 62rem; margin: 2rem auto;
  padding: 0 1rem; }
h1 { font-size: 1.6rem; line-height: 1.25; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
h1, p, li, figcaption, table.words td { overflow-wrap: anywhere; }
.result { font-size: 1.2rem; border-left: 0.3rem solid #0072b2; padding: 0.2rem 0 0.2rem 1rem; }
.warning { color: #8a3000; } ul.warning { padding-left: 1.2rem; }
.note { font-size: 0.9rem; color: #555; }
table { border-collapse: collapse; font: 0.8rem/1.4 Helvetica, Arial, sans-serif; margin: 0.8rem 0;
  font-variant-numeric: tabular-nums; }
th, td { padding: 0.2rem 0.6rem; border-bottom: 1px solid #ddd; text-align: right; vertical-align: top; }
.numbers td { white-space: nowrap; }
.numbers td:first-child { white-space: normal; overflow-wrap: anywhere; min-width: 12em; }
th:first-child, td:first-child, table.words td, table.words th { text-align: left; }
thead th { border-bottom: 2px solid #888; }
.wide { overflow-x: auto; }
figure { margin: 1.2rem 0; } img { max-width: 100%; height: auto; } figcaption { font-size: 0.9rem; color: #555; }
summary { cursor: pointer; }
@media print { details::details-content { content-visibility: visible; block-size: auto; } }
@media print { body { background: white; margin: 0; max-width: none; font-size: 11px; }
  figure, tr { break-inside: avoid; } .wide { overflow: visible; } }
"""
# Should anything slip through in spite of it all, the reader's browser neither runs nor fetches it.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


def page(title: str, parts: Sequence[str]) -> str:
    """The whole document; `parts` are HTML."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(part for part in parts if part)
        + "\n</body>\n</html>\n"
    )


def heading(text: str, level: int = 2) -> str:
    """A heading."""
    return f"<h{level}>{escape(text)}</h{level}>"


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph; `kind` is one of the classes of the style."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def listed(texts: Sequence[str], kind: str = "") -> str:
    """A list, or nothing where there is nothing to list."""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<ul class="{kind}">{items}</ul>' if texts else ""


def table(head: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "numbers") -> str:
    """A table whose first column names the rows; `kind` is "numbers" or "words"."""

    def row(cells, tag):
        return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    top = f"<thead>{row(head, 'th')}</thead>" if head else ""
    below = "\n".join(row(cells, "td") for cells in rows)
    return f'<div class="wide"><table class="{kind}">{top}<tbody>{below}</tbody></table></div>'


def folded(title: str, inside: str) -> str:
    """What is shown on a click only; `inside` is HTML."""
    return f"<details><summary>{escape(title)}</summary>{inside}</details>"


def picture(path: Path, caption: str) -> str:
    """A PNG file, put into the page."""
    inline = base64.b64encode(path.read_bytes()).decode("ascii")
    words = escape(caption)
    return f'<figure><img alt="{words}" src="data:image/png;base64,{inline}"><figcaption>{words}</figcaption></figure>'
