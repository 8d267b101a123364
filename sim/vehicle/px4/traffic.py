"""PX4 and ADS-B traffic: reports echoed once to every channel, and its own avoidance (NAV_TRAFF_*)."""

from collections import deque
from collections.abc import Iterable

from companion.mavlink.dialect import Message
from sim.vehicle.outputs import CRITICAL, Text
from sim.vehicle.px4.flight import Px4Flight
from sim.vehicle.px4.modes import Px4Mode
from sim.vehicle.traffic import HeardTraffic, copy_of

_QUEUED = 16
_TRAFFIC_ACTIONS = {2: Px4Mode.RETURN, 3: Px4Mode.LAND, 4: Px4Mode.HOLD}  # NAV_TRAFF_AVOID


class EchoedTraffic:
    """A queue of reports for each channel, the sender's included; a full queue drops its oldest report."""

    def __init__(self) -> None:
        self._queues: dict[int, deque[Message]] = {}

    def receive(self, report: Message, channels: Iterable[int]) -> None:
        """Queue a report for all channels."""
        for channel in channels:
            self._queues.setdefault(channel, deque(maxlen=_QUEUED)).append(copy_of(report))

    def take(self, channel: int) -> list[Message]:
        """The reports to send on a channel now; they leave the queue."""
        queue = self._queues.get(channel, deque())
        reports = list(queue)
        queue.clear()
        return reports

    def clear(self) -> None:
        """Delete everything, as after a reboot."""
        self._queues.clear()


_CLIMB_ASSUMED_MPS = 10.0  # DAA_DFLT_VEL, of the other aircraft
# DAA_LVL_*_ACT of 1.18, from the mildest action to the most severe, and the modes that rank with each.
_DAA_ACTIONS = {2: Px4Mode.RETURN, 3: Px4Mode.LAND, 4: Px4Mode.HOLD}
_SEVERITY = {Px4Mode.HOLD: 1, Px4Mode.RETURN: 2, Px4Mode.LAND: 3}
_OBEYING = frozenset({Px4Mode.MISSION, Px4Mode.TAKEOFF, Px4Mode.GUIDED_COURSE, *_SEVERITY})


class Px4Avoidance:
    """NAV_TRAFF_AVOID up to 1.17: 1 only warns; higher values change the mode, from OFFBOARD too."""

    def __init__(self, flight: Px4Flight, heard: HeardTraffic) -> None:
        self._flight = flight
        self._heard = heard
        self._was_near = False

    def step(self, now_s: float) -> None:
        """Check the traffic; warn and act once when it comes near."""
        flight, values = self._flight, self._flight.parameters
        wanted = int(values["NAV_TRAFF_AVOID"])
        near = not flight.on_ground and wanted > 0
        near = near and self._heard.is_within(
            flight.place, values["NAV_TRAFF_A_HOR"], values["NAV_TRAFF_A_VER"], now_s
        )
        if near and not self._was_near:
            flight.events.append(Text(CRITICAL, "Traffic alert"))
            if wanted in _TRAFFIC_ACTIONS:
                flight.set_mode(_TRAFFIC_ACTIONS[wanted])
        self._was_near = near


class DetectAndAvoid:
    """Detect-and-avoid of 1.18 after ASTM F3442: four levels, each with its action; never from OFFBOARD.

    Critical and high are cylinders of both aircraft together; medium and low are the same ones, extended by
    the way of both in the alert time. Flown in the simulation of the main branch, not in release 1.18.
    """

    def __init__(self, flight: Px4Flight, heard: HeardTraffic) -> None:
        self._flight = flight
        self._heard = heard
        self._level = 0

    def step(self, now_s: float) -> None:
        """Check the traffic; warn and act when a higher level is reached."""
        level = self._present_level(now_s)
        if level > self._level:
            self._flight.events.append(Text(CRITICAL, "Traffic alert"))
            self._act(level)
        self._level = level

    def _present_level(self, now_s: float) -> int:
        """4 is critical, 3 high, 2 medium, 1 low, 0 none."""
        flight, values = self._flight, self._flight.parameters
        if flight.on_ground or values["DAA_EN"] < 1.0:
            return 0
        here, ground_mps = flight.place, flight.ground_speed_mps
        levels = (("CRIT", None), ("HIGH", None), ("CRIT", "MED"), ("HIGH", "LOW"))
        for level, (size, latency) in zip((4, 3, 2, 1), levels, strict=True):
            radius_m, height_m = 2.0 * values[f"DAA_LVL_{size}_RAD"], 2.0 * values[f"DAA_LVL_{size}_HGT"]
            ahead_s = 0.0 if latency is None else values[f"DAA_LVL_{latency}_TIME"]
            own_m = ahead_s * ground_mps
            above_m = height_m + ahead_s * (abs(flight.aircraft.climb_mps) + _CLIMB_ASSUMED_MPS)
            if self._heard.is_within(here, radius_m + own_m, above_m, now_s, ahead_s=ahead_s):
                return level
        return 0

    def _act(self, level: int) -> None:
        """Change to the mode of the level's action, if that ranks higher than the present one."""
        names = {4: ("CRIT", "HIGH", "MED", "LOW"), 3: ("HIGH", "LOW"), 2: ("MED", "LOW"), 1: ("LOW",)}[level]
        actions = [int(self._flight.parameters[f"DAA_LVL_{name}_ACT"]) for name in names]
        mode = _DAA_ACTIONS.get(next((action for action in actions if action), 0))
        present = self._flight.mode
        if mode is not None and present in _OBEYING and _SEVERITY[mode] > _SEVERITY.get(present, 0):
            self._flight.set_mode(mode)
