"""One encounter flown: engine, plane and traffic in lockstep, one decision and ten steps a second."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from companion.control.state_machine import State
from companion.engine import Engine, Transmit
from companion.mavlink.dialect import Message
from companion.mavlink.facts import OwnTransponder, PressureAltitude, Traffic
from companion.model import AltitudeReference, TrafficReport, TrafficSource, adsb_key
from companion.units import (
    NMAC_HORIZONTAL_M,
    NMAC_VERTICAL_M,
    WELL_CLEAR_HORIZONTAL_M,
    WELL_CLEAR_VERTICAL_M,
)
from sim.campaign.plane import AUTO, AUTOPILOT, FRAME, Limits, Plane
from sim.campaign.route import Route, start_of, straight
from sim.encounters import Encounter, Heard, Observer, Surveillance

Array = NDArray[np.floating]

STEP_S = 0.1
STEPS_PER_FACT = 5  # steps: an autopilot counts as silent after a second without messages
_STEPS_PER_DECISION = 2 * STEPS_PER_FACT
_START_S = 1_700_000_000.0
# Wind, airspeed and the mission's next waypoint.
_RARE_FACTS_S = 2
# Back: in AUTO this near to the leg between the waypoints and to its slope, for this long.
_ON_LEG_M, _AT_HEIGHT_M = 30.0, 10.0
_STAYS_S = 10.0
# Before the encounter the engine reads the mission.
BEFORE_S = 12.0
# For the way back after the encounter; an intruder may stay on the mission line, at our speed.
LONGEST_RETURN_S = 1800.0
FIRST_ICAO = 0xA00001


@dataclass(frozen=True, slots=True)
class ClosestApproach:
    """The closest approach of the nearest intruder, and whether the standards' volumes were entered.

    `severity` is the minimum over time of max(horizontal / 609.6 m, vertical / 76.2 m): below 1, well clear
    is lost. The distances are those at that moment.
    """

    horizontal_m: float
    vertical_m: float
    severity: float
    nmac: bool
    lowc: bool


@dataclass
class EncounterResult:
    """The result of one encounter; `own_m` is our path, (n, 3) north-east-down every 0.1 s.

    `back_s` is when the aircraft was back on its leg and height for good, `return_s` how long that took from
    the first take-over. `on_left_leg`: that was the leg left at the last take-over, and not one after it.
    `given_back_on_leg`: on that leg and height the mission's mode was entered the last time. `strayed_s`:
    time in the mission's mode off its leg or height, after the first take-over. `mirrored`: where both
    aircraft avoid, how their maneuvers cancelled each other (see `sim.campaign.mirroring`); otherwise `None`.
    """

    closest: ClosestApproach
    deviation_m: float = 0.0
    height_m: float = 0.0
    avoided: bool = False
    engagements: int = 0
    back_s: float | None = None
    return_s: float | None = None
    on_left_leg: bool | None = None
    given_back_on_leg: bool | None = None
    strayed_s: float = 0.0
    mirrored: tuple[str, ...] | None = None
    first_action_s: float | None = None
    decision_ms: list[float] = field(default_factory=list)
    own_m: Array = field(default_factory=lambda: np.zeros((0, 3)))
    reasons: list[tuple[float, str]] = field(default_factory=list)


def closest_approach(own_m: Array, encounter: Encounter, dt_s: float = STEP_S) -> ClosestApproach:
    """The closest approach within the encounter; own positions (n, 3) every `dt_s` from 0."""
    count = min(len(own_m), round(encounter.duration_s / dt_s) + 1)
    times_s = np.arange(count) * dt_s
    horizontal, vertical, severity = [], [], []
    nmac = lowc = False
    for path in encounter.intruders:
        off_m = path.positions_m(times_s) - own_m[:count]
        across_m, above_m = np.hypot(off_m[:, 0], off_m[:, 1]), np.abs(off_m[:, 2])
        ratio = np.maximum(across_m / WELL_CLEAR_HORIZONTAL_M, above_m / WELL_CLEAR_VERTICAL_M)
        worst = int(np.argmin(ratio))
        horizontal.append(float(across_m[worst]))
        vertical.append(float(above_m[worst]))
        severity.append(float(ratio[worst]))
        nmac |= bool(((across_m < NMAC_HORIZONTAL_M) & (above_m < NMAC_VERTICAL_M)).any())
        lowc |= bool((ratio < 1.0).any())
    first = int(np.argmin(severity))
    return ClosestApproach(horizontal[first], vertical[first], severity[first], nmac, lowc)


def unmitigated(
    encounter: Encounter, route: Route | None = None, limits: Limits | None = None
) -> ClosestApproach:
    """The closest approach without avoidance; without a `route` the mission is a straight line."""
    count = round(encounter.duration_s / STEP_S)
    if route is not None:
        plane = plane_on(encounter, route, limits or Limits())
        parts = [plane.fly(STEPS_PER_FACT, STEP_S) for _ in range(round(BEFORE_S / STEP_S) // STEPS_PER_FACT)]
        flown = [parts[-1][-1:], *(plane.fly(STEPS_PER_FACT, STEP_S) for _ in range(count // STEPS_PER_FACT))]
        return closest_approach(np.concatenate(flown), encounter)
    times_s = np.arange(count + 1) * STEP_S
    course, speed = encounter.own_course_rad, encounter.own_airspeed_mps
    velocity = np.array([speed * math.cos(course), speed * math.sin(course), 0.0])
    return closest_approach(np.array(encounter.own_position_m) + times_s[:, None] * velocity, encounter)


def plane_on(encounter: Encounter, route: Route, limits: Limits) -> Plane:
    """The aircraft on its route, `BEFORE_S` before the encounter."""
    return Plane(start_of(encounter, route, BEFORE_S), encounter.own_airspeed_mps, route, limits)


def fly(
    encounter: Encounter,
    make_engine: Callable[[Encounter], Engine],
    surveillance: Surveillance,
    limits: Limits,
    *,
    seed: int = 0,
    route: Route | None = None,
) -> EncounterResult:
    """Fly an encounter, and continue until the aircraft is back on its leg; the default route is straight."""
    route = straight(encounter) if route is None else route
    observer = Observer(encounter, surveillance, seed)
    return Flight(encounter, make_engine(encounter), observer, limits, route).run()


class Receiver(Protocol):
    """What receives the reports of the other aircraft; `stated_sigma_m` is the accuracy that they state."""

    stated_sigma_m: float | None

    def reports(self, now_s: float) -> list[Heard]:
        """The reports that arrived since the last call."""


class Flight:
    """The flight of one aircraft: `run` for all of it, or step by step beside another aircraft.

    `icao`: the address of its own transponder, if it has one. `phase`: steps by which its decisions come
    earlier than whole seconds.
    """

    def __init__(
        self,
        encounter: Encounter,
        engine: Engine,
        observer: Receiver,
        limits: Limits,
        route: Route,
        *,
        icao: int | None = None,
        phase: int = 0,
    ) -> None:
        self._encounter, self._engine, self._route = encounter, engine, route
        self._plane = plane_on(encounter, route, limits)
        self._icao, self._phase = icao, phase
        self._back_since_s: float | None = None
        self._back_on = 0  # the number of the leg
        self._observer = observer
        self._over = False
        self._noted: object = None  # state and guidance of the last entry in `reasons`
        self._own_m: list[Array] = []
        self._flown = EncounterResult(ClosestApproach(math.inf, math.inf, math.inf, nmac=False, lowc=False))

    @property
    def plane(self) -> Plane:
        """The aircraft."""
        return self._plane

    def run(self) -> EncounterResult:
        """Fly until the aircraft is back on its leg."""
        self.read_mission()
        step = 0
        while not self.decide(step):
            self.fly_on()
            step += STEPS_PER_FACT
        return self.result()

    def decide(self, step: int) -> bool:
        """Send facts, and decide where a decision is due; returns whether the flight is over."""
        self._send_facts(step)
        if (step + self._phase) % _STEPS_PER_DECISION == 0:
            self._decide(step * STEP_S)
            is_back, since = self._is_back(step * STEP_S), step - round(self._encounter.duration_s / STEP_S)
            self._over = since >= 0 and (is_back or since >= round(LONGEST_RETURN_S / STEP_S))
        return self._over

    def fly_on(self) -> None:
        """Fly until the next facts."""
        self._own_m.append(self._plane.fly(STEPS_PER_FACT, STEP_S))

    def result(self) -> EncounterResult:
        """The result of what was flown."""
        flown, plane = self._flown, self._plane
        flown.own_m = np.concatenate(self._own_m)
        flown.closest = closest_approach(flown.own_m, self._encounter)
        flown.engagements = plane.entered_guided
        flown.avoided = plane.entered_guided > 0
        if plane.given_back_m is not None:
            flown.given_back_on_leg = _is_on_leg(plane.given_back_m)
        if flown.back_s is not None and flown.first_action_s is not None:
            flown.return_s = flown.back_s - flown.first_action_s
        off_m = np.abs(self._route.off_m(flown.own_m))
        flown.deviation_m, flown.height_m = float(off_m[:, 0].max()), float(off_m[:, 1].max())
        return flown

    def read_mission(self) -> None:
        """Fly to the begin of the encounter; the engine asks for the mission and is answered."""
        engine, plane = self._engine, self._plane
        for step in range(-round(BEFORE_S / STEP_S), 0, STEPS_PER_FACT):
            now_s = _START_S + step * STEP_S
            for fact in (plane.heartbeat(), *plane.facts(now_s), *plane.rare_facts()):
                engine.receive(fact, now_s)
            for tick in range(STEPS_PER_FACT):
                if engine.queries.mission is not None:
                    break
                tick_s = now_s + tick * STEP_S
                plane.execute(_messages(engine.tick(tick_s)))
                for answer in plane.take_answers():
                    engine.receive(answer, tick_s)
            own_m = plane.fly(STEPS_PER_FACT, STEP_S)
        self._own_m.append(own_m[-1:])
        if self._icao is not None:
            engine.receive(OwnTransponder(AUTOPILOT, self._icao), _START_S)

    def _is_back(self, time_s: float) -> bool:
        """Whether the aircraft has been on its leg and height for a while; notes since when."""
        on_leg, in_auto = _is_on_leg(self._plane.off_leg_m()), self._plane.mode == AUTO
        if in_auto and not on_leg and self._plane.entered_guided:
            self._flown.strayed_s += _STEPS_PER_DECISION * STEP_S
        if not (on_leg and in_auto):
            self._back_since_s = self._flown.back_s = self._flown.on_left_leg = None
            return False
        if self._back_since_s is None:
            self._back_since_s, self._back_on = time_s, self._plane.leg
        if time_s - self._back_since_s >= _STAYS_S or not self._plane.entered_guided:
            self._flown.back_s = self._back_since_s
            self._flown.on_left_leg = self._back_on == self._plane.left_leg
        return self._flown.back_s is not None

    def _send_facts(self, step: int) -> None:
        now_s = _START_S + step * STEP_S
        engine, plane = self._engine, self._plane
        facts = plane.facts(now_s)
        decides = (step + self._phase) % _STEPS_PER_DECISION == 0
        if decides:
            facts.insert(0, plane.heartbeat())
        if (step + self._phase) % (_RARE_FACTS_S * _STEPS_PER_DECISION) == 0:
            facts += plane.rare_facts()
        for fact in facts:
            engine.receive(fact, now_s)
        if decides:
            stated_m = self._observer.stated_sigma_m
            engine.receive(PressureAltitude(AUTOPILOT, -plane.position_m[2]), now_s)
            for report in self._observer.reports(step * STEP_S):
                engine.receive(Traffic(AUTOPILOT, as_report(report, now_s, stated_m)), now_s)

    def _decide(self, time_s: float) -> None:
        now_s, engine, flown = _START_S + time_s, self._engine, self._flown
        begun = time.perf_counter()
        effects = engine.tick(now_s)
        flown.decision_ms.append((time.perf_counter() - begun) * 1e3)
        messages = _messages(effects)
        if self._plane.execute(messages):
            # The autopilot sends its heartbeat five times a second, so it reports a new mode that soon.
            for fact in (self._plane.heartbeat(), *self._plane.facts(now_s)):
                engine.receive(fact, now_s)
            self._plane.execute(_messages(engine.tick(now_s)))
        if engine.supervisor.state in (State.OUTER, State.INNER) and flown.first_action_s is None:
            flown.first_action_s = time_s
        self._note(time_s)

    def _note(self, time_s: float) -> None:
        """Record state and reason whenever state or guidance changes."""
        engine, decision = self._engine, self._engine.decision
        guidance = decision.guidance if engine.supervisor.flying else None
        wanted = None
        if guidance is not None:
            wanted = (
                round(guidance.course_rad, 2),
                round(guidance.altitude_m),
                round(guidance.airspeed_mps, 1),
            )
        now = engine.supervisor.state, wanted
        if now != self._noted:
            self._noted = now
            self._flown.reasons.append((time_s, f"{engine.supervisor.state}: {decision.because}"))


def _is_on_leg(off_m: tuple[float, float]) -> bool:
    aside_m, above_m = off_m
    return abs(aside_m) <= _ON_LEG_M and abs(above_m) <= _AT_HEIGHT_M


def _messages(effects: Sequence[object]) -> list[Message]:
    return [effect.message for effect in effects if isinstance(effect, Transmit)]


def as_report(heard: Heard, now_s: float, stated_sigma_m: float | None = None) -> TrafficReport:
    """The report of a transponder: pressure altitude, and age and accuracy as the receiver reports them."""
    index, _, position_m, velocity_mps, reported_age_s = heard
    lat_deg, lon_deg, altitude_m = FRAME.to_geo(*position_m)
    icao = FIRST_ICAO + index
    return TrafficReport(
        TrafficSource.ADSB,
        adsb_key(icao),
        now_s - reported_age_s,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        altitude_m=altitude_m,
        altitude_reference=AltitudeReference.BAROMETRIC,
        course_rad=math.atan2(velocity_mps[1], velocity_mps[0]) % math.tau,
        ground_speed_mps=math.hypot(velocity_mps[0], velocity_mps[1]),
        climb_mps=-velocity_mps[2],
        icao=icao,
        position_sigma_m=stated_sigma_m,
    )
