"""The flight test on a terminal: a live table in flight, or a line for each event without a terminal."""

import math

from rich.console import Console, Group
from rich.panel import Panel
from rich.table import Table

from sim.flight_test.flight import Flight
from sim.flight_test.judge import Judged
from sim.flight_test.report import report_of, table_of
from sim.live_view import LiveView

_REFRESH_PER_S = 4
_EVENTS_SHOWN = 8


class FlightView(LiveView):
    """Draws a flight."""

    def __init__(self, console: Console) -> None:
        self._flight: Flight | None = None
        super().__init__(console, refresh_per_s=_REFRESH_PER_S, lines_shown=_EVENTS_SHOWN)

    def show(self, flight: Flight) -> None:
        """Begin with a flight."""
        self._flight = flight

    def render(self) -> Panel:
        """The aircraft, its traffic, the encounters that are over, and the newest events."""
        flight = self._flight
        if flight is None:
            return Panel("connecting ...")
        parts = [_aircraft(flight)]
        if flight.judged is not None:
            parts.append(_traffic(flight, flight.judged))
        done = report_of(flight.result)
        done["encounters"] = [e for e in done["encounters"] if e["name"] in flight.result.failures]
        if done["encounters"]:
            parts.append(table_of(done))
        return Panel(Group(*parts, self.newest_lines), title=f"flight test: {flight.doing}")


def _aircraft(flight: Flight) -> Table:
    observer, sample = flight.observer, flight.observer.sample
    table = Table.grid(padding=(0, 2))
    table.add_row("vehicle", f"{observer.name}, {observer.mode}{', armed' if observer.armed else ''}")
    if sample is not None:
        course = math.degrees(math.atan2(sample.velocity_mps[1], sample.velocity_mps[0])) % 360.0
        table.add_row(
            "flying",
            f"course {course:03.0f}  {sample.speed_mps:4.1f} m/s  {sample.height_m:5.0f} m above home",
        )
    if abs(observer.time.rate - 1.0) > 0.1:
        table.add_row("time", f"{observer.time.rate:.2f} times ours")
    return table


def _traffic(flight: Flight, judged: Judged) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for heading in ("traffic", "distance", "height", "closest so far"):
        table.add_column(heading, justify="left" if heading == "traffic" else "right")
    now_s = flight.observer.now_s()
    own_m = judged.path[-1][1] if judged.path else None
    for intruder, score in zip(judged.intruders, judged.scores, strict=True):
        if own_m is None:
            continue
        (north_m, east_m, down_m), _ = intruder.state_at(now_s)
        distance_m = math.hypot(north_m - own_m[0], east_m - own_m[1])
        closest = f"{score.min_slant_m:.0f} m" if math.isfinite(score.min_slant_m) else "-"
        table.add_row(
            intruder.callsign, f"{distance_m / 1000:.2f} km", f"{own_m[2] - down_m:+.0f} m", closest
        )
    return table
