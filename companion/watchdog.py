"""Tells the service manager that we are ready, alive or stopping, by systemd's protocol (sd_notify)."""

import contextlib
import os
import socket
from collections.abc import Mapping

_LIVES_PER_PERIOD = 2  # as sd_watchdog_enabled(3) recommends


class Watchdog:
    """Does nothing unless `environment` has NOTIFY_SOCKET, and never raises nor waits.

    That we are alive is said only with ticks to show for it: a service that runs without deciding anything is
    as good as dead, and is better started anew.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._manager = environment.get("NOTIFY_SOCKET", "")
        if self._manager.startswith("@"):  # the abstract namespace
            self._manager = "\0" + self._manager[1:]
        self._period_s = _watchdog_s(environment) / _LIVES_PER_PERIOD
        self._ticks = 0
        self._told_s = -self._period_s

    def ready(self) -> None:
        """The start is over."""
        self._notify("READY=1")

    def stopping(self) -> None:
        """The aircraft is being given back."""
        self._notify("STOPPING=1")

    def alive(self, ticks: int, now_s: float) -> None:
        """So many ticks were made until now, on any clock that only runs forwards; call it often."""
        if self._period_s > 0.0 and ticks > self._ticks and now_s - self._told_s >= self._period_s:
            self._ticks, self._told_s = ticks, now_s
            self._notify("WATCHDOG=1")

    def _notify(self, state: str) -> None:
        if not self._manager:
            return
        with (
            contextlib.suppress(OSError),  # a manager that went away is no reason to stop flying
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as notifier,
        ):
            notifier.sendto(state.encode(), self._manager)


def _watchdog_s(environment: Mapping[str, str]) -> float:
    """How long we may be silent; 0 if nobody watches."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return 0.0
    period_us = environment.get("WATCHDOG_USEC", "")
    return int(period_us) / 1e6 if period_us.isdecimal() else 0.0
