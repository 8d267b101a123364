"""The goal from mission item and navigation target, and whether they agree."""

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import MissionItem, MissionProgress, NavigationTarget, OwnPosition, Sender
from companion.model import Goal
from companion.ownship.kinematics import Kinematics
from companion.ownship.mission import Mission
from companion.ownship.navigation import Navigation
from tests.support.responder import MISSION, US, Item, as_fact, item_message

AUTOPILOT, FRAME = Sender(1, 1), LocalFrame(47.0, 8.0)
LAT_DEG = (47.0, 47.1, 47.2, 47.3)


def mission() -> Mission:
    """Three waypoints to the north of home, 100 m above it."""
    address = (US.system_id, US.component_id)
    items = [Item(16, (lat_deg, 8.0), 100.0) for lat_deg in LAT_DEG]
    facts = [as_fact(item_message(item, at, address, MISSION)) for at, item in enumerate(items)]
    return Mission([fact for fact in facts if isinstance(fact, MissionItem)])


def flying(sequence: int | None = 2) -> Navigation:
    """In the mission at 0 s, 200 m above home, on an easterly course."""
    kinematics = Kinematics()
    position = OwnPosition(AUTOPILOT, 0.0, 47.0, 8.0, 700.0, 200.0, (0.0, 20.0, 0.0), None)
    kinematics.observe_position(position, 0.0)
    navigation = Navigation(kinematics)
    navigation.mission = mission()
    if sequence is not None:
        navigation.observe_progress(MissionProgress(AUTOPILOT, sequence), 0.0, guided=False)
    return navigation


def target(navigation: Navigation, lat_deg: float, now_s: float = 0.0, *, ours: bool = False) -> None:
    navigation.observe_target(NavigationTarget(AUTOPILOT, lat_deg, 8.0, 650.0), now_s, ours=ours, guided=ours)


def north_m(goal: Goal) -> float | None:
    return None if goal.position_m is None else goal.position_m[0]


def to_the_north_m(lat_deg: float) -> float:
    return FRAME.to_ned_m(GeoPoint(lat_deg, 8.0, 0.0))[0]


def test_the_goal_is_the_mission_item() -> None:
    goal = flying().goal(FRAME, 1.0, in_mission=True)
    assert north_m(goal) == pytest.approx(to_the_north_m(47.2))
    assert goal.altitude_m == 600.0


def test_outside_the_mission_the_goal_is_the_target() -> None:
    navigation = flying()
    target(navigation, 47.05)
    goal = navigation.goal(FRAME, 1.0, in_mission=False)
    assert north_m(goal) == pytest.approx(to_the_north_m(47.05))
    assert goal.altitude_m == 650.0


def test_without_a_fresh_item_or_target_the_goal_is_the_present_course() -> None:
    navigation = flying()
    target(navigation, 47.05)
    goal = navigation.goal(FRAME, 20.0, in_mission=True)
    assert goal.position_m is None
    assert goal.course_rad == pytest.approx(1.5708, abs=1e-4)
    assert goal.altitude_m == 700.0


def test_a_target_elsewhere_counts_and_soon_the_mission_is_outdated() -> None:
    navigation = flying()
    for second in range(8):
        navigation.observe_progress(MissionProgress(AUTOPILOT, 2), float(second), guided=False)
        target(navigation, 47.05, float(second))
        goal = navigation.goal(FRAME, float(second), in_mission=True)
        assert north_m(goal) == pytest.approx(to_the_north_m(47.05))
        assert navigation.mission_outdated(float(second)) == (second > 5)
    target(navigation, 47.2005, 8.0)
    assert north_m(navigation.goal(FRAME, 8.0, in_mission=True)) == pytest.approx(to_the_north_m(47.2))
    assert not navigation.mission_outdated(8.0)


def test_old_reports_count_again_after_a_refresh() -> None:
    navigation = flying()
    target(navigation, 47.2)
    assert navigation.target(20.0) is None
    navigation.refresh(20.0)
    assert navigation.target(20.0) == GeoPoint(47.2, 8.0, 650.0)
    assert north_m(navigation.goal(FRAME, 20.0, in_mission=True)) == pytest.approx(to_the_north_m(47.2))


def test_a_target_without_a_height_is_at_our_height() -> None:
    navigation = flying()
    navigation.observe_target(NavigationTarget(AUTOPILOT, 47.2, 8.0, None), 0.0, ours=False, guided=False)
    assert navigation.target(0.0) == GeoPoint(47.2, 8.0, 700.0)


def test_a_target_of_our_own_setpoints_is_no_target_of_the_autopilot() -> None:
    navigation = flying()
    target(navigation, 47.2)
    target(navigation, 47.05, ours=True)
    navigation.observe_guided()
    assert navigation.target(0.0) == GeoPoint(47.2, 8.0, 650.0)
    assert navigation.redirected_from(GeoPoint(47.2, 8.0, 650.0))
    assert not navigation.redirected_from(GeoPoint(47.0505, 8.0, 650.0))
    assert not navigation.is_redirected


def test_the_missions_target_of_while_we_asked_is_no_target_of_the_guided_mode() -> None:
    navigation = flying()
    navigation.observe_target(NavigationTarget(AUTOPILOT, 47.2, 8.0, 650.0), 0.0, ours=True, guided=False)
    navigation.observe_guided()
    target(navigation, 47.05, ours=True)
    assert not navigation.is_redirected


def test_a_target_counts_once_the_guided_mode_is_still_shown_after_it() -> None:
    navigation = flying()
    target(navigation, 47.05, ours=True)
    navigation.observe_guided()
    target(navigation, 47.2, ours=True)
    assert not navigation.is_redirected
    navigation.observe_guided()
    target(navigation, 47.2, ours=True)  # reported again in the same instant, as often as heartbeats
    assert navigation.is_redirected


def test_destinations_are_those_of_the_mission_that_is_known() -> None:
    navigation = flying()
    assert navigation.destination(None) == GeoPoint(47.2, 8.0, 600.0)
    assert navigation.destination(3) == GeoPoint(47.3, 8.0, 600.0)
    assert flying(None).destination(None) is None
    navigation.mission = None
    assert navigation.destination(3) is None
    assert not navigation.taking_off_or_landing()


def test_the_height_is_known_only_from_an_item_or_from_a_target_with_a_height() -> None:
    navigation = flying()
    assert navigation.goal(FRAME, 1.0, in_mission=True).height_is_known
    assert not navigation.goal(FRAME, 1.0, in_mission=False).height_is_known, "the present course"
    target(navigation, 47.05)
    assert navigation.goal(FRAME, 1.0, in_mission=False).height_is_known
    without = NavigationTarget(AUTOPILOT, 47.05, 8.0, None)
    navigation.observe_target(without, 1.0, ours=False, guided=False)
    goal = navigation.goal(FRAME, 1.0, in_mission=False)
    assert (goal.altitude_m, goal.height_is_known) == (700.0, False)


def test_a_target_reported_before_the_item_was_selected_does_not_outweigh_it() -> None:
    """As after an avoidance: the target from before it is flown to again, and the item is passed at once."""
    navigation = flying(1)
    target(navigation, 47.1)
    navigation.refresh_target(60.0)
    navigation.observe_progress(MissionProgress(AUTOPILOT, 2), 61.0, guided=False)
    goal = navigation.goal(FRAME, 62.0, in_mission=True)
    assert north_m(goal) == pytest.approx(to_the_north_m(47.2))
    target(navigation, 47.1, 63.0)
    goal = navigation.goal(FRAME, 63.0, in_mission=True)
    assert north_m(goal) == pytest.approx(to_the_north_m(47.1)), "reported again: it counts"
