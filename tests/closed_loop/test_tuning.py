"""Settings changed in flight: effective at once, without interrupting an avoidance, and replayed the same."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from companion.control.state_machine import State
from companion.engine import Effect, Engine, EngineConfig, Save, Transmit
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.tlog import TlogWriter
from companion.model import Layer, Role
from companion.replay import replay
from sim.scenario import Autopilot
from tests.closed_loop.test_operator import by_command
from tests.support.autopilots import BOTH, in_turn
from tests.support.monitored_loop import MonitoredLoop, without_traffic
from tests.support.overrides import in_state
from tests.support.thorough import sample

US = (1, 196)


def put(name: str, value: float) -> Message:
    return mavlink.MAVLink_param_set_message(*US, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)


class Tuned(MonitoredLoop):
    """Records the saved settings, and all messages in and out."""

    def __init__(self, path: Path | None = None, config: EngineConfig | None = None) -> None:
        self.saved: list[dict[str, float]] = []
        self._writer = None if path is None else TlogWriter(path)
        self._packing = Encoder()
        super().__init__(without_traffic(), config=config)

    def _perform(self, time_us: int, effects: Sequence[Effect]) -> None:
        self.saved += [dict(effect.values) for effect in effects if isinstance(effect, Save)]
        super()._perform(time_us, effects)

    def _transmit(self, time_us: int, effect: Transmit) -> None:
        self._write(time_us, effect.message, effect.sender.system_id, effect.sender.component_id)
        super()._transmit(time_us, effect)

    def _hear(self, message: Message) -> None:
        self._write(self.now_us, message, self.world.vehicle.system_id, self.world.vehicle.component_id)
        super()._hear(message)

    def send_to_companion(self, message: Message) -> None:
        self._write(self.now_us, message, 255, 190)
        super().send_to_companion(message)

    def close(self) -> None:
        assert self._writer is not None
        self._writer.close()

    def _write(self, time_us: int, message: Message, system_id: int, component_id: int) -> None:
        if self._writer is not None:
            self._writer.write(time_us, self._packing.encode(message, system_id, component_id))


def first_conflict_m(*settings: tuple[str, float]) -> float:
    """Distance of a head-on intruder at the first action [m]."""
    loop = Tuned()
    loop.run(2.5)
    for name, value in settings:
        loop.send_to_companion(put(name, value))
    loop.intrude(9000.0)
    loop.until(State.OUTER, limit_s=100.0)
    return loop.engine.decision.threats[0].distance_m  # type: ignore[union-attr]


def test_shorter_times_act_later() -> None:
    at_once = ("CA_RESERVE", 60.0)
    usual_m = first_conflict_m(at_once)
    later_m = first_conflict_m(at_once, ("CA_INNER_TIME", 10.0), ("CA_OUTER_TIME", 30.0))
    assert later_m < usual_m - 1000.0


def test_a_longer_reserve_acts_earlier() -> None:
    usual_m = first_conflict_m()
    assert first_conflict_m(("CA_RESERVE", 60.0)) > usual_m + 1000.0
    assert first_conflict_m(("CA_RESERVE", 0.0)) < usual_m - 200.0


def test_a_floor_above_the_aircraft_prevents_a_take_over() -> None:
    loop = Tuned()
    loop.run(2.5)
    loop.send_to_companion(put("CA_HEIGHT_MIN", 350.0))
    loop.intrude(3500.0)
    loop.run(6.0)
    assert loop.state is State.STANDBY
    assert loop.sent == []
    loop.send_to_companion(put("CA_HEIGHT_MIN", 30.0))
    loop.until(State.OUTER, limit_s=2.0)
    assert loop.saved == [{"CA_HEIGHT_MIN": 350.0}, {}]


def test_a_ceiling_set_in_flight_is_kept() -> None:
    heights = {}
    for ceiling_m in (0.0, 310.0):
        loop = Tuned()
        loop.run(2.5)
        loop.send_to_companion(put("CA_HEIGHT_MAX", ceiling_m))
        loop.intrude(4500.0, above_m=-40.0)  # below: climbing is the cheaper way
        highest_m = 0.0
        for _ in range(400):
            loop.run(0.1)
            above_m = loop.world.vehicle.truth.place.altitude_m - loop.scenario.home.altitude_m
            highest_m = max(highest_m, above_m)
        heights[ceiling_m] = highest_m
    assert heights[0.0] > 330.0
    assert heights[310.0] < 325.0


CHANGED = ["CA_WC_HORIZ", "CA_CONTROLS", "CA_DOMAIN", "CA_REL_TIME", "CA_SPARE_CLIMB"]


@in_turn("name", sample(CHANGED[:2], CHANGED), BOTH)
def test_an_avoidance_continues_through_a_change(autopilot: Autopilot, name: str) -> None:
    """The guidance is kept after a small change."""
    value = {"CA_WC_HORIZ": 620.0, "CA_DOMAIN": 80.0, "CA_REL_TIME": 4.0, "CA_CONTROLS": 5.0}.get(name, 13.0)
    loop = in_state(autopilot, State.OUTER)
    assert loop.engine is not None
    before = loop.engine.decision.guidance
    assert before is not None
    loop.send_to_companion(put(name, value))
    after = loop.engine.decision.guidance
    assert loop.state is State.OUTER
    assert after is not None
    assert after.course_rad == pytest.approx(before.course_rad, abs=0.1)
    assert after.altitude_m == pytest.approx(before.altitude_m, abs=20.0)
    loop.until(State.MONITOR, limit_s=120.0)
    assert loop.flight.engagements == 1


def test_texts_change_their_units() -> None:
    loop = Tuned()
    loop.run(2.5)
    loop.send_to_companion(put("CA_UNITS", 1.0))
    loop.send_to_companion(put("CA_RESERVE", 60.0))
    loop.send_to_companion(put("CA_CONTROLS", 1.0))  # a turn: its text has room for the height
    loop.intrude(3500.0, above_m=-60.0)
    loop.until(State.OUTER, limit_s=10.0)
    texts = [text for text in loop.flight.texts if "SUDDEN" in text]
    assert any(text.endswith(" ft below") for text in texts)


def test_a_refused_setting_is_reported_once_without_effect() -> None:
    loop = Tuned()
    loop.run(2.5)
    for _ in range(3):
        loop.send_to_companion(put("CA_OUTER_TIME", 500.0))
    loop.run(0.5)
    assert [t for t in loop.flight.texts if "CA_" in t] == ["CA_OUTER_TIME 500 refused: 10 to 80 s"]
    assert loop.saved == []


def test_a_replay_with_settings_and_commands_decides_the_same(tmp_path: Path) -> None:
    path, seconds = tmp_path / "flight.tlog", 70.0
    loop = Tuned(path)
    loop.run(2.5)
    loop.send_to_companion(mavlink.MAVLink_param_request_list_message(*US))
    loop.intrude(6000.0)
    at_s = {
        3.0: put("CA_RESERVE", 60.0),
        4.0: put("CA_INNER_TIME", 9.0),
        6.0: put("CA_OUTER_TIME", 25.0),
        21.0: put("CA_OUTER_TIME", 70.0),
        27.0: put("CA_WC_HORIZ", 900.0),
        31.0: put("CA_WC_HORIZ", float("nan")),
        33.0: mavlink.MAVLink_command_long_message(*US, 193, 0, 1, 0, 0, 0, 0, 0, 0),
        60.0: by_command(Role.ADVISE),
    }
    for tick in range(round(seconds * 10)):
        loop.run(0.1)
        message = at_s.get(tick / 10)
        if message is not None:
            loop.send_to_companion(message)
    loop.close()
    assert loop.flight.engagements == 2, "released with shorter times, taken over again with longer ones"
    assert any(text.startswith("Resuming") for text in loop.flight.texts)
    flown = loop.flight.decisions
    replayed: list[str] = []
    engine = Engine()
    result = replay(path, engine, on_decision=replayed.append)
    assert result.unusable == 0
    assert len(replayed) > seconds * 9
    assert replayed == flown[: len(replayed)]
    assert len(flown) - len(replayed) <= 2
    assert result.layers[Layer.OUTER] > 100
    assert loop.engine is not None
    assert engine.operator.settings.config == loop.engine.operator.settings.config
    # Other settings give other decisions.
    other: list[str] = []
    replay(path, Engine(saved={"CA_WC_VERT": 200.0}), on_decision=other.append)
    assert other != replayed
