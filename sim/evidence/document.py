"""The evidence as one PDF in A4: a title page, then the sections in the order of the page."""

import io
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.image import imread

from sim.evidence.blocks import Drawing, Section, Table
from sim.evidence.content import TITLE

_WIDTH_IN, _HEIGHT_IN = 8.27, 11.69
_MARGIN_IN, _FOOT_IN = 0.6, 0.6
_TEXT_IN = _WIDTH_IN - 2.0 * _MARGIN_IN
_POINT_IN = 1.0 / 72.0
# Mean width of a letter of DejaVu Sans, as a share of its size: in words, and in tables with many digits.
_LETTER, _TABLE_LETTER = 0.48, 0.56
_GAP = 2  # letters between two columns
_BOLD = 1.25  # width of a bold letter
_BODY_PT, _TABLE_PT, _SMALLEST_PT = 9.5, 8.0, 5.5
_LINE = 1.45
_DOTS_PER_IN = 200


def write_document(path: Path, sections: Sequence[Section], subtitle: str, details: Sequence[str]) -> None:
    """Write the document; `details` stand on its title page."""
    with mpl.rc_context({"pdf.fonttype": 42}), PdfPages(path, metadata={"Title": TITLE}) as file:
        pages = _Pages(file, subtitle)
        pages.title_page(subtitle, details, [section.title for section in sections])
        for section in sections:
            pages.heading(section)
            for block in section.blocks:
                pages.add(block)
        pages.close()


class _Pages:
    """Blocks set one below the other; a page begins where one does not fit."""

    def __init__(self, file: PdfPages, footer: str) -> None:
        self._file, self._footer, self._number = file, footer, 0
        self._page: Figure | None = None
        self._left_in = 0.0

    def title_page(self, subtitle: str, details: Sequence[str], contents: Sequence[str]) -> None:
        """The title, what was flown, and the list of sections."""
        page = self._begin()
        self._left_in -= 2.0
        self._line(page, TITLE, 24.0, weight="bold")
        self._left_in -= 0.2
        self.paragraph(subtitle)
        for detail in details:
            self.paragraph(detail)
        self._left_in -= 0.4
        self._line(page, "Contents", 12.0, weight="bold")
        for title in contents:
            self._line(page, title, _BODY_PT)
        self._end()

    def heading(self, section: Section) -> None:
        """A section begins, with room for some of its text, or for a figure that is near its beginning."""
        near = [_drawn_in(block.figure)[1] for block in section.blocks[:2] if isinstance(block, Drawing)]
        page = self._room(max([2.0, *(height_in + 1.6 for height_in in near)]))
        self._left_in -= 0.25
        self._line(page, section.title, 14.0, weight="bold")
        self._left_in -= 0.08

    def add(self, block: str | Table | Drawing) -> None:
        """One block."""
        if isinstance(block, Table):
            self.table(block)
        elif isinstance(block, Drawing):
            self.drawing(block)
        else:
            self.paragraph(block)

    def paragraph(self, text: str) -> None:
        """Wrapped text."""
        lines = textwrap.wrap(text, int(_TEXT_IN / (_BODY_PT * _POINT_IN * _LETTER))) or [""]
        if len(lines) == 1:
            self._room(1.2)  # a short line stands above what it announces
        for line in lines:
            self._line(self._room(_height_in(_BODY_PT)), line, _BODY_PT)
        self._left_in -= 0.1

    def table(self, block: Table) -> None:
        """A table with its head repeated on each page; its letters are as large as its width allows."""
        widths = _widths(block)
        size_pt = min(_TABLE_PT, max(_TEXT_IN / (sum(widths) * _TABLE_LETTER * _POINT_IN), _SMALLEST_PT))
        scale_in = min(size_pt * _TABLE_LETTER * _POINT_IN, _TEXT_IN / sum(widths))
        ends_in = [_MARGIN_IN + scale_in * sum(widths[: n + 1]) for n in range(len(widths))]
        row_in = 1.1 * _height_in(size_pt)
        head = [
            textwrap.wrap(one, max(round((wide - _GAP) / _BOLD), 4), break_long_words=False)
            for one, wide in zip(block.head, widths, strict=True)
        ]
        lines = _head_lines(head)
        begun: Figure | None = None
        for row in block.rows:
            page = self._room(row_in * (1 if begun else len(lines) + 2))
            if page is not begun:
                for line in lines:
                    self._cells(page, line, ends_in, size_pt, row_in, weight="bold")
                self._rule(page, ends_in[-1], "#444")
                begun = page
            self._cells(page, row, ends_in, size_pt, row_in)
            self._rule(page, ends_in[-1], "#ddd")
        self._left_in -= 0.2

    def drawing(self, block: Drawing) -> None:
        """A figure as wide as the text, and its caption."""
        width_in, height_in = _drawn_in(block.figure)
        page = self._room(height_in + 0.5)
        self._left_in -= height_in
        corner = _MARGIN_IN / _WIDTH_IN, self._left_in / _HEIGHT_IN
        axes = page.add_axes((*corner, width_in / _WIDTH_IN, height_in / _HEIGHT_IN))
        axes.imshow(_pixels(block.figure))
        axes.set_axis_off()
        self.paragraph(block.caption)

    def close(self) -> None:
        """Write the last page."""
        if self._page is not None:
            self._end()

    def _begin(self) -> Figure:
        self._number += 1
        self._page = page = Figure(figsize=(_WIDTH_IN, _HEIGHT_IN))
        FigureCanvasAgg(page)
        self._left_in = _HEIGHT_IN - _MARGIN_IN
        left, right = _MARGIN_IN / _WIDTH_IN, 1.0 - _MARGIN_IN / _WIDTH_IN
        page.text(left, 0.03, self._footer, fontsize=7.0, color="#666")
        page.text(right, 0.03, str(self._number), fontsize=7.0, color="#666", ha="right")
        return page

    def _end(self) -> None:
        self._file.savefig(self._page)  # type: ignore[no-untyped-call]
        self._page = None

    def _room(self, height_in: float) -> Figure:
        """The page with so much room left, a new one if necessary."""
        if self._page is not None and self._left_in - height_in < _FOOT_IN:
            self._end()
        return self._page or self._begin()

    def _line(self, page: Figure, text: str, size_pt: float, weight: str = "normal") -> None:
        self._left_in -= _height_in(size_pt)
        left, up = _MARGIN_IN / _WIDTH_IN, self._left_in / _HEIGHT_IN
        page.text(left, up, text, fontsize=size_pt, weight=weight, va="bottom")

    def _cells(
        self, page: Figure, row: Sequence[str], ends_in: Sequence[float], size_pt: float, row_in: float,
        weight: str = "normal",
    ) -> None:  # fmt: skip
        self._left_in -= row_in
        up = (self._left_in + 0.15 * row_in) / _HEIGHT_IN
        for number, (cell, end_in) in enumerate(zip(row, ends_in, strict=True)):
            across_in, side = (end_in, "right") if number else (_MARGIN_IN, "left")
            page.text(across_in / _WIDTH_IN, up, cell, fontsize=size_pt, weight=weight, ha=side, va="bottom")

    def _rule(self, page: Figure, end_in: float, colour: str) -> None:
        up = self._left_in / _HEIGHT_IN
        line = mpl.lines.Line2D([_MARGIN_IN / _WIDTH_IN, end_in / _WIDTH_IN], [up, up], color=colour, lw=0.5)
        page.add_artist(line)


def _drawn_in(figure: Figure) -> tuple[float, float]:
    """Width and height of a figure on a page [in]: as wide as the text, unless it is too high for that."""
    across_in, up_in = figure.get_size_inches()
    height_in = min(_TEXT_IN * up_in / across_in, _HEIGHT_IN - _MARGIN_IN - _FOOT_IN - 1.7)
    return height_in * across_in / up_in, height_in


def _widths(block: Table) -> list[int]:
    """Letters of each column with its gap; a head takes two lines if it is longer than the cells."""
    heads = [_head_letters(head) for head in block.head]
    cells = [max(map(len, column)) for column in zip(*block.rows, strict=True)] or heads
    return [max(head, cell) + _GAP for head, cell in zip(heads, cells, strict=True)]


def _head_letters(head: str) -> int:
    """The letters that a head needs in two lines; bold ones are wider."""
    return round(_BOLD * max(-(-len(head) // 2) + 1, *map(len, head.split() or [""])))


def _head_lines(head: Sequence[list[str]]) -> list[list[str]]:
    """The lines of a wrapped head; short cells stand at the bottom."""
    most = max(map(len, head))
    padded = [[""] * (most - len(cell)) + cell for cell in head]
    return [list(line) for line in zip(*padded, strict=True)]


def _height_in(size_pt: float) -> float:
    return _LINE * size_pt * _POINT_IN


def _pixels(figure: Figure) -> Any:
    """The figure as an image: many small lines of a map or a curve stay small in the file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DOTS_PER_IN)
    buffer.seek(0)
    return imread(buffer)
