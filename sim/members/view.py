"""The demonstration of a formation on a terminal: a row for each member, and tables at the end."""

import math

from rich.console import Console, Group
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from sim.demo import DemoState
from sim.demo_view import companion_text, course_text, result_text
from sim.live_view import LiveView, clock
from sim.members.demo import MEMBER, FormationState
from sim.members.score import PairScore

_REFRESH_PER_S = 8
_TEXTS_SHOWN = 6


class FormationView(LiveView):
    """Draws the state of a formation's demonstration."""

    def __init__(self, console: Console) -> None:
        self._state: FormationState | None = None
        super().__init__(console, refresh_per_s=_REFRESH_PER_S, lines_shown=_TEXTS_SHOWN)

    def start(self, state: FormationState) -> None:
        """Begin with the demonstration's state."""
        self._state = state

    def add_text(self, text: str) -> None:
        """Show a line that a companion logs, with its member's name."""
        if self._state is not None:
            name = MEMBER.get()
            self.add_line(self._state.elapsed_s, f"{name}: {text}" if name else text)

    def render(self) -> Panel:
        """The members, and the newest lines."""
        state = self._state
        if state is None:
            return Panel("building the worlds ...")
        scenario = state.options.scenario
        head = Text(scenario.description, style="dim")
        bar = Table.grid(expand=True)
        bar.add_row(
            ProgressBar(total=scenario.duration_s, completed=min(state.elapsed_s, scenario.duration_s))
        )
        if all(member.ended.is_set() for member in state.members):
            head = Text("comparing with each layer alone ...", style="bold")
        title = f"Companion demo   {clock(state.elapsed_s)}   {state.options.speedup:g} x"
        return Panel(Group(head, bar, _members(state), self.newest_lines), title=title)


def _members(state: FormationState) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for heading in ("member", "mode", "course", "height", "closest so far", "companion"):
        table.add_column(heading)
    home_m = state.options.scenario.home.altitude_m
    for name, member in state.named:
        truth = member.truth
        course_rad = math.atan2(truth.velocity_mps[1], truth.velocity_mps[0])
        table.add_row(
            f"{name} [dim]{member.world.vehicle.name}[/]",
            Text("done", style="green") if truth.mission_completed else Text(truth.mode, style="bold cyan"),
            course_text(course_rad),
            f"{-truth.position_m[2] - home_m:z.0f} m",
            _closest(name, state.score.closest_of(name)),
            companion_text(member.snapshot(), home_m),
        )
    return table


def _closest(name: str, pair: PairScore) -> str:
    if not math.isfinite(pair.min_slant_m):
        return "-"
    other = next(one for one in pair.members if one != name)
    return f"{pair.min_slant_m:.0f} m to {other}"


def print_formation_result(console: Console, state: FormationState) -> None:
    """Print the result."""
    console.print(_pairs_table(state))
    if any(member.score.encounters for member in state.members):
        console.print(_traffic_table(state))
    console.print(_layers_table(state))
    for name, member in state.named:
        console.print(_member_line(name, member), soft_wrap=True)
    if state.clock.slipped_s > 1.0:
        console.print(
            f"[yellow]This machine was too slow for the speed-up: the clock waited "
            f"{state.clock.slipped_s:.0f} simulated seconds.[/]",
            soft_wrap=True,
        )


def _pairs_table(state: FormationState) -> Table:
    table = _table("Closest approaches of members", "pair", "slant", "horizontal", "vertical", "at", "result")
    for pair in state.score.pairs.values():
        met = math.isfinite(pair.min_slant_m)
        table.add_row(
            " - ".join(pair.members),
            f"{pair.min_slant_m:.0f} m",
            f"{pair.min_horizontal_m:.0f} m",
            f"{pair.vertical_m:.0f} m",
            clock(pair.min_slant_at_s).strip() if met else "-",
            "[bold red]SEPARATION LOST[/]" if pair.separation_lost else "[green]separated[/]",
        )
    return table


def _traffic_table(state: FormationState) -> Table:
    table = _table(
        "Closest approaches of others", "member", "traffic", "slant", "horizontal", "vertical", "result"
    )
    for name, member in state.named:
        for encounter in member.score.encounters.values():
            table.add_row(
                name,
                encounter.callsign,
                f"{encounter.min_slant_m:.0f} m",
                f"{encounter.min_horizontal_m:.0f} m",
                f"{encounter.vertical_m:.0f} m",
                result_text(encounter),
            )
    return table


def _layers_table(state: FormationState) -> Table:
    table = _table("Mean distance of members (safety value)", "layers", "mean", "smallest", "missions")
    for name, flight in state.compared.items():
        mean_m = flight.safety.mean_m()
        table.add_row(
            name,
            "-" if mean_m is None else f"{mean_m:.0f} m",
            f"{flight.smallest_m:.0f} m",
            "[green]completed[/]" if flight.mission_completed else "[red]not completed[/]",
        )
    return table


def _member_line(name: str, member: DemoState) -> str:
    done = "[green]completed[/]" if member.truth.mission_completed else "[red]not completed[/]"
    sent = 0 if member.runtime is None else member.runtime.setpoints_sent
    line = (
        f"{name}: mission {done} after {clock(member.elapsed_s).strip()}, largest deviation "
        f"{member.score.max_deviation_m:.0f} m sideways, {sent} setpoints sent."
    )
    if member.uncontrolled:
        line += " [bold red]It flew uncontrolled.[/]"
    return line if member.recording is None else f"{line} Recorded: {member.recording}"


def _table(title: str, *headings: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    for heading in headings:
        is_number = heading in ("slant", "horizontal", "vertical", "at", "mean", "smallest")
        table.add_column(heading, justify="right" if is_number else "left")
    return table
