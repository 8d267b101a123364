"""What an engine announces to the other members of its formation, and what that needs."""

import pytest

from companion.avoidance import AvoidanceParams
from companion.avoidance.group.formation import FormationParams
from companion.engine import Engine, EngineConfig, EngineParams
from companion.mavlink.dialect import mavlink
from companion.mavlink.translate.formation import INTENT
from sim.closed_loop import ClosedLoop
from sim.scenario import load_scenario

FORMATION = AvoidanceParams(formation=FormationParams(members="all"))


def announced_in(seconds: float, avoidance: AvoidanceParams) -> list[float]:
    """When intents were sent in a flight, in seconds since its start."""
    engine = Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1), avoidance=avoidance))
    loop = ClosedLoop(load_scenario("clear"), engine)
    times_s, transmit = [], loop._transmit

    def noting(time_us: int, effect: object) -> None:
        message = effect.message  # type: ignore[attr-defined]
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_V2_EXTENSION and message.message_type == INTENT:
            times_s.append((time_us - loop.start_us) / 1e6)
        transmit(time_us, effect)  # type: ignore[arg-type]

    loop._transmit = noting  # type: ignore[assignment, method-assign]
    loop.run(seconds)
    return times_s


def test_an_airborne_member_announces_its_intent_three_times_a_second() -> None:
    times_s = announced_in(20.0, FORMATION)
    last_s = [time_s for time_s in times_s if time_s > 10.0]
    assert 25 <= len(last_s) <= 30


def test_nothing_is_announced_without_members() -> None:
    assert announced_in(12.0, AvoidanceParams()) == []


def test_a_formation_needs_to_know_which_autopilot_is_ours() -> None:
    with pytest.raises(ValueError, match="autopilot_system_id"):
        EngineConfig(avoidance=FORMATION)
