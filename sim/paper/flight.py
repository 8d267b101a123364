"""Flies a scene: each UAV decides once a step with its own avoider and moves as a fixed wing."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from companion.avoidance import Avoider
from companion.geodesy import wrap_pi
from companion.model import Decision, Goal, Layer, Member, Ownship, Track, TrafficKind, Vec2
from companion.units import STANDARD_GRAVITY_MPS2
from sim.dynamics import Airframe, FixedWing
from sim.paper.methods import Method, envelope_of
from sim.paper.scene import Scale, Scene, Sphere, Uav
from sim.path import distance_to_path_m

Array = NDArray[np.float64]

_SUBSTEPS = 10
LAYERS = (Layer.CLEAR, Layer.OUTER, Layer.INNER)
# Multiple of the straight path after which a flight is given up.
_LONGEST_PATH = 3.0


@dataclass(frozen=True, slots=True)
class UavFlight:
    """One aircraft's flight in the paper's lengths; T samples, one a step, the first at the start.

    `position` (T, 2); `course` (T,), anticlockwise from the x axis as in eq. 1 [rad]; `speed` (T,), lengths
    per step; `turn_command` (T,), eq. 10's commanded change of course [rad]; `speed_command` (T,), eq. 12's
    change against the mission's speed; `layer` (T,), indices into `LAYERS`; `height` (T,). It does not move
    after `arrived_step`.
    """

    uav: Uav
    position: Array
    height: Array
    course: Array
    speed: Array
    turn_command: Array
    speed_command: Array
    layer: NDArray[np.intp]
    arrived_step: int | None

    @property
    def steps(self) -> int:
        """Number of steps flown."""
        return len(self.position) - 1 if self.arrived_step is None else self.arrived_step


@dataclass(frozen=True, slots=True)
class Flight:
    """The flights of all UAVs, and the obstacle positions (T, M, 2)."""

    scene: Scene
    method: Method
    uavs: tuple[UavFlight, ...]
    obstacles: Array

    @property
    def arrived(self) -> bool:
        """True if every UAV reached its goal."""
        return all(one.arrived_step is not None for one in self.uavs)

    @property
    def steps(self) -> int:
        """Steps until the last arrival, or until the flight was given up."""
        return max(one.steps for one in self.uavs)


@dataclass
class _Pilot:
    """One UAV in flight: its aircraft, its avoider, and the samples so far."""

    scene: Scene
    uav: Uav
    aircraft: FixedWing
    avoider: Avoider | None
    rows: list[tuple[float, ...]] = field(default_factory=list)
    arrived_step: int | None = None

    @property
    def scale(self) -> Scale:
        return self.scene.scale

    @property
    def point(self) -> Vec2:
        return self.scale.point(self.aircraft.position_m)

    @property
    def cruise_mps(self) -> float:
        return self.scale.speed_mps(self.uav.step)

    def ownship(self, now_s: float) -> Ownship:
        plane = self.aircraft
        return Ownship(
            now_s, plane.position_m, plane.velocity_mps, plane.airspeed_mps, plane.heading_rad, (0.0, 0.0)
        )

    def track(self, now_s: float) -> Track:
        """The track for the other UAVs: a sphere of two UAV radii (def. 2) around it."""
        around_m = 2.0 * self.scene.uav_radius * self.scale.unit_m
        return Track(
            self.uav.id,
            now_s,
            self.aircraft.position_m,
            self.aircraft.velocity_mps,
            kind=TrafficKind.UAV,
            protected_horizontal_m=around_m,
            protected_vertical_m=around_m,
            member=self._member,
        )

    @property
    def _member(self) -> Member | None:
        return None if self.avoider is None else self.avoider.member(self.ownship(0.0), self.goal)

    @property
    def goal(self) -> Goal:
        """The goal as a position and the cruise speed."""
        place_m = self.scale.place_m(self.uav.goal)
        return Goal(position_m=place_m, airspeed_mps=self.cruise_mps, is_end=True)

    def decide(self, now_s: float, tracks: Sequence[Track]) -> Decision:
        if self.avoider is None:
            return Decision(Layer.CLEAR)
        return self.avoider.decide(now_s, self.ownship(now_s), tracks, self.goal)

    def command(self, decision: Decision) -> None:
        """Command the guidance, or the course straight to the goal."""
        plane, guidance = self.aircraft, decision.guidance
        north_m, east_m, down_m = self.scale.place_m(self.uav.goal)
        course_rad = math.atan2(east_m - plane.east_m, north_m - plane.north_m)
        speed_mps, altitude_m = self.cruise_mps, -down_m
        if guidance is not None:
            course_rad, speed_mps = guidance.course_rad, guidance.airspeed_mps
            altitude_m = guidance.altitude_m
        self._note(course_rad, speed_mps, decision.layer)
        plane.hold_course(course_rad, self._bank_limit_rad())
        plane.hold_airspeed(speed_mps)
        plane.hold_altitude(altitude_m)

    def _bank_limit_rad(self) -> float:
        """The bank within the limits of bank and turn rate at the present speed."""
        envelope, speed_mps = envelope_of(self.scene, self.uav), self.aircraft.airspeed_mps
        return math.atan(envelope.turn_rate_radps(speed_mps) * speed_mps / STANDARD_GRAVITY_MPS2)

    def rest(self) -> None:
        """Record a step after the arrival."""
        self._note(self.aircraft.course_rad, self.cruise_mps, Layer.CLEAR)

    def _note(self, course_rad: float, speed_mps: float, layer: Layer) -> None:
        plane, per_step = self.aircraft, self.scene.scale.speed_mps(1.0)
        self.rows.append(
            (
                *self.point,
                plane.altitude_m / self.scene.unit_m,
                wrap_pi(math.pi / 2.0 - plane.course_rad),
                plane.ground_speed_mps / per_step,
                -wrap_pi(course_rad - plane.course_rad),
                (speed_mps - self.cruise_mps) / per_step,
                LAYERS.index(layer),
            )
        )

    def move(self, step: int) -> None:
        """Fly one step; the UAV arrives if the step passes the goal within the arrival radius."""
        before = self.point
        for _ in range(_SUBSTEPS):
            self.aircraft.step(self.scene.step_s / _SUBSTEPS)
        if distance_to_path_m(self.uav.goal, (before, self.point)) <= self.scene.arrival_radius:
            self.arrived_step = step

    def flight(self) -> UavFlight:
        table = np.array(self.rows)
        return UavFlight(
            self.uav,
            table[:, :2],
            table[:, 2],
            table[:, 3],
            table[:, 4],
            table[:, 5],
            table[:, 6],
            table[:, 7].astype(np.intp),
            self.arrived_step,
        )


def fly(scene: Scene, method: Method, on_step: Callable[[int], None] = lambda _: None) -> Flight:
    """Fly a scene until every UAV has arrived, or for three times the straight path."""
    pilots = [_pilot(scene, uav, method) for uav in scene.uavs]
    steps = math.ceil(_LONGEST_PATH * scene.straight_steps)
    for step in range(steps + 1):
        now_s = step * scene.step_s
        flying = [pilot for pilot in pilots if pilot.arrived_step is None]
        seen = [pilot.track(now_s) for pilot in flying]
        standing = [obstacle_track(scene, sphere, step) for sphere in scene.obstacles]
        # All decide on the same state before any of them moves.
        decisions = [
            pilot.decide(now_s, [*standing, *(t for t in seen if t.track_id != pilot.uav.id)])
            for pilot in flying
        ]
        for pilot, decision in zip(flying, decisions, strict=True):
            pilot.command(decision)
        for pilot in pilots:
            if pilot not in flying:
                pilot.rest()
        if not flying or step == steps:
            break
        for pilot in flying:
            pilot.move(step + 1)
        on_step(step + 1)
    flown = tuple(pilot.flight() for pilot in pilots)
    return Flight(scene, method, flown, _obstacle_places(scene, len(flown[0].position)))


def obstacle_track(scene: Scene, sphere: Sphere, step: int) -> Track:
    """An obstacle as a track; its protected radius is R_b plus the UAV's radius (def. 4)."""
    around_m = (sphere.radius + scene.uav_radius) * scene.unit_m
    return Track(
        sphere.id,
        step * scene.step_s,
        scene.scale.place_m(sphere.centre(step)),
        scene.scale.velocity_mps(sphere.velocity),
        kind=TrafficKind.UAV,
        protected_horizontal_m=around_m,
        protected_vertical_m=around_m,
    )


def _pilot(scene: Scene, uav: Uav, method: Method) -> _Pilot:
    scale, envelope = scene.scale, envelope_of(scene, uav)
    airframe = Airframe(
        bank_limit_rad=envelope.max_bank_rad,
        airspeed_min_mps=envelope.min_airspeed_mps,
        airspeed_max_mps=envelope.max_airspeed_mps,
        climb_limit_mps=envelope.max_climb_mps,
        sink_limit_mps=envelope.max_sink_mps,
    )
    course_rad = math.atan2(uav.goal[0] - uav.start[0], uav.goal[1] - uav.start[1])
    aircraft = FixedWing(scale.place_m(uav.start), course_rad, scale.speed_mps(uav.step), airframe=airframe)
    avoider = None if method.layers is None else Avoider(method.params(scene, uav))
    return _Pilot(scene, uav, aircraft, avoider)


def _obstacle_places(scene: Scene, samples: int) -> Array:
    if not scene.obstacles:
        return np.empty((samples, 0, 2))
    at = np.array([sphere.at for sphere in scene.obstacles])
    velocity = np.array([sphere.velocity for sphere in scene.obstacles])
    places: Array = at + np.arange(samples)[:, None, None] * velocity
    return places
