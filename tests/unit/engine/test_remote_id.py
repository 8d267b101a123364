"""Remote ID in the engine: other aircraft are traffic, what our autopilot sends of itself is not."""

from companion.mavlink.facts import RECEIVER, Fact, ReceiverOwnship, Sender, Traffic
from companion.model import TrafficReport, TrafficSource
from tests.unit.engine.test_engine import AUTOPILOT, OTHER, T0, heartbeat, new_engine, position, run


def tracks(facts_of: object) -> list[str]:
    engine = new_engine()
    for tick in range(30):
        now_s = T0 + tick / 10
        facts: list[Fact] = [position(now_s), heartbeat(), facts_of(now_s)]  # type: ignore[operator]
        run(engine, facts, now_s)
    return [track.track_id for track in engine.snapshot(T0 + 3.0).tracks]


def far_away(sender: Sender, time_s: float) -> TrafficReport:
    return TrafficReport(
        TrafficSource.REMOTE_ID, f"RID-{sender.system_id}.{sender.component_id}", time_s, -35.1, 149.1, 900.0
    )


def test_only_the_position_of_another_system_is_traffic() -> None:
    assert tracks(lambda now_s: ReceiverOwnship(OTHER, far_away(OTHER, now_s))) == ["RID-7.1"]
    for sender in (AUTOPILOT, Sender(1, 196), RECEIVER):
        assert tracks(lambda now_s, sender=sender: ReceiverOwnship(sender, far_away(sender, now_s))) == []


def test_what_our_receiver_hears_is_traffic() -> None:
    receiver = Sender(1, 236)
    assert tracks(lambda now_s: Traffic(receiver, far_away(receiver, now_s))) == ["RID-1.236"]
