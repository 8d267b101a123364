"""The intent of a member on the wire: round trips, and bytes that are none."""

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.facts import MemberIntent, Sender
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.translate import frame_to_fact, to_fact
from companion.mavlink.translate.formation import INTENT, intent_message
from companion.model import Guidance, Proposal

SENDER = Sender(3, 196)

courses = st.floats(0.0, 2.0 * math.pi - 1e-3)
airspeeds = st.floats(0.0, 200.0)
altitudes = st.floats(-500.0, 9000.0, width=32)
guidances = st.builds(Guidance, courses, airspeeds, altitudes)
proposals = st.builds(Proposal, st.integers(1, 0xFFFF), st.none() | guidances)
places = st.none() | st.tuples(st.floats(-89.0, -0.1) | st.floats(0.1, 89.0), st.floats(-179.9, 179.9))
intents = st.builds(
    MemberIntent,
    st.just(SENDER),
    st.integers(0, 0xFFFF),
    places,
    places,
    st.none() | courses,
    altitudes,
    airspeeds,
    st.booleans(),
    st.floats(5.0, 20.0),
    st.floats(20.0, 200.0),
    st.floats(0.01, 1.5),
    st.none() | guidances,
    st.none() | proposals,
    st.dictionaries(st.integers(1, 255), st.integers(1, 0xFFFF), max_size=9),
    st.booleans(),
)


def frame_of(intent: MemberIntent) -> bytes:
    return Encoder().encode(intent_message(intent), *SENDER)


def read(raw: bytes) -> MemberIntent:
    (frame,) = FrameSplitter().feed_datagram(raw)
    fact = frame_to_fact(frame, 0.0)
    assert isinstance(fact, MemberIntent)
    assert to_fact(mavlink.MAVLink(None).parse_char(raw), 0.0) == fact
    return fact


def assert_same_guidance(found: Guidance | None, sent: Guidance | None) -> None:
    assert (found is None) == (sent is None)
    if found is not None and sent is not None:
        assert found.altitude_m == sent.altitude_m
        assert found.airspeed_mps == pytest.approx(sent.airspeed_mps, abs=0.006)
        assert abs(math.remainder(found.course_rad - sent.course_rad, math.tau)) < 1e-4


@settings(max_examples=100, deadline=None, derandomize=True)
@given(intents)
def test_an_intent_arrives_as_it_was_sent(sent: MemberIntent) -> None:
    found = read(frame_of(sent))
    assert found.sender == SENDER
    assert (found.counter, found.heard, found.answers, found.goal_is_end) == (
        sent.counter,
        sent.heard,
        sent.answers,
        sent.goal_is_end,
    )
    assert found.goal_altitude_m == sent.goal_altitude_m
    assert found.goal_airspeed_mps == pytest.approx(sent.goal_airspeed_mps, abs=0.006)
    assert (found.min_airspeed_mps, found.max_airspeed_mps) == pytest.approx(
        (sent.min_airspeed_mps, sent.max_airspeed_mps), abs=0.006
    )
    assert found.max_turn_rate_radps == pytest.approx(sent.max_turn_rate_radps, abs=0.0006)
    assert found.goal_deg == (None if sent.goal_deg is None else pytest.approx(sent.goal_deg, abs=1e-7))
    assert found.then_deg == (None if sent.then_deg is None else pytest.approx(sent.then_deg, abs=1e-7))
    assert (found.goal_course_rad is None) == (sent.goal_course_rad is None)
    assert_same_guidance(found.flown, sent.flown)
    assert (found.proposal is None) == (sent.proposal is None)
    if found.proposal is not None and sent.proposal is not None:
        assert found.proposal.number == sent.proposal.number
        assert_same_guidance(found.proposal.guidance, sent.proposal.guidance)


def whole() -> MemberIntent:
    guidance = Guidance(1.0, 22.0, 400.0)
    return MemberIntent(
        SENDER, 0xFFFF, (47.0, 8.0), (47.1, 8.0), 0.3, 400.0, 22.0, True, 16.0, 28.0, 0.25, guidance,
        Proposal(0xFFFF, guidance), dict.fromkeys(range(1, 10), 65535), True,
    )  # fmt: skip


def test_ten_members_send_less_than_300_bytes_a_second_each() -> None:
    assert 3 * len(frame_of(whole())) < 300


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.binary(max_size=249), st.sampled_from([INTENT, 0, 0xFFFF]))
def test_other_payloads_are_no_intent_or_one_with_plausible_numbers(payload: bytes, kind: int) -> None:
    message = mavlink.MAVLink_v2_extension_message(0, 0, 0, kind, payload.ljust(249, b"\0"))
    (frame,) = FrameSplitter().feed_datagram(Encoder().encode(message, *SENDER))
    fact = frame_to_fact(frame, 0.0)
    assert fact is None or (isinstance(fact, MemberIntent) and kind == INTENT)
    if isinstance(fact, MemberIntent):
        assert 0.0 < fact.min_airspeed_mps <= fact.max_airspeed_mps
        assert math.isfinite(fact.goal_altitude_m)


@pytest.mark.parametrize("offset", range(52))
def test_a_payload_with_any_byte_changed_is_read_or_dropped(offset: int) -> None:
    payload = bytearray(intent_message(whole()).payload)
    for value in (0x00, 0x7F, 0x80, 0xFF):
        payload[offset] = value
        message = mavlink.MAVLink_v2_extension_message(0, 0, 0, INTENT, bytes(payload))
        (frame,) = FrameSplitter().feed_datagram(Encoder().encode(message, *SENDER))
        fact = frame_to_fact(frame, 0.0)
        assert fact is None or isinstance(fact, MemberIntent)


def test_the_layout_is_the_documented_one() -> None:
    """A frame as another implementation would build it, from the table in the module's docstring."""
    payload = struct.pack("<BBHiif", 1, 0b011101, 7, 470000000, 80000000, 400.0)
    payload += struct.pack("<HHHHH", 9000, 2200, 1600, 2800, 250)
    payload += struct.pack("<HHf", 18000, 2300, 410.0) + struct.pack("<HHHf", 12, 27000, 2100, 390.0)
    payload += struct.pack("<ii", 471000000, 81000000) + struct.pack("<BH", 4, 55)
    message = mavlink.MAVLink_v2_extension_message(0, 0, 0, 0xCA91, payload.ljust(249, b"\0"))
    fact = read(Encoder().encode(message, *SENDER))
    assert fact.goal_deg == (47.0, 8.0)
    assert fact.then_deg == (47.1, 8.1)
    assert fact.goal_course_rad is None
    assert fact.flown == Guidance(math.pi, 23.0, 410.0)
    assert fact.proposal == Proposal(12, Guidance(1.5 * math.pi, 21.0, 390.0))
    assert fact.heard == {4: 55}
    assert fact.answers
    assert not fact.goal_is_end
