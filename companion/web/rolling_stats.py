"""Statistics over the last seconds: frame rates, silence of links, the slowest ticks."""

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from companion.web.health import Health, LinkCount, ReceiverCount

_TICKS = 600  # a minute of ticks


class RollingStats:
    """Statistics of the healths added so far. Rates are over the last `over_s` seconds."""

    def __init__(self, clock_s: Callable[[], float] = time.monotonic, over_s: float = 5.0) -> None:
        self._clock_s = clock_s
        self._over_s = over_s
        self._health: deque[tuple[float, Health]] = deque()
        self._ticks_s: deque[float] = deque(maxlen=_TICKS)
        self._heard_s: dict[str, float] = {}

    def add(self, health: Health) -> None:
        """Add the health of the next snapshot."""
        now_s = self._clock_s()
        before = {} if not self._health else {link.address: link for link in self._health[-1][1].links}
        for link in health.links:
            known = before.get(link.address)
            if link.frames > (0 if known is None else known.frames):
                self._heard_s[link.address] = now_s
        self._health.append((now_s, health))
        while now_s - self._health[0][0] > self._over_s:
            self._health.popleft()
        self._ticks_s.append(health.tick_s)

    def tick_ms_p99(self) -> float | None:
        """99th percentile of the tick times in the last minute [ms]."""
        if not self._ticks_s:
            return None
        ordered = sorted(self._ticks_s)
        return round(1e3 * ordered[int(0.99 * (len(ordered) - 1))], 2)

    def links(self) -> list[dict[str, Any]]:
        """State of each link, with the keys of `links` in `state.md`."""
        if not self._health:
            return []
        (first_s, first), (last_s, last) = self._health[0], self._health[-1]
        before = {link.address: link for link in first.links}
        span_s = max(last_s - first_s, 0.1)
        return [self._link(link, before.get(link.address, link), span_s, last_s) for link in last.links]

    def receivers(self) -> list[dict[str, Any]]:
        """State of each receiver, with the keys of `receivers` in `state.md`."""
        if not self._health:
            return []
        (first_s, first), (last_s, last) = self._health[0], self._health[-1]
        before = {one.address: one for one in first.receivers}
        span_s = max(last_s - first_s, 0.1)
        return [_receiver(one, before.get(one.address, one), span_s) for one in last.receivers]

    def _link(self, link: LinkCount, before: LinkCount, span_s: float, now_s: float) -> dict[str, Any]:
        frames, lost = link.frames - before.frames, link.lost - before.lost
        heard_s = self._heard_s.get(link.address)
        silent_s = None if heard_s is None else max(now_s - heard_s, 0.0)
        return {
            "address": link.address,
            "connected": silent_s is not None and silent_s < self._over_s,
            "frames_per_s": round(frames / span_s, 1),
            "lost_share": round(lost / (frames + lost), 4) if frames + lost > 0 else 0.0,
            "dropped": link.dropped,
            "silent_s": None if silent_s is None else round(silent_s, 1),
        }


def _receiver(one: ReceiverCount, before: ReceiverCount, span_s: float) -> dict[str, Any]:
    return {
        "address": one.address,
        "title": one.title,
        "lacks": one.lacks,
        "problem": one.problem,
        "messages_per_s": round((one.messages - before.messages) / span_s, 1),
        "reports_per_s": round((one.reports - before.reports) / span_s, 1),
        "aircraft": one.aircraft,
        "bad": sum(count for _, count in one.bad),
        "dropped": one.dropped,
        "silent_s": round(one.silent_s, 1),
    }
