"""Prints how well the filter of a target follows flights: errors, consistency, and delays of turns.

`python -m tests.tools.tracking [--flights N]` flies straight, accelerating and turning flights, and those of
the encounter models where these are present, with reports of several kinds of errors. NEES and NIS are the
normalized squared errors of the state and of the predicted position; both are 1 for a consistent filter, and
the 95 % intervals are those of as many independent flights. Other numbers: RMS and 95 %.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sim.encounters import SURVEILLANCE_PRESETS, Surveillance, read_model
from sim.evidence.statistics import chi2_interval, percentile, rms
from tests.support.paths import ENCOUNTER_MODELS
from tests.support.tracking_flights import Reporting, Segment, State, flight, model_flight
from tests.support.tracking_measures import Errors, measure

_ADSB, _POOR = SURVEILLANCE_PRESETS["adsb-out"], SURVEILLANCE_PRESETS["poor"]
REPORTING = {
    "exact": Reporting(Surveillance()),
    "adsb-out": Reporting(_ADSB),
    "poor": Reporting(_POOR),
    "poor, stated": Reporting(_POOR, states_sigmas=True),
    "GPS, stated": Reporting(Surveillance(position_sigma_m=3.0, velocity_sigma_mps=0.3), states_sigmas=True),
    "no velocity": Reporting(_ADSB, with_velocity=False),
    "whole seconds": Reporting(replace(_ADSB, position_sigma_m=8.0), whole_seconds=True),
    "five a second": Reporting(replace(_ADSB, period_s=0.2)),
    "every 3 s": Reporting(replace(_ADSB, period_s=3.0)),
}
_HEAD = (
    f"{'flights':13}{'reports':14}{'position m':>12}{'velocity m/s':>14}{'turn deg/s':>13}{'in 15 s m':>13}"
    f"{'NEES':>7}{'NIS':>6}{'not 0':>8}{'begin s':>11}{'end s':>11}"
)


def flights_of(kind: str, count: int) -> list[list[State]]:
    """Flights of a kind: straight, accelerating, model, or the rate of one turn in degrees a second."""
    rng = np.random.default_rng(1)
    if kind == "model":
        models = [read_model(path) for _, path in sorted(ENCOUNTER_MODELS.items())]
        return [model_flight(models[n % len(models)], rng, 120) for n in range(count if models else 0)]
    return [
        flight(float(rng.uniform(25.0, 110.0)), float(rng.uniform(0.0, 6.28)), _segments(kind, rng))
        for _ in range(count)
    ]


def _segments(kind: str, rng: np.random.Generator) -> Sequence[Segment]:
    side = float(rng.choice([-1.0, 1.0]))
    if kind == "straight":
        return [Segment(90.0)]
    if kind == "accelerating":
        return [Segment(20.0), Segment(15.0, 0.0, side * float(rng.uniform(0.3, 1.2))), Segment(40.0)]
    return [Segment(25.0 + float(rng.uniform())), Segment(25.0, side * float(kind)), Segment(30.0)]


def row(kind: str, reporting: str, errors: Errors) -> str:
    """One line of the table."""
    turn_dps, false_radps = np.degrees(errors.turn_radps).tolist(), errors.false_radps
    not_zero = f"{100.0 * np.mean(np.array(false_radps) > 0.0):7.1f}%" if false_radps else f"{'-':>8}"
    pairs = ((errors.position_m, 1), (errors.velocity_mps, 2), (turn_dps, 2), (errors.ahead_m, 0))
    cells = [f"{rms(values):6.{digits}f}{percentile(values, 0.95):7.{digits}f}" for values, digits in pairs]
    cells.append(f"{np.mean(errors.nees):7.2f}{np.mean(errors.nis):6.2f}{not_zero}")
    for delays_s in (errors.begins_s, errors.ends_s):
        cells.append(
            f"{percentile(delays_s, 0.5):5.1f}{percentile(delays_s, 0.95):6.1f}" if delays_s else f"{'-':>11}"
        )
    return f"{kind:13}{reporting:14}" + "".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=40, metavar="N", help="flights of each kind")
    count = parser.parse_args().flights
    (low, high), (low2, high2) = chi2_interval(4, count), chi2_interval(2, count)
    sys.stdout.write(f"95 %: NEES {low:.2f} to {high:.2f}, NIS {low2:.2f} to {high2:.2f}\n{_HEAD}\n")
    for kind in ("straight", "accelerating", "1.5", "3", "6", "model"):
        flights = flights_of(kind, count)
        for name, how in REPORTING.items() if flights else ():
            sys.stdout.write(row(kind, name, measure(flights, how)) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
