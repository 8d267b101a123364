"""While the aircraft is ours, an overdue heartbeat is requested: without one nothing may be commanded."""

import itertools

import pytest

from companion.autopilots import ArduPlane, Px4FixedWing
from companion.autopilots.adapter import Adapter
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import AutopilotVersion, Sender
from companion.ownship.message_rates import MessageRates

AUTOPILOT = Sender(1, 1)


@pytest.mark.parametrize("adapter", [ArduPlane(AUTOPILOT), Px4FixedWing(AUTOPILOT)], ids=["ardupilot", "px4"])
def test_it_is_requested_until_it_comes(adapter: Adapter) -> None:
    rates = MessageRates()
    sent_s = [tenth / 10 for tenth in range(30) if rates.heartbeat(adapter, heard_s=0.0, now_s=tenth / 10)]
    assert sent_s == pytest.approx([1.2, 1.5, 1.8, 2.1, 2.4, 2.7])
    assert not rates.heartbeat(adapter, heard_s=2.9, now_s=3.0)


def test_in_guided_course_it_is_requested_several_times_a_second_although_it_comes() -> None:
    adapter, rates = Px4FixedWing(AUTOPILOT), MessageRates()
    adapter.observe(AutopilotVersion(AUTOPILOT, "", 1, 18, capabilities=0), 0.0)
    adapter.choose_way()
    sent = [tick for tick in range(60) if rates.heartbeat(adapter, heard_s=tick // 10, now_s=tick / 10)]
    assert 18 <= len(sent) <= 24
    assert max(after - before for before, after in itertools.pairwise(sent)) <= 3
    adapter.fall_back(0)
    assert not rates.heartbeat(adapter, heard_s=6.0, now_s=6.5), "OFFBOARD needs none"


def test_the_request_is_a_question() -> None:
    (request,) = MessageRates().heartbeat(ArduPlane(AUTOPILOT), heard_s=0.0, now_s=2.0)
    assert request.command == mavlink.MAV_CMD_REQUEST_MESSAGE
    assert request.param1 == mavlink.MAVLINK_MSG_ID_HEARTBEAT
