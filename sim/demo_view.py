"""The demonstration on a terminal: live view in flight, a table at the end."""

import math

from rich.console import Console, Group
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from companion.geodesy import course_deg
from companion.model import Layer, Snapshot
from sim.demo import DemoState
from sim.live_view import LiveView, clock
from sim.metrics import EncounterScore

_REFRESH_PER_S = 8
_COLOURS = {Layer.CLEAR: "green", Layer.OUTER: "yellow", Layer.INNER: "bold red"}
_TEXTS_SHOWN = 4


class DemoView(LiveView):
    """Draws the state of a demonstration."""

    def __init__(self, console: Console) -> None:
        self._state: DemoState | None = None
        super().__init__(console, refresh_per_s=_REFRESH_PER_S, lines_shown=_TEXTS_SHOWN)

    def start(self, state: DemoState) -> None:
        """Begin with the demonstration's state."""
        self._state = state

    def add_text(self, text: str) -> None:
        """Show a line that the companion logs."""
        if self._state is not None:
            self.add_line(self._state.elapsed_s, text)

    def render(self) -> Panel:
        """The aircraft, its traffic, and the newest lines."""
        state = self._state
        if state is None:
            return Panel("building the world ...")
        scenario = state.options.scenario
        head = Text(scenario.description, style="dim")
        bar = Table.grid(expand=True)
        bar.add_row(
            ProgressBar(total=scenario.duration_s, completed=min(state.elapsed_s, scenario.duration_s))
        )
        title = f"Companion demo   {clock(state.elapsed_s)}   {state.options.speedup:g} x"
        return Panel(Group(head, bar, _aircraft(state), _traffic(state), self.newest_lines), title=title)


def _aircraft(state: DemoState) -> Table:
    truth, snapshot = state.truth, state.snapshot()
    table = Table.grid(padding=(0, 2))
    north_m, east_m, down_m = truth.position_m
    height_m = -down_m - state.options.scenario.home.altitude_m
    course = course_text(math.atan2(truth.velocity_mps[1], truth.velocity_mps[0]))
    table.add_row(
        "position", f"{north_m / 1000:z6.2f} km N  {east_m / 1000:z6.2f} km E  {height_m:z5.0f} m above home"
    )
    table.add_row(
        "flying",
        f"course {course}  {truth.airspeed_mps:4.1f} m/s  climb {-truth.velocity_mps[2]:+z4.1f} m/s",
    )
    mode = Text(truth.mode, style="bold cyan")
    if truth.uncontrolled:
        mode.append(" UNCONTROLLED", style="bold red")
    table.add_row("mode", mode)
    table.add_row("companion", companion_text(snapshot, state.options.scenario.home.altitude_m))
    return table


def companion_text(snapshot: Snapshot | None, home_m: float) -> Text:
    """What the companion decides; `home_m` is home's altitude."""
    if snapshot is None:
        return Text("off (--no-avoidance)", style="red")
    decision = snapshot.decision
    text = Text(f"{snapshot.state}, decides " if snapshot.state != decision.layer else "")
    text.append(str(decision.layer), style=_COLOURS[decision.layer])
    if decision.guidance is not None:
        guidance = decision.guidance
        text.append(
            f": course {course_text(guidance.course_rad)}, {guidance.airspeed_mps:.0f} m/s, "
            f"{guidance.altitude_m - home_m:.0f} m above home"
        )
    return text


def _traffic(state: DemoState) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for heading in ("traffic", "distance", "height", "closest so far", "threat"):
        table.add_column(heading, justify="right" if heading != "traffic" else "left")
    snapshot = state.snapshot()
    threats = () if snapshot is None else snapshot.decision.threats
    threatening = {one.icao: threat for threat in threats if (one := state.score.encounter_of(threat))}
    own = state.truth.position_m
    for intruder in state.world.intruders:
        (north_m, east_m, down_m), _ = intruder.state_at(state.truth.time_s)
        encounter = state.score.encounters[f"{intruder.icao:06X}"]
        threat = threatening.get(intruder.icao)
        distance_m = math.hypot(north_m - own[0], east_m - own[1])
        if distance_m > 20_000.0:
            continue
        closest = f"{encounter.min_slant_m:.0f} m" if math.isfinite(encounter.min_slant_m) else "-"
        table.add_row(
            intruder.callsign,
            f"{distance_m / 1000:.2f} km",
            f"{own[2] - down_m:+z.0f} m",
            closest,
            "-" if threat is None else f"{threat.layer}, closest in {threat.time_to_closest_s:.0f} s",
            style=None if threat is None else _COLOURS[threat.layer],
        )
    return table


def course_text(course_rad: float) -> str:
    """A course in three digits."""
    return f"{round(course_deg(course_rad)) % 360:03d}"


def result_text(encounter: EncounterScore) -> str:
    """How an encounter ended, with markup."""
    if encounter.nmac:
        return "[bold red]NEAR MID-AIR COLLISION[/]"
    return "[yellow]well clear lost[/]" if encounter.lowc else "[green]well clear[/]"


def print_result(console: Console, state: DemoState) -> None:
    """Print the result."""
    table = Table(title="Closest approaches", title_justify="left", title_style="bold")
    for heading in ("traffic", "slant", "horizontal", "vertical", "first action", "result"):
        table.add_column(heading, justify="left" if heading in ("traffic", "result") else "right")
    for encounter in state.score.encounters.values():
        action = "-" if encounter.first_action_s is None else clock(encounter.first_action_s).strip()
        table.add_row(
            encounter.callsign,
            f"{encounter.min_slant_m:.0f} m",
            f"{encounter.min_horizontal_m:.0f} m",
            f"{encounter.vertical_m:.0f} m",
            action,
            result_text(encounter),
        )
    console.print(table)
    report = state.report()
    done = "[green]completed[/]" if state.truth.mission_completed else "[red]not completed[/]"
    console.print(
        f"Mission {done} after {clock(state.elapsed_s).strip()}, largest deviation "
        f"{state.score.max_deviation_m:.0f} m sideways, {report['setpoints_sent']} setpoints sent.",
        soft_wrap=True,
    )
    if state.uncontrolled:
        console.print("[bold red]The autopilot's setpoint became invalid: the aircraft flew uncontrolled.[/]")
    if state.clock.slipped_s > 1.0:
        console.print(
            f"[yellow]This machine was too slow for the speed-up: the clock waited "
            f"{state.clock.slipped_s:.0f} simulated seconds.[/]",
            soft_wrap=True,
        )
    if state.recording is not None:
        console.print(f"Recorded: {state.recording}  (companion replay shows it again)", soft_wrap=True)
