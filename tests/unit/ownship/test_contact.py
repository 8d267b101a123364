"""The state of the link: heartbeats, silences and the autopilot's clock."""

from companion.ownship.autopilot_state import Contact


def heard_until(now_s: float) -> Contact:
    """Facts every tenth of a second and a heartbeat every second, from 0 on."""
    contact = Contact()
    for tenth in range(round(now_s * 10) + 1):
        contact.observe(tenth / 10)
        if tenth % 10 == 0:
            contact.heartbeat_s = tenth / 10
    return contact


def test_nothing_is_heard_at_first() -> None:
    contact = Contact()
    assert not contact.heard(0.0)
    assert not contact.in_contact(0.0)
    assert not contact.just_regained(0.0)


def test_the_autopilot_is_lost_five_seconds_after_its_last_heartbeat() -> None:
    contact = heard_until(10.0)
    assert contact.heard(14.9)
    assert not contact.heard(15.0)


def test_contact_ends_with_a_second_of_silence_and_returns_with_the_next_heartbeat() -> None:
    contact = heard_until(10.0)
    assert contact.in_contact(11.0)
    assert not contact.in_contact(11.1)
    contact.observe(13.0)
    assert not contact.in_contact(13.0), "the mode may have changed in the silence"
    contact.observe(13.4)
    contact.heartbeat_s = 13.4
    assert contact.in_contact(13.4)


def test_a_silence_has_just_ended_for_a_second() -> None:
    contact = heard_until(10.0)
    assert not contact.just_regained(10.0)
    contact.observe(13.0)
    assert contact.just_regained(13.9)
    assert not contact.just_regained(14.0)


def test_the_clock_is_compared_with_ours() -> None:
    contact = Contact()
    contact.observe_clock(1_000_003.0, 1_000_000.0)
    assert contact.clock_offset_s == 3.0
    contact.observe_clock(None, 1_000_001.0)
    assert contact.clock_offset_s is None
