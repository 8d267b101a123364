"""What page and document consist of: sections of paragraphs, tables and figures."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Table:
    """A table of plain text; the first column is aligned to the left."""

    head: tuple[str, ...]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure with its caption."""

    figure: Figure
    caption: str


@dataclass(frozen=True, slots=True)
class Section:
    """A heading, and what stands below it; text is a paragraph."""

    title: str
    blocks: Sequence[str | Table | Drawing]
