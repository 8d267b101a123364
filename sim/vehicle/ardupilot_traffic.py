"""The traffic list inside ArduPilot: keeps what a receiver reports and re-sends it, quirks included."""

import math
from dataclasses import dataclass

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.adsb import copy_of
from sim.vehicle.parameters import Parameters

_TIMEOUT_S = 5.0
_LIST_PERIOD_S = 1.0
# A report with any of these flags is forwarded, so one without a valid position or height goes out as well.
_ANY_OF = mavlink.ADSB_FLAGS_VALID_COORDS | mavlink.ADSB_FLAGS_VALID_ALTITUDE
_LARGEST_ICAO = 0xFF_FFFF
_FROM_RECEIVER = 1  # ADSB_TYPE


@dataclass(slots=True)
class _Entry:
    report: Message
    received_s: float
    channel: int


@dataclass(slots=True)
class _Round:
    """Where one channel is in telling the list."""

    index: int = 0
    started_s: float = -math.inf


class TrafficList:
    """Reports by ICAO address. One entry per message interval, the list at most once a second.

    The report goes out as it came in: `tslc` is not aged, for up to five seconds of silence.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._entries: dict[int, _Entry] = {}
        self._rounds: dict[int, _Round] = {}

    def receive(self, report: Message, here: GeoPoint, now_s: float, channel: int) -> None:
        """Take a report, or forget the aircraft when the report cannot be used."""
        if self._parameters["ADSB_TYPE"] != _FROM_RECEIVER:
            return
        icao = int(report.ICAO_address)
        own = int(self._parameters["ADSB_ICAO_ID"])  # 0, the default: own transponder comes back as traffic
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
            self._entries[icao] = _Entry(report, now_s, channel)

    def next_for(self, channel: int, now_s: float) -> Message | None:
        """What to tell a channel now; never what that channel itself reported."""
        self._forget_old(now_s)
        told = [e for e in self._entries.values() if e.channel != channel]
        if not told:
            return None
        turn = self._rounds.setdefault(channel, _Round())
        if turn.index >= len(told):
            if now_s - turn.started_s < _LIST_PERIOD_S:
                return None
            turn.started_s = now_s
            turn.index = 0
        report = told[turn.index].report
        turn.index += 1
        return copy_of(report)

    def clear(self) -> None:
        """Forget all, as after a reboot."""
        self._entries.clear()
        self._rounds.clear()

    def _forget_old(self, now_s: float) -> None:
        old = [icao for icao, e in self._entries.items() if now_s - e.received_s > _TIMEOUT_S]
        for icao in old:
            del self._entries[icao]

    def _out_of_range(self, report: Message, here: GeoPoint) -> bool:
        radius_m = self._parameters["ADSB_LIST_RADIUS"]
        there = GeoPoint(report.lat / 1e7, report.lon / 1e7, 0.0)
        north_m, east_m, _ = LocalFrame(here.lat_deg, here.lon_deg).to_ned_m(there)
        return radius_m > 0 and math.hypot(north_m, east_m) > radius_m
