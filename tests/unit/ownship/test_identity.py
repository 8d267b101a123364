"""Which autopilot is adopted."""

import pytest

from companion.autopilots import ArduPlane, Px4FixedWing
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Heartbeat, LandedState, Sender
from companion.ownship.autopilot_state import FlightState, Identity

ARDUPILOT, PX4 = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4
PLANE, COPTER = mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_TYPE_QUADROTOR


def heartbeat(system_id: int = 1, autopilot: int = ARDUPILOT, vehicle_type: int = PLANE) -> Heartbeat:
    return Heartbeat(Sender(system_id, 1), vehicle_type, autopilot, True, 10, mavlink.MAV_STATE_ACTIVE)


def auto(adopt_after_s: float = 1.5) -> Identity:
    return Identity(None, None, adopt_after_s)


def test_the_only_autopilot_is_adopted_after_the_wait() -> None:
    identity = auto()
    assert not identity.is_ours(heartbeat(), 0.0)
    assert not identity.is_ours(heartbeat(), 1.4)
    assert identity.is_ours(heartbeat(), 1.5)
    assert isinstance(identity.adapter, ArduPlane)
    assert identity.sender == Sender(1, 1)
    assert identity.others(10.0) == set()
    assert identity.adopted_s == 1.5


def test_none_of_several_autopilots_is_adopted() -> None:
    identity = auto()
    for second in range(10):
        assert not identity.is_ours(heartbeat(1), float(second))
        assert not identity.is_ours(heartbeat(2), second + 0.5)
    assert identity.adapter is None
    assert identity.others(10.0) == {1, 2}


def test_a_configured_system_is_adopted_at_once_whatever_else_is_heard() -> None:
    identity = Identity(2, None, 1.5)
    assert not identity.is_ours(heartbeat(1), 0.0)
    assert identity.is_ours(heartbeat(2), 0.1)
    assert identity.unwanted_since_s(5.0) == {1: 0.0}


def test_an_expected_system_is_adopted_at_once_unless_another_is_configured() -> None:
    identity = auto()
    identity.expect(7)
    assert not identity.is_ours(heartbeat(1), 0.0)
    assert identity.is_ours(heartbeat(7), 0.1)
    configured = Identity(2, None, 0.0)
    configured.expect(7)
    assert not configured.is_ours(heartbeat(7), 0.0)


def test_an_autopilot_of_another_kind_than_configured_is_not_adopted() -> None:
    identity = Identity(None, PX4, 0.0)
    assert not identity.is_ours(heartbeat(1, ARDUPILOT), 3.0)
    assert not identity.is_ours(heartbeat(1, ARDUPILOT), 4.0)
    assert identity.unwanted_since_s(5.0) == {1: 3.0}
    assert identity.is_ours(heartbeat(2, PX4), 5.0)
    assert isinstance(identity.adapter, Px4FixedWing)


def test_heartbeats_without_an_autopilot_are_ignored() -> None:
    identity = auto(0.0)
    assert not identity.is_ours(heartbeat(255, mavlink.MAV_AUTOPILOT_INVALID), 0.0)
    assert identity.others(10.0) == set()
    assert identity.unwanted_since_s(5.0) == {}


@pytest.mark.parametrize(
    ("autopilot", "vehicle_type"),
    [
        (mavlink.MAV_AUTOPILOT_GENERIC, mavlink.MAV_TYPE_GCS),
        (mavlink.MAV_AUTOPILOT_GENERIC, mavlink.MAV_TYPE_ADSB),
        (mavlink.MAV_AUTOPILOT_GENERIC, mavlink.MAV_TYPE_GENERIC),
        (mavlink.MAV_AUTOPILOT_GENERIC, PLANE),
        (ARDUPILOT, mavlink.MAV_TYPE_GIMBAL),
        (PX4, mavlink.MAV_TYPE_ONBOARD_CONTROLLER),
    ],
)
def test_only_vehicles_with_an_autopilot_that_we_can_fly_are_candidates(
    autopilot: int, vehicle_type: int
) -> None:
    identity = auto()
    for second in range(5):
        assert not identity.is_ours(heartbeat(9, autopilot, vehicle_type), float(second))
        assert identity.is_ours(heartbeat(1), second + 0.5) is (second > 1)


def test_an_autopilot_that_fell_silent_does_not_count_any_more() -> None:
    identity = auto()
    identity.is_ours(heartbeat(2), 0.0)
    heard_s = [second for second in range(20) if identity.is_ours(heartbeat(1), float(second))]
    assert heard_s[0] == 11


@pytest.mark.parametrize(
    ("vehicle_type", "vtol_state", "is_wing"),
    [
        (PLANE, None, True),
        (PLANE, mavlink.MAV_VTOL_STATE_FW, True),
        (PLANE, mavlink.MAV_VTOL_STATE_MC, False),
        (PLANE, mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW, False),
        (mavlink.MAV_TYPE_VTOL_TILTROTOR, None, False),
        (mavlink.MAV_TYPE_VTOL_TILTROTOR, mavlink.MAV_VTOL_STATE_FW, True),
        (mavlink.MAV_TYPE_VTOL_TILTROTOR, mavlink.MAV_VTOL_STATE_TRANSITION_TO_MC, False),
        (mavlink.MAV_TYPE_VTOL_TILTROTOR, mavlink.MAV_VTOL_STATE_MC, False),
        (COPTER, None, False),
        (COPTER, mavlink.MAV_VTOL_STATE_FW, False),
        (None, None, False),
    ],
)
def test_a_vtol_flies_as_a_wing_only_in_wing_flight(
    vehicle_type: int | None, vtol_state: int | None, is_wing: bool
) -> None:
    state = FlightState()
    state.observe_landed_state(LandedState(Sender(1, 1), mavlink.MAV_LANDED_STATE_IN_AIR, vtol_state))
    assert state.flies_as_wing(vehicle_type) is is_wing
