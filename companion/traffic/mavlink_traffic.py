"""Other MAVLink systems as traffic: their own positions, with the vehicle type from their heartbeats."""

import math

from companion.geodesy import wrap_two_pi
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Fact, Heartbeat, OwnPosition
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource, system_key

# A system lower above its home and slower than this is not flying: it is parked, or carried to its start.
_GROUND_HEIGHT_M, _GROUND_SPEED_MPS = 2.0, 3.0
_GROUND_STATIONS = frozenset({mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_ANTENNA_TRACKER})
_SURFACE_VEHICLES = frozenset(
    {mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_TYPE_SUBMARINE}
)


class MavlinkTraffic:
    """All MAVLink systems except our own, by system id."""

    def __init__(self) -> None:
        self._types: dict[int, int] = {}

    def observe(self, fact: Fact, now_s: float) -> TrafficReport | None:
        """Process a fact of another system; returns a report if the fact is its position."""
        match fact:
            case Heartbeat(autopilot=autopilot) if autopilot != mavlink.MAV_AUTOPILOT_INVALID:
                self._types[fact.sender.system_id] = fact.vehicle_type
            case Heartbeat():
                # The type of a component (a gimbal, a station) is used only until an autopilot is received.
                self._types.setdefault(fact.sender.system_id, fact.vehicle_type)
            case OwnPosition():
                return self._report(fact, now_s)
            case _:
                pass
        return None

    def _report(self, fact: OwnPosition, now_s: float) -> TrafficReport:
        north_mps, east_mps, down_mps = fact.velocity_mps
        speed_mps = math.hypot(north_mps, east_mps)
        system_id = fact.sender.system_id
        is_low = fact.height_above_home_m < _GROUND_HEIGHT_M
        vehicle_type = self._types.get(system_id)
        # A ground station may be in a moving car: then only its height shows that it is on the surface.
        on_surface = vehicle_type in _SURFACE_VEHICLES or (is_low and vehicle_type in _GROUND_STATIONS)
        return TrafficReport(
            source=TrafficSource.SYSTEM,
            key=system_key(system_id),
            time_s=now_s,
            lat_deg=fact.lat_deg,
            lon_deg=fact.lon_deg,
            altitude_m=fact.altitude_m,
            altitude_reference=AltitudeReference.SEA_LEVEL,
            course_rad=wrap_two_pi(math.atan2(east_mps, north_mps)),
            ground_speed_mps=speed_mps,
            climb_mps=-down_mps,
            callsign=f"system {system_id}",
            kind=TrafficKind.SURFACE_VEHICLE if on_surface else TrafficKind.UAV,
            airborne=not (is_low and speed_mps < _GROUND_SPEED_MPS),
        )
