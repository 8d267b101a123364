"""A small closed loop for the avoider alone: a point mass follows its guidance among intruders."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from companion.avoidance import AvoidanceParams, Avoider, Fence
from companion.geodesy import wrap_pi
from companion.model import Decision, Goal, Layer, Ownship, Track, Vec3
from companion.units import STANDARD_GRAVITY_MPS2

BANK_RAD, CLIMB_MPS = math.radians(30.0), 2.5
ALTITUDE_M = 300.0
GOAL_M: Vec3 = (5000.0, 0.0, -ALTITUDE_M)


@dataclass
class Aircraft:
    """Bank, climb and speed follow with lags; the limits are 30 degrees and 2.5 m/s."""

    position_m: list[float] = field(default_factory=lambda: [0.0, 0.0, -ALTITUDE_M])
    course_rad: float = 0.0
    speed_mps: float = 22.0
    bank_rad: float = 0.0
    climb_mps: float = 0.0

    def fly(self, course_rad: float, speed_mps: float, altitude_m: float, dt_s: float) -> None:
        off_rad = wrap_pi(course_rad - self.course_rad)
        bank_rad = min(max(1.5 * off_rad, -BANK_RAD), BANK_RAD)
        self.bank_rad += min(max(bank_rad - self.bank_rad, -dt_s), dt_s)
        self.course_rad += STANDARD_GRAVITY_MPS2 * math.tan(self.bank_rad) / self.speed_mps * dt_s
        self.speed_mps += min(max(speed_mps - self.speed_mps, -dt_s), dt_s)
        climb_mps = min(max(0.5 * (altitude_m + self.position_m[2]), -CLIMB_MPS), CLIMB_MPS)
        self.climb_mps += min(max(climb_mps - self.climb_mps, -1.5 * dt_s), 1.5 * dt_s)
        self.position_m[0] += self.speed_mps * math.cos(self.course_rad) * dt_s
        self.position_m[1] += self.speed_mps * math.sin(self.course_rad) * dt_s
        self.position_m[2] -= self.climb_mps * dt_s

    def ownship(self, time_s: float) -> Ownship:
        north, east = math.cos(self.course_rad), math.sin(self.course_rad)
        velocity = (self.speed_mps * north, self.speed_mps * east, -self.climb_mps)
        north_m, east_m, down_m = self.position_m
        return Ownship(time_s, (north_m, east_m, down_m), velocity, self.speed_mps, self.course_rad)


@dataclass
class Outcome:
    """The result of a flight.

    `well_clear` is the minimum of max(horizontal / 609.6 m, vertical / 76.2 m); below 1 it was lost.
    `near_miss` is the same with 152.4 m and 30.5 m; `outside_m` is the largest distance beyond the fence.
    """

    well_clear: float = math.inf
    near_miss: float = math.inf
    outside_m: float = 0.0
    engagements: int = 0
    changes: int = 0
    first_s: float | None = None
    deviation_m: float = 0.0
    lowest_m: float = math.inf
    highest_m: float = -math.inf
    decisions: list[Decision] = field(default_factory=list)
    arrived: bool = False


Traffic = Callable[[float], tuple[Vec3, Vec3]]


def straight(
    from_deg: float,
    speed_mps: float,
    *,
    climb_mps: float = 0.0,
    miss_m: float = 0.0,
    meet_s: float = 90.0,
    own_mps: float = 22.0,
) -> Traffic:
    """An intruder in straight flight that meets us at `meet_s`, from a direction (0 head-on, clockwise)."""
    course_rad = math.radians(from_deg) + math.pi
    velocity = (speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), -climb_mps)
    aside = (-math.sin(course_rad), math.cos(course_rad))
    meeting = (own_mps * meet_s + miss_m * aside[0], miss_m * aside[1], -ALTITUDE_M)

    def at(time_s: float) -> tuple[Vec3, Vec3]:
        left = time_s - meet_s
        north, east, down = (p + v * left for p, v in zip(meeting, velocity, strict=True))
        return (north, east, down), velocity

    return at


def fly(
    traffic: Sequence[Traffic],
    *,
    params: AvoidanceParams | None = None,
    seconds: float = 400.0,
    avoid: bool = True,
    fence: Fence | None = None,
    aircraft: Aircraft | None = None,
) -> Outcome:
    """Fly north to the goal among the traffic, with a decision a second on perfect tracks."""
    aircraft, outcome, avoider = aircraft or Aircraft(), Outcome(), Avoider(params or AvoidanceParams())
    avoider.fence = fence
    edge = None if fence is None else replace(fence, margin_m=0.0, vertical_margin_m=0.0)
    goal = Goal(position_m=GOAL_M, airspeed_mps=22.0)
    guidance, layer = None, Layer.CLEAR
    for step in range(int(seconds * 10)):
        time_s = step / 10
        states = [at(time_s) for at in traffic]
        if avoid and step % 10 == 0:
            tracks = [Track(f"{i:06X}", time_s, p, v) for i, (p, v) in enumerate(states)]
            decision = avoider.decide(time_s, aircraft.ownship(time_s), tracks, goal)
            outcome.decisions.append(decision)
            outcome.engagements += layer is Layer.CLEAR and decision.layer is not Layer.CLEAR
            outcome.changes += guidance is not None and decision.guidance not in (None, guidance)
            if decision.layer is not Layer.CLEAR and outcome.first_s is None:
                outcome.first_s = time_s
            guidance, layer = decision.guidance, decision.layer
        if guidance is not None:
            aircraft.fly(guidance.course_rad, guidance.airspeed_mps, guidance.altitude_m, 0.1)
        else:
            # As both autopilots resume a mission: straight to the waypoint.
            aircraft.fly(_bearing_rad(aircraft, GOAL_M), 22.0, ALTITUDE_M, 0.1)
        _measure(outcome, aircraft, states)
        if edge is not None and step % 10 == 0:
            outside_m = float(edge.depth_m(np.array([aircraft.position_m]))[0])
            outcome.outside_m = max(outcome.outside_m, outside_m)
        if math.dist(aircraft.position_m, GOAL_M) < 40.0:
            outcome.arrived = True
            break
    return outcome


def _bearing_rad(aircraft: Aircraft, place_m: Vec3) -> float:
    return math.atan2(place_m[1] - aircraft.position_m[1], place_m[0] - aircraft.position_m[0])


def _measure(outcome: Outcome, aircraft: Aircraft, states: list[tuple[Vec3, Vec3]]) -> None:
    north_m, east_m, down_m = aircraft.position_m
    outcome.deviation_m = max(outcome.deviation_m, abs(east_m))
    outcome.lowest_m, outcome.highest_m = min(outcome.lowest_m, -down_m), max(outcome.highest_m, -down_m)
    for (other_north_m, other_east_m, other_down_m), _ in states:
        horizontal_m = math.hypot(other_north_m - north_m, other_east_m - east_m)
        ratio = max(horizontal_m / 609.6, abs(other_down_m - down_m) / 76.2)
        outcome.well_clear = min(outcome.well_clear, ratio)
        near = max(horizontal_m / 152.4, abs(other_down_m - down_m) / 30.5)
        outcome.near_miss = min(outcome.near_miss, near)
