"""One crossing flown: all members in lockstep, each with its own engine, clock and moment of deciding."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim.campaign.flight import BEFORE_S, STEP_S
from sim.campaign.plane import Plane
from sim.campaign.trail import LiveReceiver, Trail
from sim.encounters import Surveillance
from sim.formation.crossing import ARRIVED_M, Crossing
from sim.formation.engines import Separation, engine_of, shares_intent
from sim.formation.member import Member
from sim.formation.radio import Radio, RadioQuality

Array = NDArray[np.floating]

_POSITION_STEPS, _HEARTBEAT_STEPS, _RARE_STEPS = 2, 10, 20
# Clocks of members drift by up to this share.
_DRIFT = 20e-6
_SILENT_BEFORE_S = 20.0


@dataclass(frozen=True, slots=True)
class Conditions:
    """How a crossing is flown: the radio, what receivers hear of a stranger, and ticks a second.

    `falls_silent`: one member sends nothing more from 20 s before the meeting. The flight ends at `ends_s`.
    """

    radio: RadioQuality = field(default_factory=RadioQuality)
    surveillance: Surveillance = field(default_factory=Surveillance)
    separation: Separation = field(default_factory=Separation)
    ticks_hz: int = 5
    falls_silent: bool = False
    ends_s: float = math.inf

    def __post_init__(self) -> None:
        if self.ticks_hz not in (1, 2, 5, 10):
            raise ValueError("ticks_hz must be 1, 2, 5 or 10")


@dataclass
class FormationFlight:
    """What was flown: positions every 0.1 s from the start, (T, N, 3), and when each member arrived."""

    crossing: Crossing
    position_m: Array
    arrived_s: list[float | None]
    engagements: list[int]
    decision_ms: list[float]
    intent_bytes_per_s: float  # the largest of all members, over one second
    reasons: list[list[tuple[float, str]]]


def fly(crossing: Crossing, avoider: str, conditions: Conditions, seed: int = 0) -> FormationFlight:
    """Fly a crossing until all members have arrived, or none can in time any more."""
    return _Lockstep(crossing, avoider, conditions, seed).run()


class _Lockstep:
    def __init__(self, crossing: Crossing, avoider: str, conditions: Conditions, seed: int) -> None:
        self._crossing, self._conditions = crossing, conditions
        count = len(crossing.missions)
        rng = np.random.default_rng([seed, 5])
        self._ends_s = min(crossing.latest_s, conditions.ends_s)
        self._every = round(1.0 / (conditions.ticks_hz * STEP_S))
        self._phases = rng.integers(0, self._every, count).tolist()
        self._radio = Radio(count, conditions.radio, seed)
        self._trails = [Trail() for _ in range(count)]
        self._members = [
            Member(
                number,
                _plane(crossing, number),
                engine_of(avoider, number, mission.limits, conditions.separation),
                drift=float(rng.uniform(-_DRIFT, _DRIFT)),
                shares_intent=shares_intent(avoider),
            )
            for number, mission in enumerate(crossing.missions, start=1)
        ]
        self._receivers = self._stranger_receivers(seed)
        self._arrived_s: list[float | None] = [None] * count
        self._noted: list[object] = [None] * count
        self._reasons: list[list[tuple[float, str]]] = [[] for _ in range(count)]

    def run(self) -> FormationFlight:
        """Fly all members, the companions reading their missions before the start."""
        for step in range(-round(BEFORE_S / STEP_S), 0):
            self._step(step)
        places = []
        step = 0
        while True:
            places.append([member.plane.position_m for member in self._members])
            self._note_arrivals(step * STEP_S, places[-1])
            if None not in self._arrived_s or step * STEP_S > self._ends_s:
                break
            self._step(step)
            step += 1
        return FormationFlight(
            self._crossing,
            np.array(places),
            self._arrived_s,
            [member.plane.entered_guided for member in self._members],
            [duration for member in self._members for duration in member.decision_ms],
            max(_largest_rate(member.intent_bytes) for member in self._members),
            self._reasons,
        )

    def _step(self, step: int) -> None:
        """All members hear, then all send and decide, then all fly on."""
        time_s = step * STEP_S
        for index, member in enumerate(self._members):
            self._hear(index, member, time_s)
        for index, member in enumerate(self._members):
            raws = self._telemetry(index, member, step)
            if (step + self._phases[index]) % self._every == 0:
                raws += member.decide(time_s)
                self._note(index, member, time_s)
            if not self._is_silent(index, time_s):
                for raw in raws:
                    self._radio.send(index, raw, time_s)
        for member in self._members:
            member.plane.fly(1, STEP_S)

    def _hear(self, index: int, member: Member, time_s: float) -> None:
        for arrived_s, raw in self._radio.arrived(index, time_s):
            member.hear(raw, arrived_s)
        self._trails[index].note(time_s, member.plane)
        if self._receivers and time_s >= 0.0:
            for heard in self._receivers[index].reports(time_s):
                member.hear_traffic(heard, time_s)

    def _telemetry(self, index: int, member: Member, step: int) -> list[bytes]:
        """The autopilot's messages, members one step apart."""
        if (step + index) % _POSITION_STEPS:
            return []
        heartbeat = (step + index) % _HEARTBEAT_STEPS < _POSITION_STEPS
        rare = (step + index) % _RARE_STEPS < _POSITION_STEPS
        return member.telemeter(step * STEP_S, heartbeat=heartbeat, rare=rare)

    def _stranger_receivers(self, seed: int) -> list[LiveReceiver]:
        stranger = self._crossing.stranger
        if stranger is None:
            return []
        return [
            LiveReceiver(stranger, trail, 0, self._conditions.surveillance, seed + 7919 * index)
            for index, trail in enumerate(self._trails)
        ]

    def _is_silent(self, index: int, time_s: float) -> bool:
        silent_s = self._crossing.meets_s - _SILENT_BEFORE_S
        return index == 0 and self._conditions.falls_silent and time_s >= silent_s

    def _note_arrivals(self, time_s: float, places: list[tuple[float, float, float]]) -> None:
        if time_s > self._crossing.latest_s:
            return
        for index, (place_m, mission) in enumerate(zip(places, self._crossing.missions, strict=True)):
            away_m = math.dist(place_m[:2], mission.end_m[:2])
            if self._arrived_s[index] is None and away_m <= ARRIVED_M:
                self._arrived_s[index] = time_s

    def _note(self, index: int, member: Member, time_s: float) -> None:
        """Record state and reason whenever the state or the layer changes."""
        engine = member.engine
        if engine is None:
            return
        decision, state = engine.decision, engine.supervisor.state
        if (state, decision.layer) != self._noted[index]:
            self._noted[index] = state, decision.layer
            self._reasons[index].append((time_s, f"{state}: {decision.because}"))


def _plane(crossing: Crossing, system_id: int) -> Plane:
    """The aircraft of a member, `BEFORE_S` before the start."""
    mission = crossing.missions[system_id - 1]
    (north_m, east_m, down_m), to_m = mission.start_m, mission.route.places_m[1]
    course_rad = math.atan2(to_m[1] - east_m, to_m[0] - north_m)
    back_m = -BEFORE_S * mission.airspeed_mps
    before_m = north_m + back_m * math.cos(course_rad), east_m + back_m * math.sin(course_rad), down_m
    return Plane(before_m, mission.airspeed_mps, mission.route, mission.limits, system_id)


def _largest_rate(sent: list[tuple[float, int]]) -> float:
    """The most bytes sent within a second."""
    largest = total = first = 0
    for time_s, size in sent:
        total += size
        while sent[first][0] <= time_s - 1.0 + 1e-6:
            total -= sent[first][1]
            first += 1
        largest = max(largest, total)
    return float(largest)
