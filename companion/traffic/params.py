"""Parameters of traffic tracking."""

import re
from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from companion.traffic.estimate_params import EstimateParams

Icao = Annotated[int, Ge(1), Le(0xFFFFFF)]
Forward = Literal["autopilot", "station", "off"]


@dataclass(frozen=True, slots=True)
class HeightParams:
    """Error of an altitude (one sigma) whose offset from mean sea level is unknown or old."""

    # While our own pressure altitude is unknown, a pressure altitude is taken as height above the sea. The
    # pressure at sea level is often 8 hPa off the standard's 1013.25, and 1 hPa is 8.3 m at low altitude.
    pressure_unknown_m: Annotated[float, Ge(0)] = 60.0
    # Our own pressure altitude counts as current for this time: 1 Hz with losses. After that its error grows,
    # faster than with a passing front (3 hPa an hour: 0.007 m/s), because silence indicates a fault.
    pressure_fresh_s: Annotated[float, Gt(0)] = 5.0
    pressure_stale_mps: Annotated[float, Ge(0)] = 0.5
    # Air 20 K warmer or colder than standard stretches altitudes by 7 %: the error of an old offset for each
    # metre that we have climbed or descended since.
    pressure_stretch: Annotated[float, Ge(0)] = 0.07
    # The geoid lies between 106 m below and 85 m above the ellipsoid; within 50 m of it over most land.
    geoid_unknown_m: Annotated[float, Ge(0)] = 50.0


@dataclass(frozen=True, slots=True)
class AssociationParams:
    """When reports of two sources are taken as one aircraft: how similar they must be, and for how long."""

    # Errors of two satellite receivers, and the lag of the estimates in a turn.
    horizontal_m: Annotated[float, Gt(0)] = 60.0
    # Difference between the delays of two sources; the gate is longer by the path flown in this time.
    delay_s: Annotated[float, Ge(0)] = 1.0
    # In addition to the uncertainty between the references of the two altitudes.
    vertical_m: Annotated[float, Gt(0)] = 40.0
    velocity_mps: Annotated[float, Gt(0)] = 6.0
    climb_mps: Annotated[float, Gt(0)] = 3.0
    merge_reports: Annotated[int, Ge(1)] = 4
    merge_after_s: Annotated[float, Ge(0)] = 4.0
    # Two merged targets are apart when they are outside a gate this many times as large.
    split_factor: Annotated[float, Gt(1)] = 2.5
    split_reports: Annotated[int, Ge(1)] = 3
    split_after_s: Annotated[float, Ge(0)] = 3.0


@dataclass(frozen=True, slots=True)
class EchoParams:
    """When a report is an echo of our own aircraft: how similar to our own motion, and for how long."""

    radius_m: Annotated[float, Gt(0)] = 30.0
    vertical_m: Annotated[float, Gt(0)] = 40.0
    # Velocities discriminate better than positions: receivers measure them to a few decimetres per second.
    velocity_mps: Annotated[float, Gt(0)] = 2.5
    climb_mps: Annotated[float, Gt(0)] = 2.0
    # Largest delay of a report: networks take seconds.
    delay_s: Annotated[float, Ge(0)] = 3.0
    reports: Annotated[int, Ge(1)] = 5
    after_s: Annotated[float, Ge(0)] = 5.0
    # An echo becomes traffic after this many reports outside a gate this many times as large.
    split_factor: Annotated[float, Gt(1)] = 2.0
    split_reports: Annotated[int, Ge(1)] = 2
    # A shadow repeats our track with a constant delay and a constant offset up to these: stations and
    # networks report us late, displaced and under addresses of their own.
    shadow_delay_s: Annotated[float, Ge(0)] = 10.0
    shadow_radius_m: Annotated[float, Ge(0)] = 300.0


@dataclass(frozen=True, slots=True)
class TrafficParams:
    """When traffic reports are accepted, and when tracks are dropped."""

    # A track is dropped after this time without a new measurement.
    stale_s: Annotated[float, Gt(0)] = 20.0
    # The same for point obstacles, which do not move.
    obstacle_stale_s: Annotated[float, Gt(0)] = 300.0
    # An altitude is extrapolated with its last climb for this time; after that the track has no altitude.
    altitude_hold_s: Annotated[float, Gt(0)] = 20.0
    # An identical report within this time is a repetition: ArduPilot re-sends for 5 s, plus latency.
    repeat_window_s: Annotated[float, Ge(0)] = 7.0
    # Up to this speed an aircraft may truly report the same position again after the window: a transponder's
    # resolution of 5 m is coarser than the drift of a hovering helicopter in that time.
    hovering_mps: Annotated[float, Ge(0)] = 2.0
    # A track in conflict, or one that will be near us on its present course, is extrapolated for this time.
    coast_s: Annotated[float, Gt(0)] = 120.0
    # Hypotheses of one key: an address that is reported in several places, or at several heights.
    hypotheses: Annotated[int, Ge(1), Le(8)] = 3
    # The operator is informed of traffic that is not avoided within this distance, or this time.
    near_m: Annotated[float, Ge(0)] = 5_000.0
    near_s: Annotated[float, Ge(0)] = 60.0
    # When there are more, the one that would reach us last is dropped; never one in conflict.
    max_tracks: Annotated[int, Ge(1)] = 2000
    # Addresses of our own transponder, which are received as traffic too. The autopilot's address is added.
    # An address that flies elsewhere is not ours.
    own_icao: frozenset[Icao] = frozenset()
    # The same for unmanned traffic management: our id in hexadecimal, as in UTM_GLOBAL_POSITION.
    own_uas_id: str | None = None
    # Traffic that others than the autopilot hear (receivers, other links) is sent on as ADSB_VEHICLE: on the
    # links of the autopilot, which passes it to its stations; on the others only ("station"); or not at all.
    forward: Forward = "autopilot"
    estimate: EstimateParams = field(default_factory=EstimateParams)
    heights: HeightParams = field(default_factory=HeightParams)
    association: AssociationParams = field(default_factory=AssociationParams)
    own_echo: EchoParams = field(default_factory=EchoParams)

    def __post_init__(self) -> None:
        if self.repeat_window_s >= self.stale_s:
            raise ValueError("repeat_window_s must be less than stale_s, or hovering traffic disappears")
        if self.own_uas_id is not None and not re.fullmatch("([0-9A-Fa-f]{2}){1,18}", self.own_uas_id):
            raise ValueError("own_uas_id must be up to 18 bytes in hexadecimal")
