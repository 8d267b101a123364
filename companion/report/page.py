"""The page of a flight report: one HTML file that opens offline."""

import html
import math
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import numpy as np

from companion import __version__
from companion.report import figures
from companion.report.encounters import Encounter, encounters_of
from companion.report.flight import Change, Flight
from companion.report.html import image, page, table, why
from companion.report.link import GAP_S, LinkLog
from companion.report.plotting import clock
from companion.report.reading import Log
from companion.report.traffic_part import traffic_part

_SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
_MAX_ROWS, _MAX_DETAILS, _MAX_GAPS = 300, 12, 30
_STYLE = """
body { max-width: 72rem; } td, th { font-variant-numeric: tabular-nums; }
table.words td, table.words th { text-align: left; vertical-align: top; } td.bad, b.bad { color: #b3261e;
font-weight: bold; } ul.notes { background: #fff4d6; color: #222; padding: .6rem 2rem; }
table { font-size: .92rem; } @media print { body { margin: 0; font-size: 11px; } h2 { break-after: avoid; }
img, tr { break-inside: avoid; } }
@media (max-width: 760px) { table { display: block; overflow-x: auto; } }
@media (prefers-color-scheme: dark) { td.bad, b.bad { color: #ff8a80; } }
"""


def page_of(log: Log) -> str:
    """The page of a flight as HTML."""
    flight, encounters = log.flight, encounters_of(log.flight)
    title = f"Flight report, {flight.name}"
    return page(title, _parts(log, flight, encounters), _STYLE)


def _parts(log: Log, flight: Flight, encounters: Sequence[Encounter]) -> Iterator[str]:
    yield f"<h1>{html.escape(f'Flight report, {flight.name}')}</h1>"
    yield _summary(log, encounters)
    if flight.notes:
        yield "<ul class=notes>" + "".join(f"<li>{html.escape(note)}</li>" for note in flight.notes) + "</ul>"
    if flight:
        yield "<h2>The flight from above</h2>"
        nearest = _nearest(encounters, figures.MAX_DRAWN)
        yield image(figures.from_above(flight, nearest), "the path from above, east and north in kilometres")
    yield "<h2>Encounters</h2>"
    yield from _encounters(flight, encounters)
    if flight:
        yield from traffic_part(flight)
        yield "<h2>Decided and flown</h2>"
        yield image(figures.commands(flight), "height, airspeed and course over time, decided and flown")
        yield "<h2>Decisions and their reasons</h2>"
        yield from _changes(flight)
    yield "<h2>Texts to the operator</h2>"
    yield from _texts(log)
    if log.link is not None:
        yield "<h2>The link</h2>"
        yield from _link(log.link)
    yield _fine_print(flight)


def _summary(log: Log, encounters: Sequence[Encounter]) -> str:
    flight = log.flight
    rows = [("began", _date(flight.start_us))]
    if flight:
        along_m = np.hypot(np.diff(flight.column("north_m")), np.diff(flight.column("east_m"))).sum()
        flown_s = float(np.diff(flight.time_s)[flight.flying[:-1]].sum())
        begun = flight.flying & ~np.roll(flight.flying, 1)
        takeovers = int(begun[1:].sum()) + int(flight.flying[0])
        lost = sum(not one.well_clear for one in encounters)
        nmacs = sum(one.nmac for one in encounters)
        heights = flight.heights_m("altitude_m")
        rows += [
            ("lasted", f"{clock(float(flight.time_s[-1]))}, {along_m / 1000.0:.1f} km"),
            (f"height {flight.height_name}", f"{heights.min():.0f} to {heights.max():.0f} m"),
            (
                "flown by the companion",
                f"{clock(flown_s)}, taken over {_times(takeovers)}" if takeovers else "never",
            ),
            (
                "aircraft tracked",
                f"{len(flight.tracks)}, of which {len({e.history.track_id for e in encounters})} came near",
            ),
            ("well clear lost", _bad(_times(lost)) if lost else "never"),
            ("near mid-air collision", _bad(_times(nmacs)) if nmacs else "none"),
        ]
    return "<table class=words>" + "".join(f"<tr><th>{a}</th><td>{b}</td></tr>" for a, b in rows) + "</table>"


def _times(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def _bad(text: str) -> str:
    return f"<b class=bad>{text}</b>"


def _date(time_us: int | None) -> str:
    if time_us is None or not 0 < time_us < 4_102_444_800_000_000:  # the year 2100
        return "at an unknown time"
    return f"{datetime.fromtimestamp(time_us // 1_000_000, UTC):%Y-%m-%d %H:%M:%S} UTC"


# --- encounters


def _encounters(flight: Flight, encounters: Sequence[Encounter]) -> Iterator[str]:
    if not encounters:
        yield "<p>No aircraft came near.</p>"
        return
    head = (
        "aircraft", "closest at", "slant", "horizontal", "vertical", "well clear kept", "NMAC", "layer",
        "first action before", "aside", "height",
    )  # fmt: skip
    yield table(head, (_row(flight, one) for one in encounters[:_MAX_ROWS]))
    if len(encounters) > _MAX_ROWS:
        yield f"<p>And {len(encounters) - _MAX_ROWS} more.</p>"
    yield why(
        "Distances at the closest point, by slant distance, from the tracks that the companion had; vertical "
        "is positive if the other aircraft was above. First action: time from the first avoidance to the "
        "closest point. Aside and height: the largest deviations until the aircraft was given back, from the "
        "mission (from the straight course if it is unknown) and from the height at the first action."
    )
    nearest = _nearest(encounters, figures.MAX_DRAWN)
    yield image(figures.separation(flight, nearest), "horizontal and vertical distance over time")
    for number, one in enumerate(_nearest(encounters, _MAX_DETAILS)):
        yield f"<h3>{html.escape(one.name)}, closest at {clock(float(flight.time_s[one.closest_at]))}</h3>"
        yield image(figures.encounter(flight, one, number), f"the encounter with {one.name}")
        yield why(
            "Left: from above, with times. Right: heights and distances. The line marks the closest point, "
            "the dotted line the first action."
        )


def _nearest(encounters: Sequence[Encounter], count: int) -> list[Encounter]:
    """The nearest `count` encounters, in the order of time."""
    nearest = sorted(encounters, key=lambda one: one.closest_slant_m)[:count]
    return sorted(nearest, key=lambda one: one.closest_at)


def _row(flight: Flight, one: Encounter) -> list[str]:
    acted = "–"
    if one.acted_s is not None:
        acted = f"{one.acted_s:.0f} s" if one.acted_s >= 0.0 else f"{-one.acted_s:.0f} s after"
    elif one.advised_s is not None:
        acted = f"decided {one.advised_s:.0f} s, not flown"
    return [
        html.escape(one.name), clock(float(flight.time_s[one.closest_at])), f"{one.closest_slant_m:.0f} m",
        f"{one.closest_horizontal_m:.0f} m", f"{one.closest_vertical_m:+.0f} m",
        "yes" if one.well_clear else _bad("no"), _bad("yes") if one.nmac else "no", html.escape(one.layer),
        acted, _metres(one.aside_m), _metres(one.height_m),
    ]  # fmt: skip


def _metres(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.0f} m"


# --- decisions and texts


def _changes(flight: Flight) -> Iterator[str]:
    head = ("time", "mode", "state", "layer", f"guidance, height {flight.height_name}", "because")
    shown = flight.changes[:_MAX_ROWS]
    yield table(head, (_change_row(flight, change) for change in shown), "words")
    if len(flight.changes) > len(shown):
        yield f"<p>And {len(flight.changes) - len(shown)} more.</p>"
    yield why(
        "One row for each change of mode, state or layer, or of guidance by more than 10 degrees, 1 m/s or "
        "15 m. Guidance is commanded only in the states outer, inner, returning and recovering; otherwise it "
        "is advice."
    )


def _change_row(flight: Flight, change: Change) -> list[str]:
    guidance = "–"
    if change.guidance is not None:
        course, speed, height = change.guidance
        guidance = f"course {round(course) % 360:03d}, {speed:.1f} m/s, {flight.height_m(height):.0f} m"
    texts = (change.mode or "–", change.doing, str(change.layer), guidance, change.because)
    return [clock(change.time_s), *map(html.escape, texts)]


def _texts(log: Log) -> Iterator[str]:
    texts = [*log.flight.texts, *(log.link.texts if log.link is not None else ())]
    texts.sort(key=lambda one: one.time_s)
    if not texts:
        yield "<p>None.</p>"
        return
    rows = (
        [
            clock(one.time_s), one.source,
            _SEVERITIES[one.severity] if 0 <= one.severity < len(_SEVERITIES) else str(one.severity),
            html.escape(one.text),
        ]
        for one in texts[:_MAX_ROWS]
    )  # fmt: skip
    yield table(("time", "from", "severity", "text"), rows, "words")
    if len(texts) > _MAX_ROWS:
        yield f"<p>And {len(texts) - _MAX_ROWS} more.</p>"


# --- the link


def _link(link: LinkLog) -> Iterator[str]:
    yield image(figures.link(link), "messages per second")
    senders = sorted(link.senders.values(), key=lambda sender: -sender.messages)
    rows = []
    for sender in senders[:40]:
        system, component = sender.address
        role = "autopilot" if sender is link.autopilot else "companion" if component == 196 else ""
        longest_s = max((end - begin for begin, end in sender.gaps), default=0.0)
        rows.append(
            [
                f"{system}:{component} {role}", f"{sender.messages:,}", f"{sender.lost:,}",
                f"{100.0 * sender.lost_share:.1f} %", str(len(sender.gaps)),
                f"{longest_s:.1f} s" if longest_s else "–",
            ]
        )  # fmt: skip
    head = ("system:component", "messages", "lost", "share lost", f"gaps over {GAP_S:g} s", "longest gap")
    yield table(head, rows)
    gaps = [] if link.autopilot is None else link.autopilot.gaps
    if gaps:
        times = ", ".join(f"{clock(begin)} to {clock(end)}" for begin, end in gaps[:_MAX_GAPS])
        yield f"<p>The autopilot was not heard: {times}{' …' if len(gaps) > _MAX_GAPS else ''}.</p>"
    yield why("Lost: missing in the sequence numbers of the sender.")


def _fine_print(flight: Flight) -> str:
    how = (
        "The decisions are those of a replay of the log with this version and the given configuration. They "
        "are the decisions of the flight only if it was flown with the same version and configuration."
        if flight.replayed
        else "The decisions are those recorded in flight."
    )
    return why(
        f"{how} Positions of other aircraft are those of the companion's tracks. Times are since the first "
        f"record. Companion {html.escape(__version__)}."
    )
