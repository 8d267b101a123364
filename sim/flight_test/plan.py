"""Flight tests as YAML: the mission, the encounters on it, what the pilot does, and what is expected."""

from dataclasses import field
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Len
from pydantic import dataclasses as checked

from sim.files import STRICT, names_in, read_named
from sim.scenario import MissionPlan

SET_FOLDER = Path(__file__).with_name("sets")

# Names of modes that mean the same for both autopilots; any name of the autopilot's own is accepted too.
PILOT_MODES = {
    "mission": {"ardupilot": "AUTO", "px4": "MISSION"},
    "hold": {"ardupilot": "LOITER", "px4": "HOLD"},
    "return": {"ardupilot": "RTL", "px4": "RETURN"},
    "stabilized": {"ardupilot": "FBWA", "px4": "STABILIZED"},
}

_Seconds = Annotated[float, Ge(0.0), Le(600.0)]
_Share = Annotated[float, Ge(0.0), Le(1.0)]


@checked.dataclass(frozen=True, config=STRICT)
class Turn:
    """From `at_s` on, counted from the meeting (negative: before): a turn rate to the right and a climb."""

    at_s: Annotated[float, Ge(-300.0), Le(300.0)]
    turn_deg_s: Annotated[float, Ge(-30.0), Le(30.0)] = 0.0
    climb_mps: Annotated[float, Ge(-30.0), Le(30.0)] = 0.0


@checked.dataclass(frozen=True, config=STRICT)
class IntruderPlan:
    """An intruder, by its meeting with the aircraft if that flies on along its leg.

    `from_deg` is the direction it comes from at the meeting, relative to our course and clockwise: 0 head-on,
    90 from the right. It passes `miss_m` to our right (negative: left) and `miss_height_m` above us. It is
    reported from `appears_s` before the meeting, but not in the gaps: [from, to], counted from the meeting.
    """

    speed_mps: Annotated[float, Gt(0.0), Le(300.0)]
    from_deg: Annotated[float, Ge(-360.0), Le(360.0)] = 0.0
    climb_mps: Annotated[float, Ge(-30.0), Le(30.0)] = 0.0
    miss_m: Annotated[float, Ge(-20_000.0), Le(20_000.0)] = 0.0
    miss_height_m: Annotated[float, Ge(-3000.0), Le(3000.0)] = 0.0
    meets_after_s: Annotated[float, Ge(-60.0), Le(60.0)] = 0.0
    appears_s: Annotated[float, Gt(0.0), Le(300.0)] = 90.0
    turns: tuple[Turn, ...] = ()
    gaps_s: tuple[tuple[float, float], ...] = ()
    period_s: Annotated[float, Gt(0.0), Le(30.0)] = 1.0
    delay_s: Annotated[float, Ge(0.0), Le(10.0)] = 0.0
    loss: _Share = 0.0
    sigma_m: Annotated[float, Ge(0.0), Le(500.0)] = 0.0
    flags: Annotated[int, Ge(0), Le(65_535)] | None = None
    icao: Annotated[int, Ge(0), Le(0xFF_FFFF)] | None = None


@checked.dataclass(frozen=True, config=STRICT)
class LinkFault:
    """Faults of the link between Companion and the aircraft."""

    for_s: _Seconds
    cut: Literal["both", "to companion", "from companion"] | None = None
    loss: _Share = 0.0
    duplication: _Share = 0.0
    delay_s: Annotated[float, Ge(0.0), Le(10.0)] = 0.0
    jitter_s: Annotated[float, Ge(0.0), Le(10.0)] = 0.0
    copy_after_s: Annotated[float, Ge(0.0), Le(60.0)] = 0.0


@checked.dataclass(frozen=True, config=STRICT)
class FlyTo:
    """A place relative to the aircraft and its course, for "fly here"."""

    ahead_m: Annotated[float, Ge(-20_000.0), Le(20_000.0)] = 0.0
    right_m: Annotated[float, Ge(-20_000.0), Le(20_000.0)] = 0.0


@checked.dataclass(frozen=True, config=STRICT)
class Sticks:
    """The pilot's sticks, from -1 to 1, held for a while."""

    roll: Annotated[float, Ge(-1.0), Le(1.0)] = 0.0
    pitch: Annotated[float, Ge(-1.0), Le(1.0)] = 0.0
    for_s: _Seconds = 3.0


_KINDS = ("mode", "fly_to", "sticks", "select_item", "upload", "role", "resume", "stall_s", "link")


@checked.dataclass(frozen=True, config=STRICT)
class Action:
    """One action of the pilot, or one fault, `after_s` after a moment of the encounter.

    With `claims` the aircraft is the pilot's from then on: Companion must send nothing more until the next
    action with `mode: mission`. With `releases` Companion must give the aircraft back.
    """

    when: Literal["start", "taken over", "given back", "last"] = "start"
    after_s: _Seconds = 0.0
    claims: bool = False
    releases: bool = False
    mode: str | None = None
    fly_to: FlyTo | None = None
    sticks: Sticks | None = None
    select_item: Annotated[int, Ge(0), Le(1000)] | None = None
    upload: Literal["shifted", "same"] | None = None
    role: Literal["off", "advise", "fly"] | None = None
    resume: bool | None = None
    stall_s: Annotated[float, Gt(0.0), Le(60.0)] | None = None
    link: LinkFault | None = None

    def __post_init__(self) -> None:
        """Refuse an action that does nothing, or two things."""
        if len(self.kinds) != 1:
            raise ValueError(f"needs exactly one of {', '.join(_KINDS)}")

    @property
    def kinds(self) -> list[str]:
        """The names of what is done."""
        return [name for name in _KINDS if getattr(self, name) is not None]


@checked.dataclass(frozen=True, config=STRICT)
class Expectation:
    """What must come true; `null` (and for `no_nmac` and `resumed` false): it is not judged.

    `avoids`: whether the aircraft is taken over at all. `hands_off_s` is how long Companion may still send
    after an action that claims the aircraft, counted from when the aircraft shows it. `released_s` is how
    long giving back may take after an action that asks for it. `mode` must be entered during the encounter.
    """

    well_clear: Literal[True] | None = True
    no_nmac: bool = True
    avoids: bool | None = True
    resumed: bool = True
    back: Literal[True] | None = True
    back_within_s: Annotated[float, Gt(0.0), Le(900.0)] = 300.0
    hands_off_s: Annotated[float, Gt(0.0), Le(10.0)] = 1.5
    released_s: Annotated[float, Gt(0.0), Le(60.0)] = 5.0
    mode: str | None = None


@checked.dataclass(frozen=True, config=STRICT)
class EncounterPlan:
    """One encounter: its traffic, what else happens, and what is expected.

    The intruders meet the aircraft `meets_s` after its start; it lasts for `lasts_s` after the last meeting.
    """

    name: Annotated[str, Len(1, 80)]
    intruders: tuple[IntruderPlan, ...] = ()
    meets_s: Annotated[float, Gt(5.0), Le(300.0)] = 75.0
    lasts_s: Annotated[float, Gt(0.0), Le(900.0)] = 30.0
    actions: tuple[Action, ...] = ()
    expect: Expectation = field(default_factory=Expectation)
    autopilots: tuple[Literal["ardupilot", "px4"], ...] = ("ardupilot", "px4")

    def __post_init__(self) -> None:
        """Refuse two aircraft with one address."""
        known = [intruder.icao for intruder in self.intruders if intruder.icao is not None]
        if len(set(known)) < len(known):
            raise ValueError("intruders: two of them have the same icao")


@checked.dataclass(frozen=True, config=STRICT)
class FlightTest:
    """The content of a file: one flight with its encounters.

    `parameters` are set before the flight and restored after it, by autopilot.
    """

    description: str
    mission: MissionPlan
    encounters: Annotated[tuple[EncounterPlan, ...], Len(1)]
    parameters: dict[Literal["ardupilot", "px4"], dict[str, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse two encounters with one name."""
        names = [encounter.name for encounter in self.encounters]
        if len(set(names)) < len(names):
            raise ValueError("encounters: two of them have the same name")


def set_names() -> list[str]:
    """Names of the sets that come with the project."""
    return names_in(SET_FOLDER)


def load_set(name_or_path: str | Path) -> FlightTest:
    """Read a set by name or from a file; `ConfigError` names file and key."""
    return read_named(name_or_path, SET_FOLDER, FlightTest, "set")
