"""The style of figures: lines of different colours also differ in dashes or markers."""

from matplotlib.axes import Axes

from companion.model import Layer

INK, GREY = "#222222", "#8c8c8c"
# Okabe and Ito's palette, which is safe for colour blindness; its oranges are reserved for the layers.
COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#000000", "#56B4E9", "#8A6D00")
DASHES = ("-", (0, (5, 1.5)), (0, (6, 1.5, 1.2, 1.5)), (0, (1.2, 1.2)), (0, (9, 3)), (0, (3, 1, 1, 1, 1, 1)))
# Pale backgrounds for times in a layer.
BANDS = {Layer.OUTER: "#FFE2A6", Layer.INNER: "#EE9C6C"}


def dress(axes: Axes, xlabel: str, ylabel: str) -> None:
    """Set labels and a faint grid, without a box."""
    axes.set(xlabel=xlabel, ylabel=ylabel, axisbelow=True)
    axes.grid(color="#e4e4e4", lw=0.6)
    axes.tick_params(labelsize=9, color=GREY)
    axes.spines[["top", "right"]].set_visible(False)
