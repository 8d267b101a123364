"""A simulated receiver that sends SBS-1 lines, as dump1090 does: the format of `companion.sources.sbs`."""

import math
from datetime import UTC, datetime
from typing import Final

from companion.geodesy import course_deg
from companion.units import FOOT_M, KNOT_MPS
from sim.receivers.encoder import ReceiverEncoder, Reception, Transmission

_IDENTIFICATION_S: Final = 5.0
_CALLSIGN, _SURFACE_POSITION, _AIRBORNE_POSITION, _VELOCITY = 1, 2, 3, 4


class SbsEncoder(ReceiverEncoder):
    """Encodes a line for each message: velocity, position, and now and then the callsign."""

    format = "sbs"

    def __init__(self) -> None:
        self._identified_s: dict[int, float] = {}

    def encode(self, reception: Reception) -> list[bytes]:
        lines = [
            _line(kind, aircraft, reception.time_s)
            for aircraft in reception.heard
            for kind in self._kinds(aircraft, reception.time_s)
        ]
        return ["".join(lines).encode("ascii")] if lines else []

    def _kinds(self, aircraft: Transmission, time_s: float) -> list[int]:
        kinds = [_SURFACE_POSITION] if aircraft.on_ground else [_VELOCITY, _AIRBORNE_POSITION]
        if time_s - self._identified_s.get(aircraft.icao, -math.inf) >= _IDENTIFICATION_S:
            self._identified_s[aircraft.icao] = time_s
            kinds.insert(0, _CALLSIGN)
        return kinds


def _line(kind: int, aircraft: Transmission, time_s: float) -> str:
    """One line: an empty field for what this kind of message does not have."""
    generated, logged = _moment(time_s - aircraft.age_s), _moment(time_s)
    north_mps, east_mps, down_mps = aircraft.velocity_mps
    has_position = kind in (_SURFACE_POSITION, _AIRBORNE_POSITION)
    fields = dict.fromkeys(range(11, 23), "")
    if kind == _CALLSIGN:
        fields[11] = f"{aircraft.callsign[:8]:8}"
    if kind == _AIRBORNE_POSITION:
        fields[12] = f"{25 * round(aircraft.pressure_altitude_m / FOOT_M / 25)}"
    if kind in (_VELOCITY, _SURFACE_POSITION):
        fields[13] = f"{math.hypot(north_mps, east_mps) / KNOT_MPS:.0f}"
        fields[14] = f"{course_deg(math.atan2(east_mps, north_mps)):.0f}"
    if kind == _VELOCITY:
        fields[17] = f"{64 * round(-down_mps / FOOT_M * 60.0 / 64)}"
    if has_position:
        fields[15], fields[16] = f"{aircraft.place.lat_deg:.6f}", f"{aircraft.place.lon_deg:.6f}"
        fields[22] = "-1" if aircraft.on_ground else "0"
    content = ",".join(fields.values())
    return f"MSG,{kind},1,1,{aircraft.icao:06X},1,{generated},{logged},{content}\r\n"


def _moment(time_s: float) -> str:
    moment = datetime.fromtimestamp(time_s, UTC)
    return f"{moment:%Y/%m/%d,%H:%M:%S}.{moment.microsecond // 1000:03d}"
