"""The reports that we sent on: a router, the autopilot or a station may send them back to us."""

from collections import deque
from typing import Final

from companion.gcs.made_up_addresses import is_made_up
from companion.model import TrafficReport

# ArduPilot sends a report again until it is 5 s old; later by a slow network.
_REMEMBERED_S: Final = 15.0
_MOST_OF_ONE: Final = 16
# PX4 sends back what it has converted to radians and single precision.
_SAME_DEG, _SAME_M = 4e-7, 0.1


class SentReports:
    """What was sent in the last 15 s, by address."""

    def __init__(self) -> None:
        self._sent: dict[int, deque[tuple[float, TrafficReport]]] = {}

    def note(self, report: TrafficReport, now_s: float) -> None:
        """Remember a report that is sent now."""
        sent = self._sent.setdefault(report.icao or 0, deque(maxlen=_MOST_OF_ONE))
        sent.append((now_s, report))

    def forget_old(self, now_s: float) -> None:
        """Forget what was sent too long ago to come back."""
        old = [address for address, sent in self._sent.items() if _is_old(sent, now_s)]
        for address in old:
            del self._sent[address]

    def has(self, report: TrafficReport, now_s: float) -> bool:
        """Whether a report is one of these, from any sender; with a made-up address it always is."""
        sent = self._sent.get(report.icao or 0)
        if not sent or _is_old(sent, now_s):
            return False
        return is_made_up(report.icao or 0) or any(_is_same(one, report) for _, one in sent)


def _is_old(sent: deque[tuple[float, TrafficReport]], now_s: float) -> bool:
    return now_s - sent[-1][0] > _REMEMBERED_S


def _is_same(one: TrafficReport, other: TrafficReport) -> bool:
    return (
        _within(one.lat_deg, other.lat_deg, _SAME_DEG)
        and _within(one.lon_deg, other.lon_deg, _SAME_DEG)
        and _within(one.altitude_m, other.altitude_m, _SAME_M)
    )


def _within(one: float | None, other: float | None, tolerance: float) -> bool:
    return one is not None and other is not None and abs(one - other) < tolerance
