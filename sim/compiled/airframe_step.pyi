"""Types of `airframe_step.py`, whose own annotations are C types."""

import numpy as np
from numpy.typing import NDArray

from companion.model import Vec2, Vec3
from sim.airframe import Airframe

L1_TIME_S: float

class FixedWing:
    airframe: Airframe
    north_m: float
    east_m: float
    altitude_m: float
    wind_north_mps: float
    wind_east_mps: float
    airspeed_mps: float
    heading_rad: float
    bank_rad: float
    climb_mps: float
    airspeed_command_mps: float
    true_per_indicated: float
    def __init__(
        self,
        position_m: Vec3 = ...,
        course_rad: float = ...,
        airspeed_mps: float = ...,
        *,
        wind_mps: Vec2 = ...,
        airframe: Airframe | None = ...,
    ) -> None: ...
    @property
    def position_m(self) -> Vec3: ...
    @property
    def velocity_mps(self) -> Vec3: ...
    @property
    def ground_velocity_mps(self) -> Vec2: ...
    @property
    def course_rad(self) -> float: ...
    @property
    def ground_speed_mps(self) -> float: ...
    @property
    def wind_mps(self) -> Vec2: ...
    @property
    def turn_rate_rps(self) -> float: ...
    def hold_bank(self, bank_rad: float) -> None: ...
    def hold_course(self, course_rad: float, bank_limit_rad: float | None = None) -> None: ...
    def hold_altitude(self, altitude_m: float, rate_mps: float = ...) -> None: ...
    def hold_climb(self, climb_mps: float) -> None: ...
    def hold_airspeed(self, airspeed_mps: float) -> None: ...
    def step(self, dt_s: float) -> None: ...
    def fly(self, steps: int, dt_s: float, line: tuple[Vec2, Vec2] | None = None) -> NDArray[np.float64]: ...

def line_bank_rad(position_m: Vec2, velocity_mps: Vec2, start_m: Vec2, end_m: Vec2) -> float: ...
