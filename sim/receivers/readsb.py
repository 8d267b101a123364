"""A simulated readsb that serves aircraft.json: the format of `companion.sources.readsb`."""

import json
import math
from typing import Any, Final

from companion.geodesy import course_deg
from companion.units import FOOT_M, KNOT_MPS
from sim.receivers.encoder import ReceiverEncoder, Reception, Transmission

_LISTED_S: Final = 60.0
_CATEGORY_SETS: Final = "ABCD"


class ReadsbEncoder(ReceiverEncoder):
    """Encodes all aircraft of the last minute, each with the age of its position."""

    format = "readsb"

    def __init__(self) -> None:
        self._heard: dict[int, tuple[float, Transmission]] = {}
        self._messages = 0

    def encode(self, reception: Reception) -> list[bytes]:
        now_s = reception.time_s
        self._heard |= {aircraft.icao: (now_s - aircraft.age_s, aircraft) for aircraft in reception.heard}
        self._heard = {icao: item for icao, item in self._heard.items() if now_s - item[0] <= _LISTED_S}
        self._messages += len(reception.heard)
        entries = [_entry(aircraft, now_s - heard_s) for heard_s, aircraft in self._heard.values()]
        document = {"now": round(now_s, 3), "messages": self._messages, "aircraft": entries}
        return [json.dumps(document).encode("ascii")]


def _entry(aircraft: Transmission, age_s: float) -> dict[str, Any]:
    """One aircraft, with the keys and the rounding of readsb."""
    north_mps, east_mps, down_mps = aircraft.velocity_mps
    category_set, category = divmod(aircraft.category, 8)
    entry: dict[str, Any] = {
        "hex": f"{aircraft.icao:06x}",
        "type": "adsb_icao",
        "flight": f"{aircraft.callsign[:8]:8}",
        "alt_baro": "ground" if aircraft.on_ground else _feet(aircraft.pressure_altitude_m),
        "alt_geom": _feet(aircraft.place.altitude_m),
        "gs": round(math.hypot(north_mps, east_mps) / KNOT_MPS, 1),
        "track": round(course_deg(math.atan2(east_mps, north_mps)), 2) % 360.0,
        "baro_rate": 64 * round(-down_mps / FOOT_M * 60.0 / 64),
        "category": f"{_CATEGORY_SETS[category_set]}{category}",
        "lat": round(aircraft.place.lat_deg, 6),
        "lon": round(aircraft.place.lon_deg, 6),
        "nic": aircraft.nic,
        "seen_pos": round(age_s, 3),
        "version": 2,
        "nac_p": aircraft.nacp,
        "nac_v": aircraft.nacv,
        "sil": aircraft.sil,
        "sil_type": "perhour",
        "mlat": [],
        "tisb": [],
        "messages": 1,
        "seen": round(age_s, 1),
        "rssi": -20.0,
    }
    return entry


def _feet(altitude_m: float) -> int:
    """An altitude in the steps of a transponder."""
    return 25 * round(altitude_m / FOOT_M / 25)
