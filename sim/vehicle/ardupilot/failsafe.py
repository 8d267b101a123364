"""ArduPlane's failsafe after the loss of the radio control: short, then long."""

from sim.vehicle.ardupilot.flight import ArduPlaneFlight
from sim.vehicle.ardupilot.modes import PILOTED, Mode
from sim.vehicle.outputs import WARNING, Text

# FS_SHORT_ACTN
_UNLESS_NAVIGATING, _DISABLED = 0, 3
_CONTINUE = 0  # FS_LONG_ACTN
_NAVIGATING = frozenset({Mode.AUTO, Mode.GUIDED, Mode.LOITER, Mode.AVOID_ADSB})


class RadioFailsafe:
    """Circles after a short loss, and restores the mode before, GUIDED too; returns home after a long one.

    As ArduPlane 4.8-dev does (`failsafe_short_on_event`). The mode is restored only if it is still CIRCLE.
    """

    def __init__(self, flight: ArduPlaneFlight) -> None:
        self._flight = flight
        self._lost_at_s: float | None = None
        self._before: Mode | None = None
        self._is_short = self._is_long = False

    def lose(self, lost: bool) -> None:
        """Lose the radio control, or regain it."""
        if lost:
            self._lost_at_s = self._flight.flown_s if self._lost_at_s is None else self._lost_at_s
            return
        self._lost_at_s = None
        if self._is_short or self._is_long:
            self._clear()

    def step(self) -> None:
        """Act once the loss has lasted long enough."""
        flight, values = self._flight, self._flight.parameters
        if self._lost_at_s is None or flight.on_ground:
            return
        lost_s = flight.flown_s - self._lost_at_s
        enabled = values["FS_SHORT_ACTN"] != _DISABLED
        if enabled and not self._is_short and lost_s >= values["FS_SHORT_TIMEOUT"]:
            self._is_short = flight.in_trouble = True
            self._circle()
        if not self._is_long and lost_s >= values["FS_LONG_TIMEOUT"]:
            self._is_long = flight.in_trouble = True
            self._before = None
            if values["FS_LONG_ACTN"] != _CONTINUE or flight.mode not in _NAVIGATING:
                self._change(Mode.RTL)

    def _circle(self) -> None:
        mode, action = self._flight.mode, self._flight.parameters["FS_SHORT_ACTN"]
        navigates = mode in _NAVIGATING
        if mode in PILOTED or (navigates and action != _UNLESS_NAVIGATING):
            self._before = mode
            self._change(Mode.CIRCLE)

    def _change(self, mode: Mode) -> None:
        self._flight.events.append(Text(WARNING, f"RC Failsafe: switched to {mode.name}"))
        self._flight.set_mode(mode)

    def _clear(self) -> None:
        flight, before = self._flight, self._before
        self._is_short = self._is_long = flight.in_trouble = False
        self._before = None
        flight.events.append(Text(WARNING, "RC Failsafe Cleared"))
        if before is not None and flight.mode is Mode.CIRCLE:
            flight.set_mode(before)
