"""The part of the page about traffic: by which sources each aircraft was heard, and what was not avoided."""

import html
import math
from collections.abc import Iterator, Sequence
from typing import Final

from companion.model import TrafficKind
from companion.report import sources_figure
from companion.report.flight import Concern, Flight, TrackHistory
from companion.report.html import image, table, why
from companion.report.plotting import clock

_MAX_ROWS: Final = 300
# A normal error in the plane is within so many sigmas of an axis in 95 of 100 cases.
_WITHIN_95: Final = 2.448


def traffic_part(flight: Flight) -> Iterator[str]:
    """The HTML of this part; nothing without traffic."""
    aircraft = [one for one in flight.tracks.values() if one.kind != TrafficKind.OBSTACLE]
    aircraft.sort(key=lambda one: (one.sighting.closest_m, one.track_id))
    if aircraft:
        yield "<h2>Traffic and its sources</h2>"
        yield from _aircraft(flight, aircraft)
    if flight.forwarded:
        yield f"<p>Reports of traffic that were sent on: {flight.forwarded:,}.</p>"
    if flight.concerns:
        yield "<h2>Not avoided, or odd</h2>"
        yield from _concerns(list(flight.concerns.values()))


def _aircraft(flight: Flight, aircraft: Sequence[TrackHistory]) -> Iterator[str]:
    head = (
        "aircraft", "sources", "first heard", "last heard", "reports", "accuracy at best", "closest",
        "closest at", "coasted for", "at the end",
    )  # fmt: skip
    end_s = float(flight.time_s[-1])
    yield table(head, (_row(one, end_s) for one in aircraft[:_MAX_ROWS]))
    if len(aircraft) > _MAX_ROWS:
        yield f"<p>And {len(aircraft) - _MAX_ROWS} more.</p>"
    yield why(
        "The nearest first; distances are slant. Accuracy: the radius in which the aircraft was in 95 of "
        "100 cases. Coasted: extrapolated, because it was not heard any more. Lost: not heard for so long "
        "that it was no track any more; that does not mean that it was gone."
    )
    nearest = [one for one in aircraft if one.sighting.spans_s][: sources_figure.MAX_DRAWN]
    if nearest:
        yield image(sources_figure.sources(flight, nearest), "when each source reported each aircraft")


def _row(one: TrackHistory, end_s: float) -> list[str]:
    sighting = one.sighting
    sigma_m, coasted_s = sighting.least_sigma_m, sighting.coasted_s()
    return [
        f"<b>{html.escape(one.name)}</b>", html.escape(", ".join(sighting.sources)) or "–",
        clock(sighting.first_heard_s), clock(sighting.last_heard_s),
        f"{sighting.reports:,}" if sighting.reports else "–",
        "–" if sigma_m is None else f"±{_WITHIN_95 * sigma_m:.0f} m",
        _distance(sighting.closest_m),
        clock(sighting.closest_s), f"{coasted_s:.0f} s" if coasted_s > 0.0 else "–",
        html.escape(sighting.state_at(end_s) or "–"),
    ]  # fmt: skip


def _concerns(concerns: list[Concern]) -> Iterator[str]:
    concerns.sort(key=lambda one: (one.avoided, one.first_s, one.kind, one.name))
    rows = (
        [
            html.escape(one.name), html.escape(one.kind), "yes" if one.avoided else "no", clock(one.first_s),
            clock(one.last_s), _distance(one.nearest_m),
        ]
        for one in concerns[:_MAX_ROWS]
    )  # fmt: skip
    yield table(("aircraft", "why", "avoided", "from", "to", "nearest"), rows)
    if len(concerns) > _MAX_ROWS:
        yield f"<p>And {len(concerns) - _MAX_ROWS} more.</p>"
    yield why(
        "Traffic near us that was known of but not avoided, and traffic that contradicts itself. Of several "
        "of a kind at once, the nearest three."
    )


def _distance(distance_m: float | None) -> str:
    if distance_m is None or not math.isfinite(distance_m):
        return "–"
    return f"{distance_m:.0f} m" if distance_m < 5000.0 else f"{distance_m / 1000.0:.1f} km"
