"""How figures look: everything that differs in colour differs in dashes or marker too."""

from matplotlib.axes import Axes

from companion.model import Layer

INK, GREY = "#222222", "#8c8c8c"
# Okabe and Ito's palette, which all kinds of colour vision tell apart; its oranges are the layers'.
COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#000000", "#56B4E9", "#8A6D00")
DASHES = ("-", (0, (5, 1.5)), (0, (6, 1.5, 1.2, 1.5)), (0, (1.2, 1.2)), (0, (9, 3)), (0, (3, 1, 1, 1, 1, 1)))
# Pale, behind what was flown in a layer.
BANDS = {Layer.OUTER: "#FFE2A6", Layer.INNER: "#EE9C6C"}


def dress(axes: Axes, xlabel: str, ylabel: str) -> None:
    """Labels, a faint grid, no box."""
    axes.set(xlabel=xlabel, ylabel=ylabel, axisbelow=True)
    axes.grid(color="#e4e4e4", lw=0.6)
    axes.tick_params(labelsize=9, color=GREY)
    axes.spines[["top", "right"]].set_visible(False)
