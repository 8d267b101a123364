"""The flight test on a terminal: a live table in flight, or a line for each event without a terminal."""

import math
from contextlib import AbstractContextManager
from types import TracebackType

from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from sim.flight_test.flight import Flight
from sim.flight_test.judge import Judged
from sim.flight_test.report import report_of, table_of

_REFRESH_PER_S = 4
_EVENTS_SHOWN = 8


class FlightView(AbstractContextManager["FlightView"]):
    """Draws a flight."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._flight: Flight | None = None
        self._events: list[str] = []
        self._live = Live(
            get_renderable=self._render, console=console, refresh_per_second=_REFRESH_PER_S, transient=True,
            auto_refresh=console.is_terminal,
        )  # fmt: skip

    def show(self, flight: Flight) -> None:
        """Begin with a flight."""
        self._flight = flight

    def event(self, time_s: float, text: str) -> None:
        """Show a line; `time_s` is the vehicle's."""
        line = f"{_clock(time_s)}  {text}"
        self._events.append(line)
        if not self._console.is_terminal:
            self._console.print(line, markup=False, soft_wrap=True)

    def __enter__(self) -> "FlightView":
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._console.is_terminal:
            self._live.stop()

    def _render(self) -> Panel:
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
        events = Text("\n".join(self._events[-_EVENTS_SHOWN:]), style="dim")
        return Panel(Group(*parts, events), title=f"flight test: {flight.doing}")


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


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60:3d}:{int(seconds) % 60:02d}"
