"""The parts of a recorded flight that are compared, each flown by the fake from its recorded state on."""

from dataclasses import dataclass
from itertools import pairwise

from companion.autopilots import ArduPlane, Px4FixedWing
from companion.mavlink.dialect import Message, mavlink
from sim.fit.recording import Recording
from sim.vehicle.mission import NAV_TAKEOFF

# Seconds of the mission before the command that takes the aircraft from it.
_LEAD_S = 10.0
_SHORTEST_S = 20.0
# The first seconds after a take-off belong to it.
_AFTER_TAKEOFF_S = 3.0


@dataclass(frozen=True, slots=True)
class Segment:
    """An interval [s since boot] that begins in the mission's mode."""

    name: str
    begin_s: float
    end_s: float


def segments_of(recording: Recording) -> list[Segment]:
    """The mission up to the first engagement, then each engagement up to the next one."""
    begins_s = [
        time_s - _LEAD_S
        for time_s, message in recording.commands
        if _leaves_mission(recording, time_s, message)
    ]
    last_s = float(recording.track.time_s[-1])
    edges_s = [_mission_begin_s(recording), *begins_s, last_s]
    names = ["mission", *(f"engagement {number}" for number in range(1, len(begins_s) + 1))]
    cut = [Segment(name, *edges) for name, edges in zip(names, pairwise(edges_s), strict=True)]
    return [segment for segment in cut if segment.end_s - segment.begin_s >= _SHORTEST_S]


def _leaves_mission(recording: Recording, time_s: float, message: Message) -> bool:
    """Whether a command takes the aircraft out of the mission's mode, in which it was."""
    if getattr(message, "command", None) != mavlink.MAV_CMD_DO_SET_MODE:
        return False
    changes = recording.modes.during(time_s, time_s + 2.0)
    adapter = ArduPlane if recording.autopilot == "ardupilot" else Px4FixedWing
    return adapter.mode_name(recording.modes.at(time_s)) == adapter.mission_mode and len(changes) > 1


def _mission_begin_s(recording: Recording) -> float:
    """When the first item after the take-off is flown."""
    sequences, first = recording.sequences, 0
    for sequence, item in enumerate(recording.items):
        if item.command == NAV_TAKEOFF:
            first = sequence + 1
    flown = zip(sequences.times_s, sequences.values, strict=True)
    return next((time_s for time_s, value in flown if value >= first), 0.0) + _AFTER_TAKEOFF_S
