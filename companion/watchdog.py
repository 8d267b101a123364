"""Reports to the service manager that the service is ready, alive or stopping (systemd's sd_notify)."""

import contextlib
import os
import socket
from collections.abc import Mapping

_NOTIFICATIONS_PER_PERIOD = 2  # as sd_watchdog_enabled(3) recommends


class Watchdog:
    """Does nothing unless `environment` has NOTIFY_SOCKET; never raises, never waits.

    "Alive" is sent only if ticks were made since the last time: a service that runs without deciding anything
    should be restarted.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._manager = environment.get("NOTIFY_SOCKET", "")
        if self._manager.startswith("@"):  # the abstract namespace
            self._manager = "\0" + self._manager[1:]
        self._period_s = _watchdog_s(environment) / _NOTIFICATIONS_PER_PERIOD
        self._ticks = 0
        self._notified_s = -self._period_s

    def ready(self) -> None:
        """Report that the service has started."""
        self._notify("READY=1")

    def stopping(self) -> None:
        """Report that the service is stopping: the aircraft is being given back."""
        self._notify("STOPPING=1")

    def alive(self, ticks: int, now_s: float) -> None:
        """Report that the service is alive; call it often. `ticks` so far, `now_s` of any monotonic clock."""
        if self._period_s > 0.0 and ticks > self._ticks and now_s - self._notified_s >= self._period_s:
            self._ticks, self._notified_s = ticks, now_s
            self._notify("WATCHDOG=1")

    def _notify(self, state: str) -> None:
        if not self._manager:
            return
        with (
            contextlib.suppress(OSError),  # flying goes on without the service manager
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as notifier,
        ):
            notifier.sendto(state.encode(), self._manager)


def _watchdog_s(environment: Mapping[str, str]) -> float:
    """How long the manager accepts silence [s]; 0 without a watchdog."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return 0.0
    period_us = environment.get("WATCHDOG_USEC", "")
    return int(period_us) / 1e6 if period_us.isdecimal() else 0.0
