"""Pages that open offline: one HTML file without scripts, with its figures embedded."""

import base64
import html
import io
from collections.abc import Iterable, Sequence

import matplotlib as mpl
from matplotlib.figure import Figure

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem;
  color: #222; }
table { border-collapse: collapse; margin: 1rem 0; } th, td { padding: .3rem .7rem; text-align: right; }
th:first-child, td:first-child { text-align: left; } tr { border-bottom: 1px solid #ddd; }
img { max-width: 100%; } .over { font-weight: bold; } .over::after { content: " over the line"; }
h3 { margin-bottom: 0; } p.why { color: #555; margin-top: 0; }
@media (prefers-color-scheme: dark) { body { background: #181818; color: #eee; } tr { border-color: #444; }
img { background: #fff; } p.why { color: #bbb; } }
"""


def page(title: str, parts: Iterable[str], more_style: str = "") -> str:
    """The whole file; `parts` are HTML."""
    head = (
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content='width=device-width'>"
        f"\n<title>{html.escape(title)}</title><style>{STYLE}{more_style}</style>"
    )
    return "\n".join([head, *parts]) + "\n</html>\n"


def table(head: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "") -> str:
    """An HTML table; cells are HTML, `kind` is the class of the table."""
    begin = f"<table class={kind}>" if kind else "<table>"
    lines = [f"{begin}<tr>" + "".join(f"<th>{cell}</th>" for cell in head) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows]
    return "\n".join(lines) + "</table>"


def why(text: str) -> str:
    """A paragraph that explains what is above it."""
    return f"<p class=why>{text}</p>"


def image(figure: Figure, alt: str) -> str:
    """A figure as an embedded image with an alternative text."""
    buffer = io.BytesIO()
    # No date and no random ids, so that the same flight gives the same page.
    with mpl.rc_context({"svg.hashsalt": "companion"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    drawn = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f"<img alt='{html.escape(alt)}' src='data:image/svg+xml;base64,{drawn}'>"
