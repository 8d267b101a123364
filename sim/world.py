"""The simulated world of a scenario: its vehicle, its traffic and the receiver."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from companion.geodesy import LocalFrame
from companion.model import Vec2
from sim.receiver import Datums, SimulatedReceiver, limited
from sim.scenario import Autopilot, Conflict, Receiver, Scenario
from sim.traffic import AdsbReceiver, Intruder, ReceiverModel, TrafficReceiver
from sim.vehicle import FakeArduPlane, FakePx4, FakeVehicle, Truth

# The same aircraft under either autopilot: PX4 gets the speeds of ArduPlane's defaults.
_PX4_PARAMETERS = {"FW_AIRSPD_TRIM": 22.0, "FW_AIRSPD_MAX": 30.0}


@dataclass(frozen=True, slots=True)
class World:
    """A scenario running from `start_s`: the vehicle on its mission, the traffic, and the ADS-B receiver."""

    start_s: float
    frame: LocalFrame
    vehicle: FakeVehicle
    intruders: tuple[Intruder, ...]
    receiver: AdsbReceiver

    def receiver_of(self, name: str, datums: Datums | None = None, *, seed: int = 0) -> SimulatedReceiver:
        """A receiver of this format on the vehicle, with the errors of the scenario's."""
        model = limited(self.receiver.model, name)
        traffic = TrafficReceiver(self.intruders, self.frame, self.start_s, model=model, seed=seed)
        return SimulatedReceiver(name, traffic, datums)


def kind_of(autopilot: Autopilot) -> tuple[type[FakeArduPlane] | type[FakePx4], dict[str, Any]]:
    """The fake that imitates an autopilot, and the options for its version."""
    if autopilot == "ardupilot":
        return FakeArduPlane, {}
    return FakePx4, {"firmware": "1.18" if autopilot == "px4-1.18" else "1.16"}


def make_vehicle(
    scenario: Scenario,
    start_s: float,
    autopilot: Autopilot = "ardupilot",
    *,
    system_id: int = 1,
    cruise_mps: float | None = None,
) -> FakeVehicle:
    """The scenario's vehicle on its mission and armed: about to take off, or in the air on the way.

    `cruise_mps` is its airspeed on the mission, if not the usual one.
    """
    start = scenario.start
    heading_rad = math.radians(start.heading_deg)
    kind, options = kind_of(autopilot)
    parameters = dict(_PX4_PARAMETERS) if kind is FakePx4 else {}
    if cruise_mps is not None:
        parameters["FW_AIRSPD_TRIM" if kind is FakePx4 else "AIRSPEED_CRUISE"] = cruise_mps
    options |= {
        "system_id": system_id,
        "mission": scenario.items,
        "wind_mps": (scenario.wind.north_mps, scenario.wind.east_mps),
        "parameters": parameters,
    }
    if start.where == "air":
        return kind.airborne(
            scenario.home_place,
            start_s,
            position=scenario.place(start.north_m, start.east_m, start.height_m),
            course_rad=heading_rad,
            sequence=kind.first_item + 1,
            **options,
        )
    vehicle = kind(scenario.home_place, start_s, heading_rad=heading_rad, **options)
    vehicle.start_mission()
    vehicle.arm()
    return vehicle


def build_world(
    scenario: Scenario, start_s: float, *, seed: int = 0, autopilot: Autopilot = "ardupilot"
) -> World:
    """The vehicle and its traffic; intruders are aimed at future positions of the undisturbed vehicle."""
    scout = make_vehicle(scenario, start_s, autopilot)
    aimed: dict[str, Intruder] = {}
    for conflict in sorted(scenario.intruders, key=lambda c: c.meet_at_s):
        scout.step(start_s + conflict.meet_at_s)
        aimed[conflict.icao] = aim(conflict, scout.truth)
    intruders = tuple(aimed[conflict.icao] for conflict in scenario.intruders)
    receiver = AdsbReceiver(
        intruders, scenario.frame, start_s, model=receiver_model(scenario.receiver), seed=seed
    )
    vehicle = make_vehicle(scenario, start_s, autopilot)
    return World(start_s, scenario.frame, vehicle, intruders, receiver)


def aim(conflict: Conflict, truth: Truth) -> Intruder:
    """The intruder of a conflict, closest to us at the time of `truth` if both fly straight."""
    own_north_mps, own_east_mps, _ = truth.velocity_mps
    own_course_rad = math.atan2(own_east_mps, own_north_mps)
    course_rad = own_course_rad + math.radians(conflict.from_deg) + math.pi
    north_mps = conflict.speed_mps * math.cos(course_rad)
    east_mps = conflict.speed_mps * math.sin(course_rad)
    aside_n, aside_e = aside(north_mps - own_north_mps, east_mps - own_east_mps, own_course_rad)
    return Intruder(
        icao=int(conflict.icao, 16),
        callsign=conflict.callsign,
        anchor_s=truth.time_s,
        position_m=(
            truth.position_m[0] + conflict.miss_m * aside_n,
            truth.position_m[1] + conflict.miss_m * aside_e,
            truth.position_m[2] - conflict.miss_height_m,
        ),
        velocity_mps=(north_mps, east_mps, -conflict.climb_mps),
    )


def aside(relative_north_mps: float, relative_east_mps: float, own_course_rad: float) -> Vec2:
    """The unit vector perpendicular to the relative motion, on our right: the direction of the miss."""
    speed_mps = math.hypot(relative_north_mps, relative_east_mps)
    right_n, right_e = -math.sin(own_course_rad), math.cos(own_course_rad)
    if speed_mps < 1e-6:
        return right_n, right_e
    across_n, across_e = -relative_east_mps / speed_mps, relative_north_mps / speed_mps
    side = 1.0 if across_n * right_n + across_e * right_e >= 0.0 else -1.0
    return side * across_n, side * across_e


def receiver_model(receiver: Receiver) -> ReceiverModel:
    """The errors of a scenario's receiver."""
    return ReceiverModel(
        horizontal_sigma_m=receiver.horizontal_sigma_m,
        vertical_sigma_m=receiver.vertical_sigma_m,
        speed_sigma_mps=receiver.speed_sigma_mps,
        climb_sigma_mps=receiver.climb_sigma_mps,
        delay_s=receiver.delay_s,
        loss=receiver.loss,
        range_m=receiver.range_m,
        flags=receiver.flags,
        barometric=receiver.barometric,
        altitude_offset_m=receiver.altitude_offset_m,
    )


def undisturbed(
    scenario: Scenario, start_s: float = 0.0, period_s: float = 0.1, autopilot: Autopilot = "ardupilot"
) -> Sequence[Truth]:
    """The states of the vehicle without avoidance, every `period_s` for the scenario's duration."""
    return flown_by(make_vehicle(scenario, start_s, autopilot), scenario.duration_s, period_s)


def flown_by(vehicle: FakeVehicle, duration_s: float, period_s: float) -> Sequence[Truth]:
    """The states of a vehicle on its own, every `period_s`."""
    start_s, truths = vehicle.time_s, [vehicle.truth]
    for number in range(1, int(duration_s / period_s) + 1):
        vehicle.step(start_s + number * period_s)
        truths.append(vehicle.truth)
    return truths
