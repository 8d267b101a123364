"""One flight of a scenario, flown once in a process and read by several tests."""

from dataclasses import dataclass
from functools import cache

from companion.engine import Engine, Transmit
from companion.mavlink.dialect import Message
from companion.model import Guidance
from sim.closed_loop import ClosedLoop, Flight
from sim.scenario import Autopilot, Scenario, load_scenario
from sim.vehicle import Truth
from tests.support.short_scenario import shorter
from tests.support.thorough import THOROUGH

_ALIKE = ("crossing-left", "crossing-right", "climbing", "overtaken")
MOMENT_S = 0.1
_STEPS_A_MOMENT = 2


@dataclass(frozen=True)
class Moment:
    """A tenth of a second: the texts sent in it, and at its end what is decided and flown."""

    texts: list[Message]
    guidance: Guidance | None
    flying: bool
    truth: Truth


@dataclass(frozen=True)
class ScenarioFlight:
    """A flight to the end of its mission, and all its moments."""

    flight: Flight
    moments: list[Moment]


def flown_scenario(name: str) -> Scenario:
    """The scenario as it comes with the project; of those alike, a shorter flight in `make test`."""
    return shorter(name) if name in _ALIKE and not THOROUGH else load_scenario(name)


class _Recorded(ClosedLoop):
    """Keeps every STATUSTEXT until it is read."""

    def __init__(self, name: str, autopilot: Autopilot) -> None:
        self.texts: list[Message] = []
        super().__init__(flown_scenario(name), Engine(), autopilot=autopilot)

    def _transmit(self, time_us: int, effect: Transmit) -> None:
        if effect.message.get_type() == "STATUSTEXT":
            self.texts.append(effect.message)
        super()._transmit(time_us, effect)


@cache
def scenario_flight(name: str, autopilot: Autopilot) -> ScenarioFlight:
    """The flight of a scenario, to the end of its mission or of its time."""
    loop, moments = _Recorded(name, autopilot), []
    steps = 0

    def note(_loop: ClosedLoop, _time_s: float) -> None:
        nonlocal steps
        steps += 1
        if steps % _STEPS_A_MOMENT:
            return
        assert loop.engine is not None
        texts, loop.texts = loop.texts, []
        engine = loop.engine
        moments.append(Moment(texts, engine.decision.guidance, engine.supervisor.flying, loop.flight.truth))

    flight = loop.run(on_step=note)
    return ScenarioFlight(flight, moments)
