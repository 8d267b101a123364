"""Parts of the figure of one encounter: the map, and the separation with the volumes as bands."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from companion.model import Layer
from companion.report.drawing import BANDS
from companion.units import (
    NMAC_HORIZONTAL_M,
    NMAC_VERTICAL_M,
    WELL_CLEAR_HORIZONTAL_M,
    WELL_CLEAR_VERTICAL_M,
)

Array = NDArray[np.floating]

OWN, COLOURS = "#0072B2", ("#D55E00", "#009E73", "#CC79A7", "#000000")
DASHES = ("--", "-.", ":", (0, (5, 1)))
# Separations up to this many times the well clear volume are shown.
HIGHEST_RATIO = 4.0
_LOST, _NEAR = BANDS[Layer.OUTER], BANDS[Layer.INNER]
_LEAST_REACH_M = 2500.0


def laid_out() -> tuple[Figure, Axes, Axes, Axes]:
    """A figure with its map, its heights, and its separation."""
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    above, right = figure.subfigures(1, 2, width_ratios=(1.0, 1.3), squeeze=False)[0]
    heights, apart = right.subplots(2, 1, sharex=True)
    heights.set_ylabel("height [m]")
    return figure, above.subplots(), heights, apart


def centre_map(axes: Axes, own_m: Array) -> None:
    """Show the surroundings of our whole path, (n, 3) north-east-down."""
    reach_m = max(float(np.ptp(own_m[:, :2], axis=0).max()), _LEAST_REACH_M)
    centre = 0.5 * (own_m.min(0) + own_m.max(0))
    axes.set(
        xlim=(centre[1] - 0.6 * reach_m, centre[1] + 0.6 * reach_m),
        ylim=(centre[0] - 0.6 * reach_m, centre[0] + 0.6 * reach_m),
        aspect="equal", xlabel="east [m]", ylabel="north [m]",
    )  # fmt: skip
    axes.legend(fontsize=8)


def draw_separation(axes: Axes, times_s: Array, own_m: Array, seen: Sequence[Array]) -> None:
    """Horizontal and vertical separation from each intruder, in shares of well clear."""
    for i, path in enumerate(seen):
        off_m = path - own_m
        horizontal = np.hypot(off_m[:, 0], off_m[:, 1]) / WELL_CLEAR_HORIZONTAL_M
        vertical = np.abs(off_m[:, 2]) / WELL_CLEAR_VERTICAL_M
        colour, dash = COLOURS[i % 4], DASHES[i % 4]
        axes.plot(times_s, horizontal, lw=1.6, label="horizontal", color=colour, ls=dash)
        axes.plot(times_s, vertical, lw=0.8, label="vertical", color=colour, ls=dash)
    near = max(NMAC_HORIZONTAL_M / WELL_CLEAR_HORIZONTAL_M, NMAC_VERTICAL_M / WELL_CLEAR_VERTICAL_M)
    axes.axhspan(0.0, 1.0, color=_LOST, zorder=0)
    axes.axhspan(0.0, near, color=_NEAR, zorder=0)
    axes.set(ylim=(0.0, HIGHEST_RATIO), xlabel="time [s]", ylabel="apart [well clear]")
    if seen:
        axes.legend(fontsize=8, loc="upper right", ncols=2)
