"""Answers of the aircraft that need more than one of its parts."""

import pytest

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import (
    Fact,
    FenceStatus,
    Heartbeat,
    LandedState,
    MissionProgress,
    NavigationTarget,
    OwnPosition,
    Parameter,
    RcChannels,
    Sender,
)
from companion.ownship.aircraft import Aircraft

AUTOPILOT = Sender(1, 1)
AUTO, LOITER, GUIDED = 10, 12, 15
OFFBOARD, HOLD = 6 << 16, 4 << 16 | 3 << 24


def heartbeat(mode: int = AUTO, *, status: int = mavlink.MAV_STATE_ACTIVE, px4: bool = False) -> Heartbeat:
    autopilot = mavlink.MAV_AUTOPILOT_PX4 if px4 else mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    return Heartbeat(AUTOPILOT, mavlink.MAV_TYPE_FIXED_WING, autopilot, True, mode, status)


def position(height_m: float = 200.0) -> OwnPosition:
    return OwnPosition(AUTOPILOT, 0.0, 47.0, 8.0, 500.0 + height_m, height_m, (20.0, 0.0, 0.0), 0.0)


def aircraft(*facts: Fact) -> Aircraft:
    """After a heartbeat in AUTO and these facts, all at 0 s."""
    aircraft = Aircraft()
    for fact in (heartbeat(), *facts):
        assert aircraft.observe(fact, 0.0)
    return aircraft


def test_facts_of_others_are_not_ours() -> None:
    ours = aircraft()
    other = Sender(2, 1)
    assert not ours.observe(OwnPosition(other, 0.0, 1.0, 2.0, 3.0, 4.0, (0.0, 0.0, 0.0), None), 0.0)
    assert ours.kinematics.position is None


def test_modes_have_names_and_one_is_guided() -> None:
    assert Aircraft().mode is None
    ours = aircraft()
    assert (ours.mode, ours.guided) == ("AUTO", False)
    ours.observe(heartbeat(GUIDED), 1.0)
    assert (ours.mode, ours.guided) == ("GUIDED", True)


@pytest.mark.parametrize(
    ("landed_state", "height_m", "flying"),
    [
        (None, 200.0, True),
        (mavlink.MAV_LANDED_STATE_IN_AIR, 200.0, True),
        (mavlink.MAV_LANDED_STATE_IN_AIR, 20.0, False),
        (mavlink.MAV_LANDED_STATE_TAKEOFF, 200.0, False),
        (mavlink.MAV_LANDED_STATE_LANDING, 200.0, False),
    ],
)
def test_flying_means_in_the_air_and_high_enough(
    landed_state: int | None, height_m: float, flying: bool
) -> None:
    ours = aircraft(position(height_m), LandedState(AUTOPILOT, landed_state))
    assert ours.flying(30.0) is flying
    assert ours.flight_state.landing is (landed_state == mavlink.MAV_LANDED_STATE_LANDING)


def test_the_landed_state_is_awaited_four_seconds() -> None:
    ours = aircraft()
    assert not ours.landed_state_known(3.9)
    assert ours.landed_state_known(4.0)
    ours.observe(LandedState(AUTOPILOT, None), 1.0)
    assert ours.landed_state_known(1.0)


def test_a_fence_breach_ends_when_the_fence_is_no_longer_reported() -> None:
    ours = aircraft(FenceStatus(AUTOPILOT, breached=True))
    ours.observe(heartbeat(), 9.0)
    assert ours.flight_state.fence_breached
    ours.observe(heartbeat(), 10.0)
    assert not ours.flight_state.fence_breached


def test_a_failsafe_is_the_state_of_the_newest_heartbeat() -> None:
    ours = aircraft(heartbeat(status=mavlink.MAV_STATE_CRITICAL))
    assert ours.flight_state.failsafe
    ours.observe(heartbeat(), 1.0)
    assert not ours.flight_state.failsafe


def test_the_former_target_counts_again_when_the_guided_mode_is_left() -> None:
    ours = aircraft(NavigationTarget(AUTOPILOT, 47.2, 8.0, 650.0))
    ours.observe(heartbeat(GUIDED), 1.0)
    ours.ours = True
    ours.observe(NavigationTarget(AUTOPILOT, 47.1, 8.0, 650.0), 29.0)
    assert ours.navigation.target(30.0) is None
    ours.observe(heartbeat(), 30.0)
    assert ours.navigation.target(30.0) == GeoPoint(47.2, 8.0, 650.0)


def test_a_prior_flight_state_names_what_to_return_to() -> None:
    ours = aircraft(position(), MissionProgress(AUTOPILOT, 3), NavigationTarget(AUTOPILOT, 47.2, 8.0, 650.0))
    before = ours.prior_flight_state(1.0)
    assert (before.mode, before.sequence, before.target) == (AUTO, 3, GeoPoint(47.2, 8.0, 650.0))
    assert (before.course_rad, before.altitude_m, before.airspeed_mps) == (0.0, 700.0, 20.0)


@pytest.mark.parametrize(
    ("mode", "status", "by_itself"),
    [
        (HOLD, mavlink.MAV_STATE_CRITICAL, True),
        (HOLD, mavlink.MAV_STATE_ACTIVE, False),
        (4 << 16 | 5 << 24, mavlink.MAV_STATE_CRITICAL, False),
        (OFFBOARD, mavlink.MAV_STATE_ACTIVE, False),
    ],
)
def test_after_a_silence_the_lost_stream_mode_was_entered_by_the_autopilot_itself(
    mode: int, status: int, by_itself: bool
) -> None:
    ours = Aircraft()
    ours.observe(heartbeat(OFFBOARD, px4=True), 0.0)
    assert ours.adapter is not None
    ours.adapter.observe(Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 5.0), 0.0)
    ours.observe(heartbeat(mode, status=status, px4=True), 4.0)
    assert ours.left_guided_by_itself(4.5) is by_itself
    assert not ours.left_guided_by_itself(7.0)


def test_the_newest_stick_positions_are_stored() -> None:
    assert aircraft().sticks.pulses_us == ()
    assert aircraft(RcChannels(AUTOPILOT, (1500, 1600))).sticks.pulses_us == (1500, 1600)
