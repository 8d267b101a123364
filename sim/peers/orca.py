"""Optimal Reciprocal Collision Avoidance in the plane, by the library of its authors."""

import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from companion.errors import ConfigError
from companion.geodesy import wrap_pi
from companion.model import Decision, Goal, Guidance, Layer, Ownship, Track, Vec2
from sim.peers.peer import PeerLimits, Relative, course_of, mission_of, relatives, wind_of


@dataclass(frozen=True, slots=True)
class OrcaParams:
    """The disc to keep clear of, and the time horizon."""

    # Well clear for small UAS against crewed aircraft (ASTM F3442). The library adds the radii of two agents,
    # so each gets half.
    separation_m: float = 609.6
    # A disc has no height: an intruder counts if it comes within this height difference inside the horizon.
    half_height_m: float = 76.2
    # Both are enlarged by this factor, as for MVP: otherwise the method flies exactly along the boundary.
    margin_factor: float = 1.05
    time_horizon_s: float = 60.0  # the horizon of our outer layer
    # Time to leave a disc that was already entered; decisions come every second.
    time_step_s: float = 1.0
    neighbours: int = 16  # as many as our avoider prices
    # Smaller differences from the mission count as the mission.
    course_tolerance_rad: float = math.radians(1.0)
    speed_tolerance_mps: float = 0.5


class Orca:
    """The collision-free velocity nearest to the mission's, if each aircraft takes half of the change.

    Source: van den Berg, Guy, Lin, Manocha, "Reciprocal n-body collision avoidance" (2011), in the authors'
    RVO2 library through `pyrvo`. Velocities are air velocities, so that the disc of possible speeds is the
    airframe's. Intruders that do not cooperate leave their half of the change to the following decisions. A
    velocity below the minimum airspeed is flown at that airspeed. The height stays that of the mission.
    """

    def __init__(self, limits: PeerLimits, params: OrcaParams | None = None) -> None:
        """`ConfigError` if the library is missing."""
        self.limits = limits
        self.params = params or OrcaParams()
        try:
            # Optional, and without type stubs.
            self._rvo: Any = importlib.import_module("pyrvo")
        except ImportError as error:
            raise ConfigError(
                "orca needs the pyrvo package: make orca, or pip install 'mavlink-companion[orca]'"
            ) from error

    def reset(self) -> None:
        """Do nothing: there is no memory."""

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:
        """The decision at `now_s`, north-east-down [m, m/s, rad]."""
        half_height_m = self.params.half_height_m * self.params.margin_factor
        near = [
            other
            for other in relatives(now_s, own, tracks)
            if other.least_height_m(self.params.time_horizon_s) < half_height_m
        ]
        if not near:
            return Decision(Layer.CLEAR, because="no traffic at this height")
        mission = mission_of(now_s, own, goal)
        mission = self.limits.guidance(mission.course_rad, mission.airspeed_mps, mission.altitude_m)
        wind = wind_of(own)
        preferred = _through_air_mps(mission, wind)
        north_mps, east_mps = self._free_velocity_mps(own, near, preferred, wind)
        airspeed_mps = math.hypot(north_mps, east_mps)
        if airspeed_mps < 1e-3:  # the library's last resort; a fixed wing cannot stop
            course_rad = course_of(own)
        else:
            stretch = max(self.limits.min_airspeed_mps / airspeed_mps, 1.0)
            course_rad = math.atan2(stretch * east_mps + wind[1], stretch * north_mps + wind[0])
        guidance = self.limits.guidance(course_rad, airspeed_mps, mission.altitude_m)
        if self._is_mission(guidance, mission):
            return Decision(Layer.CLEAR, because="mission free")
        near.sort(key=lambda other: other.distance_m)
        names = ", ".join(other.track.track_id for other in near)
        threats = tuple(other.as_threat() for other in near)
        return Decision(Layer.OUTER, guidance, threats, f"{names}: nearest free velocity")

    def _free_velocity_mps(
        self, own: Ownship, near: Sequence[Relative], preferred_mps: Vec2, wind_mps: Vec2
    ) -> Vec2:
        """The library's air velocity for us, agent 0 at the origin: north, east [m/s]."""
        ours = own.velocity_mps[0] - wind_mps[0], own.velocity_mps[1] - wind_mps[1]
        params, fastest_mps = self.params, self.limits.max_airspeed_mps
        # Include all tracks; the time horizon leaves out those too far away.
        reach_m = 1.0 + max(other.distance_m for other in near)
        simulator = self._rvo.RVOSimulator(
            params.time_step_s,
            reach_m,
            params.neighbours,
            params.time_horizon_s,
            params.time_horizon_s,
            0.5 * params.separation_m * params.margin_factor,
            fastest_mps,
        )
        simulator.add_agent((0.0, 0.0))
        simulator.set_agent_velocity(0, ours)
        simulator.set_agent_pref_velocity(0, preferred_mps)
        for other in near:
            place = simulator.add_agent(other.position_m[:2])
            velocity = ours[0] + other.velocity_mps[0], ours[1] + other.velocity_mps[1]
            simulator.set_agent_velocity(place, velocity)
            simulator.set_agent_pref_velocity(place, velocity)
        simulator.do_step()
        north_mps, east_mps = simulator.get_agent_velocity(0).to_tuple()
        return float(north_mps), float(east_mps)

    def _is_mission(self, guidance: Guidance, mission: Guidance) -> bool:
        turn_rad = abs(wrap_pi(guidance.course_rad - mission.course_rad))
        change_mps = abs(guidance.airspeed_mps - mission.airspeed_mps)
        return turn_rad < self.params.course_tolerance_rad and change_mps < self.params.speed_tolerance_mps


def _through_air_mps(mission: Guidance, wind_mps: Vec2) -> Vec2:
    """The air velocity (north, east) that makes the course good in the wind."""
    course_rad = mission.course_rad
    across_mps = wind_mps[1] * math.cos(course_rad) - wind_mps[0] * math.sin(course_rad)
    crab_rad = math.asin(min(max(across_mps / mission.airspeed_mps, -1.0), 1.0))
    heading_rad = course_rad - crab_rad
    return mission.airspeed_mps * math.cos(heading_rad), mission.airspeed_mps * math.sin(heading_rad)
