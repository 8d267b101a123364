"""Judges one encounter from what was seen on the links. Times are the vehicle's own."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.model import Vec3
from sim.flight_test.observer import Sample
from sim.flight_test.plan import EncounterPlan
from sim.metrics import EncounterScore
from sim.path import off_leg
from sim.traffic import Intruder

# Back on the leg: this near, for good (see the campaign's measure).
ON_LEG_M, AT_HEIGHT_M, _STAYS_S = 30.0, 10.0, 5.0
# The closest approach is looked for this often between two reported positions.
_BETWEEN_S = 0.1
# A longer gap between positions is not interpolated, and around a meeting the encounter is then not judged.
_LONGEST_GAP_S, _AROUND_S = 3.0, 30.0


class Leg:
    """A leg of the mission, from one place to another, both above mean sea level."""

    def __init__(self, start: GeoPoint, end: GeoPoint) -> None:
        self.start, self.end = start, end

    def off_m(self, place: GeoPoint) -> tuple[float, float]:
        """How far a place is from the leg: sideways (never negative, beyond its ends too), and above it."""
        frame = LocalFrame(place.lat_deg, place.lon_deg)
        own_m = np.array([frame.to_ned_m(place)])
        aside, above, beyond = off_leg(frame.to_ned_m(self.start), frame.to_ned_m(self.end), own_m)
        return math.hypot(float(aside[0]), float(beyond[0])), float(above[0])

    def ahead(self, place: GeoPoint, distance_m: float) -> GeoPoint:
        """The place on the leg this far ahead of the place beside it."""
        frame = LocalFrame(place.lat_deg, place.lon_deg)
        start_m, end_m = frame.to_ned_m(self.start), frame.to_ned_m(self.end)
        along = end_m[0] - start_m[0], end_m[1] - start_m[1]
        length_m = max(math.hypot(*along), 1.0)
        flown_m = -(start_m[0] * along[0] + start_m[1] * along[1]) / length_m + distance_m
        share = flown_m / length_m
        down_m = start_m[2] + min(max(share, 0.0), 1.0) * (end_m[2] - start_m[2])
        return frame.to_geo(start_m[0] + share * along[0], start_m[1] + share * along[1], down_m)

    @property
    def course_rad(self) -> float:
        """Its course at its start."""
        north_m, east_m = LocalFrame(self.start.lat_deg, self.start.lon_deg).to_north_east_m(
            self.end.lat_deg, self.end.lon_deg
        )
        return math.atan2(east_m, north_m)


@dataclass
class Claim:
    """An action that claimed the aircraft, and what Companion still sent.

    `mode` is the name of the mode that must be shown; without one it is shown at once.
    """

    mode: str | None = None
    shown_s: float | None = None  # when the aircraft showed it
    commands: list[str] = field(default_factory=list)  # after the time in which Companion had to let go
    ended: bool = False  # the pilot gave the mission back


@dataclass
class Judged:
    """The record of one encounter while it is flown, and its verdict at the end."""

    plan: EncounterPlan
    begun_s: float
    frame: LocalFrame
    intruders: Sequence[Intruder]
    meetings_s: Sequence[float] = ()
    on_mission: bool = True
    guided: bool = False
    expected_mode: str | None = None  # of the plan, by the autopilot's own name
    modes: list[str] = field(default_factory=list)
    mode_changes: list[tuple[float, bool]] = field(default_factory=list)  # when, and whether to a guided mode
    events: list[tuple[float, str]] = field(default_factory=list)
    path: list[tuple[float, Vec3]] = field(default_factory=list)
    scores: list[EncounterScore] = field(init=False)
    first_action_s: float | None = None
    given_back_s: float | None = None
    back_s: float | None = None
    max_deviation_m: float = 0.0
    max_height_m: float = 0.0
    refused: list[str] = field(default_factory=list)
    claim: Claim | None = None
    release_asked_s: float | None = None
    problems: list[str] = field(default_factory=list)
    _back_since_s: float | None = None

    def __post_init__(self) -> None:
        self.scores = [EncounterScore(one.icao, one.callsign) for one in self.intruders]

    # --- while it is flown

    def note(self, time_s: float, text: str) -> None:
        """Add a line to the timeline; `time_s` is the vehicle's."""
        self.events.append((time_s - self.begun_s, text))

    def observe_mode(self, time_s: float, mode: str, *, guided: bool, on_mission: bool) -> None:
        """Take in a new mode."""
        if self.guided and not guided:
            self.given_back_s = time_s - self.begun_s
        self.guided, self.on_mission = guided, on_mission
        self.modes.append(mode)
        self.mode_changes.append((time_s, guided))
        self.note(time_s, f"mode {mode}")
        if guided and self.first_action_s is None:
            self.first_action_s = time_s - self.begun_s
        if self.claim is not None and self.claim.shown_s is None and mode == self.claim.mode:
            self.claim.shown_s = time_s

    def observe_position(self, sample: Sample, leg: Leg | None) -> None:
        """Take in a position, and the way between the last one and this. `leg`: the present one, if known."""
        own_m = self.frame.to_ned_m(sample.place)
        before = self.path[-1] if self.path else (sample.time_s, own_m)
        self.path.append((sample.time_s, own_m))
        for time_s, place_m in _between(before, (sample.time_s, own_m)):
            for score, intruder in zip(self.scores, self.intruders, strict=True):
                score.update(time_s, place_m, intruder.state_at(time_s)[0])
        if leg is None:
            return
        aside_m, above_m = leg.off_m(sample.place)
        self.max_deviation_m = max(self.max_deviation_m, aside_m)
        self.max_height_m = max(self.max_height_m, abs(above_m))
        self._look_whether_back(sample.time_s, aside_m, above_m)

    def _look_whether_back(self, time_s: float, aside_m: float, above_m: float) -> None:
        if not (self.on_mission and aside_m <= ON_LEG_M and abs(above_m) <= AT_HEIGHT_M):
            self._back_since_s = self.back_s = None
            return
        if self._back_since_s is None:
            self._back_since_s = time_s
        if time_s - self._back_since_s >= _STAYS_S or self.first_action_s is None:
            self.back_s = self._back_since_s - self.begun_s

    def observe_command(self, time_s: float, message: Message) -> None:
        """Take in a message of Companion that acts on the aircraft."""
        claim = self.claim
        if claim is None or claim.ended:
            return
        if claim.shown_s is not None and time_s - claim.shown_s > self.plan.expect.hands_off_s:
            claim.commands.append(_named(message))

    def observe_refusal(self, command: int, result: int) -> None:
        """Take in the refusal of a command of Companion."""
        self.refused.append(f"{_command_name(command)}: {_result_name(result)}")

    @property
    def is_over(self) -> bool:
        """Whether all that is waited for has come about."""
        expect = self.plan.expect
        if self.guided or (expect.resumed and not self.on_mission):
            return False
        return self.back_s is not None or not (expect.back and expect.resumed)

    # --- the verdict

    @property
    def was_observed(self) -> bool:
        """Whether the aircraft's positions are known around each meeting."""
        times_s = [time_s for time_s, _ in self.path]
        for meeting_s in self.meetings_s:
            around = [t for t in times_s if abs(t - meeting_s) <= _AROUND_S]
            ends = [meeting_s - _AROUND_S, *around, meeting_s + _AROUND_S]
            ends[0] = max(ends[0], self.begun_s)
            ends[-1] = min(ends[-1], max(times_s, default=ends[-1]))
            if not around or max(b - a for a, b in pairwise(ends)) > _LONGEST_GAP_S:
                return False
        return True

    @property
    def nmac(self) -> bool:
        """Whether any intruder came as near as a near mid-air collision."""
        return any(score.nmac for score in self.scores)

    @property
    def lowc(self) -> bool:
        """Whether well clear was lost with any intruder."""
        return any(score.lowc for score in self.scores)

    @property
    def nearest(self) -> EncounterScore | None:
        """The intruder that came nearest."""
        return min(self.scores, key=lambda score: score.min_slant_m, default=None)

    @property
    def return_s(self) -> float | None:
        """Time from the first take-over until it was back on its leg and height."""
        if self.back_s is None or self.first_action_s is None:
            return None
        return max(self.back_s - self.first_action_s, 0.0)

    def failures(self, mode: str) -> list[str]:
        """What was expected and did not come true, in words; `mode` is the aircraft's at the end."""
        expect, failed = self.plan.expect, list(self.problems)
        if not self.was_observed:
            failed.append("not observed around the meeting")
        if expect.no_nmac and self.nmac:
            failed.append("near mid-air collision")
        elif expect.well_clear and self.lowc:
            failed.append("well clear lost")
        if expect.avoids is True and self.first_action_s is None:
            failed.append("not avoided")
        if expect.avoids is False and self.first_action_s is not None:
            failed.append("avoided without need")
        if expect.resumed and not self.on_mission:
            failed.append(f"the mission was not resumed: {mode}")
        if self.expected_mode is not None and self.expected_mode not in self.modes[1:]:
            failed.append(f"never in {self.expected_mode}")
        late = self.return_s is not None and self.return_s > expect.back_within_s
        if expect.back and expect.resumed and (self.back_s is None or late):
            failed.append("not back on its leg and height" + (" in time" if late else ""))
        return failed + self._failures_of_authority()

    def _failures_of_authority(self) -> list[str]:
        failed, claim = [], self.claim
        if claim is not None and claim.shown_s is None:
            failed.append(f"the aircraft never showed the pilot's mode {claim.mode}")
        if claim is not None and claim.commands:
            failed.append(f"commands sent after the pilot took over: {len(claim.commands)}")
        if self.release_asked_s is not None:
            released = [t for t, mode in self.mode_changes if t >= self.release_asked_s and not mode]
            limit_s = self.release_asked_s + self.plan.expect.released_s
            if not released or released[0] > limit_s:
                failed.append(f"not given back within {self.plan.expect.released_s:.0f} s of the request")
        return failed


def _between(before: tuple[float, Vec3], after: tuple[float, Vec3]) -> list[tuple[float, Vec3]]:
    """Times and places from one position to the next, in small steps; the last is `after`."""
    (from_s, from_m), (to_s, to_m) = before, after
    if not 0.0 < to_s - from_s <= _LONGEST_GAP_S:
        return [after]
    steps = max(math.ceil((to_s - from_s) / _BETWEEN_S), 1)
    return [
        (
            from_s + (to_s - from_s) * k / steps,
            (
                from_m[0] + (to_m[0] - from_m[0]) * k / steps,
                from_m[1] + (to_m[1] - from_m[1]) * k / steps,
                from_m[2] + (to_m[2] - from_m[2]) * k / steps,
            ),
        )
        for k in range(1, steps + 1)
    ]


def _named(message: Message) -> str:
    command = getattr(message, "command", None)
    return message.get_type() if command is None else _command_name(command)


def _command_name(command: int) -> str:
    known = mavlink.enums["MAV_CMD"].get(command)
    return str(command) if known is None else known.name.removeprefix("MAV_CMD_")


def _result_name(result: int) -> str:
    known = mavlink.enums["MAV_RESULT"].get(result)
    return str(result) if known is None else known.name.removeprefix("MAV_RESULT_")
