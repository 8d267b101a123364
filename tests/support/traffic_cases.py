"""Scenarios in which traffic is reported wrongly: reports are changed or added on their way to the engine."""

from collections.abc import Callable, Sequence

from companion.engine import Engine
from companion.mavlink.dialect import Message, mavlink
from companion.model import Track, Vec3
from sim.closed_loop import ClosedLoop
from sim.metrics import EncounterScore
from sim.receivers.mavlink import ADSB_RECEIVER, ALL_VALID, adsb_vehicle
from sim.scenario import Autopilot, Scenario
from tests.support.short_scenario import shorter

Reports = Sequence[Message]
Changed = Callable[["ReportedWrongly", Message], Reports]
Added = Callable[["ReportedWrongly", float], Reports]


def as_heard(_flight: "ReportedWrongly", message: Message) -> Reports:
    """The report as it is."""
    return [message]


def unheard(_flight: "ReportedWrongly", _message: Message) -> Reports:
    """No report."""
    return []


def none_added(_flight: "ReportedWrongly", _time_s: float) -> Reports:
    """No other report."""
    return []


class ReportedWrongly(ClosedLoop):
    """A flight; `change` makes reports of each ADSB_VEHICLE, `add` those at each time since the start."""

    def __init__(
        self,
        scenario: Scenario | str = "head-on",
        *,
        change: Changed = as_heard,
        add: Added = none_added,
        autopilot: Autopilot = "ardupilot",
    ) -> None:
        loaded = shorter(scenario) if isinstance(scenario, str) else scenario
        super().__init__(loaded, Engine(), autopilot=autopilot)
        self._change, self._add = change, add
        self.tracks: list[tuple[float, tuple[Track, ...]]] = []  # each second

    @property
    def time_s(self) -> float:
        """Time since the start."""
        return (self._now_us - self.start_us) / 1e6

    @property
    def own_m(self) -> Vec3:
        """Our true position."""
        return self.world.vehicle.truth.position_m

    @property
    def encounter(self) -> EncounterScore:
        """How the scenario's intruder was passed."""
        (encounter,) = self.flight.score.encounters.values()
        return encounter

    def _hear(self, message: Message) -> None:
        changed = self._change(self, message) if message.get_type() == "ADSB_VEHICLE" else [message]
        for one in changed:
            super()._hear(one)

    def _step(self) -> None:
        for message in self._add(self, self.time_s):
            ClosedLoop._hear(self, message)
        super()._step()
        if self.engine is not None and is_time_of(1.0, self.time_s):
            self.tracks.append((self.time_s, tuple(self.engine.snapshot(self._now_us / 1e6).tracks)))

    def report(
        self, icao: int, position_m: Vec3, velocity_mps: tuple[float, float], **fields: object
    ) -> Message:
        """An ADSB_VEHICLE of an aircraft here in the scenario's frame."""
        place, velocity = self.scenario.frame.to_geo(*position_m), (*velocity_mps, 0.0)
        flags = ALL_VALID & ~mavlink.ADSB_FLAGS_VALID_CALLSIGN
        return altered(adsb_vehicle(icao, "", place, velocity, flags=flags), **fields)


def altered(message: Message, **fields: object) -> Message:
    """An ADSB_VEHICLE with some fields changed."""
    values = {name: getattr(message, name) for name in message.get_fieldnames()}
    values["callsign"] = str(message.callsign).encode()
    return _sent(values | fields)


def is_time_of(period_s: float, time_s: float) -> bool:
    """Whether something that is done every `period_s` is due, at steps of 0.05 s."""
    return abs(time_s / period_s - round(time_s / period_s)) < 0.02 / period_s


def _sent(values: dict[str, object]) -> Message:
    message = mavlink.MAVLink_adsb_vehicle_message(**values)  # type: ignore[arg-type]
    header = message.get_header()
    header.srcSystem, header.srcComponent = ADSB_RECEIVER
    return message
