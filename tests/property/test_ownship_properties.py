"""Queries over a bad link: in the end everything is known, and nothing wrong is known before."""

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.autopilots import ArduPlane
from companion.avoidance import Envelope
from companion.engine import AircraftLimits
from companion.mavlink.dialect import mavlink
from companion.ownship.autopilot_queries import AutopilotQueries
from tests.support.responder import AUTOPILOT, FENCE, MISSION, US, Item, Line, Responder, as_fact

settings.register_profile("queries", derandomize=True, deadline=None, max_examples=25)

PARAMETERS = {
    "ARSPD_FBW_MIN": 12.0,
    "AIRSPEED_MAX": 30.0,
    "ROLL_LIMIT_DEG": 45.0,
    "TECS_CLMB_MAX": 5.0,
    "FENCE_ENABLE": 1.0,
}


def route(items: int, lat_deg: float) -> list[Item]:
    return [Item(16, (lat_deg + sequence / 100.0, 8.0), 100.0) for sequence in range(items)]


class Exchange:
    """`AutopilotQueries` and a responder, with a bad line in each direction."""

    def __init__(self, responder: Responder, seed: int, loss: float) -> None:
        self.responder = responder
        self.queries = AutopilotQueries(Envelope(), AircraftLimits())
        self._adapter = ArduPlane(AUTOPILOT)
        self._up, self._down = Line(seed, loss=loss), Line(seed + 1, loss=loss)
        self.now_s = 0.0
        self.sent = 0

    def step(self) -> None:
        self.now_s += 0.1
        if round(self.now_s * 10) % 10 == 0:
            count = len(self.responder.lists[MISSION])
            self._up.put(mavlink.MAVLink_mission_current_message(0, count), self.now_s)
        for message in self._up.take(self.now_s):
            fact = as_fact(message)
            assert fact is not None
            self.queries.observe(fact, self._adapter, US, self.now_s)
        messages, _ = self.queries.tick(self._adapter, self.now_s)
        for message in messages:
            self.sent += 1
            self._down.put(message, self.now_s)
        for message in self._down.take(self.now_s):
            for answer in self.responder.answer(message):
                self._up.put(answer, self.now_s)

    def places(self) -> list[float] | None:
        mission = self.queries.mission
        return None if mission is None else [round(item.lat_deg or 0.0, 4) for item in mission.items]


def truth(responder: Responder) -> list[float]:
    return [round(item.place_deg[0], 4) for item in responder.lists[MISSION]]


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1, 0.3]), st.integers(0, 12))
@settings(settings.get_profile("queries"))
def test_everything_is_known_in_the_end_and_nothing_wrong_before(seed: int, loss: float, items: int) -> None:
    exchange = Exchange(Responder(dict(PARAMETERS), {MISSION: route(items, 47.0), FENCE: ()}), seed, loss)
    for _ in range(2_400):
        exchange.step()
        assert exchange.places() in (None, truth(exchange.responder))
        known = exchange.queries.parameters
        assert all(PARAMETERS[name] == value for name, value in known.items())
    assert exchange.places() == truth(exchange.responder)
    assert exchange.queries.parameters == PARAMETERS
    assert exchange.sent <= 5 * 240


@given(st.integers(0, 10_000), st.integers(0, 8), st.integers(0, 8), st.integers(0, 400))
@settings(settings.get_profile("queries"))
def test_a_mission_that_changes_during_the_download_is_known_in_the_end(
    seed: int, before: int, after: int, changed_at: int
) -> None:
    """The number of items always changes; otherwise only the next periodic reading would show the change."""
    after += after == before
    exchange = Exchange(Responder(dict(PARAMETERS), {MISSION: route(before, 47.0), FENCE: ()}), seed, 0.3)
    for step in range(2_400):
        if step == changed_at:
            exchange.responder.lists[MISSION] = route(after, 48.0)
        exchange.step()
    assert exchange.places() == truth(exchange.responder)
