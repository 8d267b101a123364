"""ArduPlane and ADS-B traffic: the list that it re-sends, and its own avoidance (AVD_*)."""

import math
from dataclasses import dataclass

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.ardupilot.flight import ArduPlaneFlight
from sim.vehicle.ardupilot.modes import Mode
from sim.vehicle.outputs import CRITICAL, INFO, Text
from sim.vehicle.parameters import Parameters
from sim.vehicle.traffic import HeardTraffic, copy_of

_TIMEOUT_S = 5.0
_LIST_PERIOD_S = 1.0
# A report with either of these flags is forwarded, even if its position or height is invalid.
_ANY_OF = mavlink.ADSB_FLAGS_VALID_COORDS | mavlink.ADSB_FLAGS_VALID_ALTITUDE
_LARGEST_ICAO = 0xFF_FFFF
_FROM_RECEIVER = 1  # ADSB_TYPE

# AVD_F_ACTION: values up to _REPORT only report.
_REPORT, _RTL = 1.0, 5.0
_RESUME_PREVIOUS_MODE = 1.0  # AVD_F_RCVRY
_CLEAR_FOR_S = 5.0


@dataclass(slots=True)
class _Entry:
    report: Message
    received_s: float


@dataclass(slots=True)
class _Round:
    """The progress of one channel through the list."""

    index: int = 0
    started_s: float = -math.inf


class TrafficList:
    """Reports by ICAO address. One entry per message interval, the list at most once a second.

    A report is re-sent unchanged (`tslc` is not aged) until it is five seconds old, on every channel with a
    rate, also to where it came from (`AP_ADSB::send_adsb_vehicle`).
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._entries: dict[int, _Entry] = {}
        self._rounds: dict[int, _Round] = {}

    def receive(self, report: Message, here: GeoPoint, now_s: float) -> None:
        """Store a report; an unusable one removes its aircraft from the list."""
        if self._parameters["ADSB_TYPE"] != _FROM_RECEIVER:
            return
        icao = int(report.ICAO_address)
        # With the default 0, our own transponder's reports come back as traffic.
        own = int(self._parameters["ADSB_ICAO_ID"])
        unusable = (
            icao > _LARGEST_ICAO
            or (own != 0 and icao == own)
            or not report.flags & _ANY_OF
            or (report.lat == 0 and report.lon == 0)
            or self._out_of_range(report, here)
        )
        if unusable:
            self._entries.pop(icao, None)
        elif icao in self._entries or len(self._entries) < self._parameters["ADSB_LIST_MAX"]:
            self._entries[icao] = _Entry(report, now_s)

    def next_for(self, channel: int, now_s: float) -> Message | None:
        """The report to send on a channel now."""
        self._drop_old(now_s)
        entries = list(self._entries.values())
        if not entries:
            return None
        turn = self._rounds.setdefault(channel, _Round())
        if turn.index >= len(entries):
            if now_s - turn.started_s < _LIST_PERIOD_S:
                return None
            turn.started_s = now_s
            turn.index = 0
        report = entries[turn.index].report
        turn.index += 1
        return copy_of(report)

    def clear(self) -> None:
        """Delete everything, as after a reboot."""
        self._entries.clear()
        self._rounds.clear()

    def _drop_old(self, now_s: float) -> None:
        old = [icao for icao, e in self._entries.items() if now_s - e.received_s > _TIMEOUT_S]
        for icao in old:
            del self._entries[icao]

    def _out_of_range(self, report: Message, here: GeoPoint) -> bool:
        radius_m = self._parameters["ADSB_LIST_RADIUS"]
        there = GeoPoint(report.lat / 1e7, report.lon / 1e7, 0.0)
        north_m, east_m, _ = LocalFrame(here.lat_deg, here.lon_deg).to_ned_m(there)
        return radius_m > 0 and math.hypot(north_m, east_m) > radius_m


class ArduPlaneAvoidance:
    """Changes the mode when traffic is nearer than AVD_F_DIST_XY and AVD_F_DIST_Z, and back afterwards.

    Off by default (AVD_ENABLE).
    """

    def __init__(self, flight: ArduPlaneFlight, heard: HeardTraffic) -> None:
        self._flight = flight
        self._heard = heard
        self._before: Mode | None = None
        self._near_s = 0.0

    def step(self, now_s: float) -> None:
        """Check the traffic and change the mode if necessary."""
        flight, values = self._flight, self._flight.parameters
        if not values["AVD_ENABLE"] or values["AVD_F_ACTION"] <= _REPORT or flight.on_ground:
            return
        near = self._heard.is_within(flight.place, values["AVD_F_DIST_XY"], values["AVD_F_DIST_Z"], now_s)
        if near:
            self._near_s = now_s
        if near and self._before is None:
            self._act()
        elif self._before is not None and now_s - self._near_s > _CLEAR_FOR_S:
            self._recover(self._before)

    def _act(self) -> None:
        flight = self._flight
        self._before = flight.mode
        wanted = Mode.RTL if flight.parameters["AVD_F_ACTION"] == _RTL else Mode.AVOID_ADSB
        flight.events.append(Text(CRITICAL, "Avoid: Performing action: " + wanted.name))
        flight.set_mode(wanted)

    def _recover(self, before: Mode) -> None:
        flight = self._flight
        self._before = None
        flight.events.append(Text(INFO, "Avoid: clear"))
        if flight.parameters["AVD_F_RCVRY"] == _RESUME_PREVIOUS_MODE and flight.mode is Mode.AVOID_ADSB:
            flight.set_mode(before)
