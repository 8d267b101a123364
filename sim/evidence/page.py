"""The evidence as one HTML file, readable offline."""

import html
from collections.abc import Sequence

from companion.report.html import image, table, why
from companion.report.html import page as html_page
from sim.evidence.blocks import Drawing, Section, Table
from sim.evidence.content import TITLE

_STYLE = """
body { max-width: 78rem; } table { font-size: .85rem; display: block; overflow-x: auto; }
td { white-space: nowrap; } nav a { margin-right: 1rem; }
"""


def page(sections: Sequence[Section], subtitle: str) -> str:
    """The whole page."""
    links = "".join(
        f"<a href='#s{n}'>{html.escape(section.title)}</a> " for n, section in enumerate(sections)
    )
    parts = [f"<h1>{html.escape(TITLE)}</h1>", why(html.escape(subtitle)), f"<nav>{links}</nav>"]
    for number, section in enumerate(sections):
        parts.append(f"<h2 id=s{number}>{html.escape(section.title)}</h2>")
        parts += [_block(block) for block in section.blocks]
    return html_page(TITLE, parts, _STYLE)


def _block(block: str | Table | Drawing) -> str:
    if isinstance(block, Table):
        rows = [[html.escape(cell) for cell in row] for row in block.rows]
        return table([html.escape(cell) for cell in block.head], rows)
    if isinstance(block, Drawing):
        return image(block.figure, block.caption) + why(html.escape(block.caption))
    return f"<p>{html.escape(block)}</p>"
