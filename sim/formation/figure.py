"""The figure of a flown crossing: the map, the heights, and the distance of each pair over time."""

from itertools import combinations

import numpy as np
from matplotlib.figure import Figure

from sim.campaign.flight import STEP_S
from sim.encounter_figure import COLOURS, DASHES, OWN, centre_map, laid_out
from sim.formation.engines import Separation
from sim.formation.flight import FormationFlight

_COLOURS = (OWN, *COLOURS, "#E69F00", "#56B4E9", "#F0E442", "#7F7F7F", "#8C564B")
_SHOWN_M = 600.0


def figure_of(flight: FormationFlight, separation: Separation) -> Figure:
    """A figure of one crossing; dots every ten seconds, squares at the last waypoints."""
    figure, above, heights, apart = laid_out()
    times_s = np.arange(len(flight.position_m)) * STEP_S
    for index, mission in enumerate(flight.crossing.missions):
        place_m, colour = flight.position_m[:, index], _COLOURS[index]
        above.plot(place_m[:, 1], place_m[:, 0], color=colour, lw=1.4, label=f"member {index + 1}")
        above.plot(place_m[::100, 1], place_m[::100, 0], ".", color=colour, ms=5)
        above.plot(mission.end_m[1], mission.end_m[0], "s", color=colour, ms=5)
        heights.plot(times_s, -place_m[:, 2], color=colour, lw=1.4)
    if flight.crossing.stranger is not None:
        place_m = flight.crossing.stranger.positions_m(times_s)
        above.plot(place_m[:, 1], place_m[:, 0], color="black", ls=DASHES[0], lw=1.2, label="stranger")
        heights.plot(times_s, -place_m[:, 2], color="black", ls=DASHES[0], lw=1.2)
    for one, other in combinations(range(flight.position_m.shape[1]), 2):
        off_m = flight.position_m[:, one] - flight.position_m[:, other]
        apart.plot(times_s, np.linalg.norm(off_m, axis=1), color=_COLOURS[one], lw=1.0)
    centre_map(above, flight.position_m.reshape(-1, 3))
    apart.axhspan(0.0, separation.smallest_m, color="#f4c7c3", zorder=0)
    apart.axvline(flight.crossing.meets_s, color="#444444", lw=0.8)
    apart.set(ylim=(0.0, _SHOWN_M), xlabel="time [s]", ylabel="distance of pairs [m]")
    return figure
