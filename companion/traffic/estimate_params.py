"""Parameters of the filters of one target."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt


@dataclass(frozen=True, slots=True)
class EstimateParams:
    """Noise of reports, motion of aircraft, and limits beyond which a report is an outlier."""

    # Standard deviations of a report that states none, each axis.
    position_sigma_m: Annotated[float, Gt(0)] = 15.0
    velocity_sigma_mps: Annotated[float, Gt(0)] = 1.5
    altitude_sigma_m: Annotated[float, Gt(0)] = 8.0
    climb_sigma_mps: Annotated[float, Gt(0)] = 0.8
    # Random change of a velocity in one second (root of q). Larger values follow manoeuvres faster, smaller
    # ones smooth more. Across the path it is less in straight flight: the turn has a model of its own.
    manoeuvre_mps: Annotated[float, Gt(0)] = 2.0
    crosswise_mps: Annotated[float, Gt(0)] = 0.3
    climb_manoeuvre_mps: Annotated[float, Gt(0)] = 0.5
    # Rate of turn: standard deviation at its beginning, and random change in one second.
    turn_sigma_radps: Annotated[float, Gt(0)] = math.radians(2.0)
    turn_manoeuvre_radps: Annotated[float, Gt(0)] = math.radians(0.5)
    # Fastest traffic: bounds an unknown velocity after the first position, and what a report may state.
    max_speed_mps: Annotated[float, Gt(0)] = 400.0
    max_climb_mps: Annotated[float, Gt(0)] = 60.0
    # Hardest manoeuvre: 3 g covers aerobatics, 1 g any change of climb.
    max_acceleration_mps2: Annotated[float, Gt(0)] = 30.0
    max_vertical_acceleration_mps2: Annotated[float, Gt(0)] = 10.0
    # ADSB_VEHICLE.tslc counts whole seconds, so a report may be displaced along its path by one second.
    timestamp_error_s: Annotated[float, Ge(0)] = 1.0
