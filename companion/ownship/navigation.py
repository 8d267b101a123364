"""Where the autopilot flies to: the item of its mission, and its own navigation target."""

import math
from dataclasses import replace

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import MissionProgress, NavigationTarget
from companion.model import Goal
from companion.ownship.kinematics import Kinematics
from companion.ownship.legs import Leg, Legs
from companion.ownship.mission import Mission

_TARGET_FRESH_S = 10.0
# MISSION_CURRENT comes once a second.
_PROGRESS_FRESH_S = 5.0
# Further apart than this, the mission item and the navigation target are different places.
_SAME_PLACE_M = 150.0
# They may differ for this long while one waypoint follows another.
_DIFFERENCE_S = 5.0
# The autopilot reports its target at least this often, when asked.
_TARGET_NEW_S = 2.0
# A target further than this from the former one is a new one.
_REDIRECTED_M = 100.0


class Navigation:
    """The mission item and the navigation target, and whether they agree.

    While our setpoints are flown, the reported target is ours; it is stored apart from the autopilot's own.
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self._kinematics = kinematics
        self.legs = Legs()
        self.mission: Mission | None = None  # while it is known
        self.sequence: int | None = None  # of the mission item that is flown
        self._newest_guided_target: NavigationTarget | None = None
        self._guided_target: NavigationTarget | None = None  # the first one since the guided mode is flown
        # The newest one after which the guided mode was still shown: not that of another mode.
        self.confirmed_target: NavigationTarget | None = None
        self.is_redirected = False  # it is far from the one reported when the guided mode was entered
        self._reported: tuple[NavigationTarget, float] | None = None  # the newest one, ours or not
        # Grows when the mission is changed, or someone selects another item while our setpoints are flown.
        self.plan_changes = 0
        self._target: NavigationTarget | None = None
        self._target_s = -math.inf
        self._target_reported_s = -math.inf  # not refreshed
        self._sequence_s = -math.inf
        self._item_since_s = -math.inf
        self._differs_since_s: float | None = None

    def observe_progress(
        self, fact: MissionProgress, now_s: float, *, guided: bool = False, flown: bool = True
    ) -> None:
        """Store the number of the mission item that is flown.

        `flown`: in the mission's mode; `guided`: in the guided mode, in which it stands still.
        """
        before = self.sequence
        if guided and before not in (None, fact.sequence):
            self.plan_changes += 1
        if before != fact.sequence and not self._lead_to_the_same(before, fact.sequence):
            self.legs.item_changed(before, self._kinematics.place(), flown=flown and before is not None)
            self._item_since_s = now_s
        self.sequence, self._sequence_s = fact.sequence, now_s

    def _lead_to_the_same(self, one: int | None, other: int) -> bool:
        """Whether both items lead to one place, as an item that is executed on the way does."""
        if self.mission is None or one is None:
            return False
        return self.mission.flown_to(one) == self.mission.flown_to(other)

    def observe_target(self, fact: NavigationTarget, now_s: float, *, ours: bool, guided: bool) -> None:
        """Store a navigation target.

        `ours`: our setpoints are flown, or may be; `guided`: the guided mode has been entered.
        """
        self._reported = fact, now_s
        if ours and guided:
            self._newest_guided_target = fact
            if self._guided_target is None:
                self._guided_target = fact
        elif not ours:
            self._target, self._target_s, self._target_reported_s = fact, now_s, now_s

    def refresh(self, now_s: float) -> None:
        """Treat item and target as reported now, as after a silence."""
        if self.sequence is not None:
            self._sequence_s = now_s
        if self._target is not None:
            self._target_s = now_s

    def refresh_target(self, now_s: float) -> None:
        """Treat the target from before our setpoints as reported now, because it is flown to again."""
        self._target_s = now_s

    def target(self, now_s: float) -> GeoPoint | None:
        """The place that the autopilot itself flies to or circles; `None` when it is unknown or old."""
        target = self._target
        if target is None or now_s - self._target_s >= _TARGET_FRESH_S:
            return None
        altitude_m = self._kinematics.altitude_m() if target.altitude_m is None else target.altitude_m
        return GeoPoint(target.lat_deg, target.lon_deg, altitude_m)

    def from_guided_target_m(self, now_s: float) -> float | None:
        """How far the target reported just now is from that of the guided mode that we flew in [m].

        `None` when one of them is unknown.
        """
        first = self._guided_target
        if first is None or self._reported is None or now_s - self._reported[1] > _TARGET_NEW_S:
            return None
        now, frame = self._reported[0], LocalFrame(first.lat_deg, first.lon_deg)
        return math.hypot(*frame.to_ned_m(GeoPoint(now.lat_deg, now.lon_deg, 0.0))[:2])

    def forget_guided_target(self) -> None:
        """Begin to look for another target: the next one reported in the guided mode is ours."""
        self._newest_guided_target = self._guided_target = self.confirmed_target = None
        self.is_redirected = False

    def observe_guided(self) -> None:
        """Note that the guided mode is shown: the target reported before belongs to it."""
        self.confirmed_target, first = self._newest_guided_target, self._guided_target
        if first is not None:
            self.is_redirected = self.redirected_from(GeoPoint(first.lat_deg, first.lon_deg, 0.0))

    def redirected_from(self, place: GeoPoint) -> bool:
        """Whether the target of the guided mode is far from a place while our setpoints are flown."""
        other = self.confirmed_target
        if other is None:
            return False
        frame = LocalFrame(place.lat_deg, place.lon_deg)
        moved_m = frame.to_ned_m(GeoPoint(other.lat_deg, other.lon_deg, 0.0))[:2]
        return math.hypot(*moved_m) > _REDIRECTED_M

    def taking_off_or_landing(self) -> bool:
        """Whether the mission item takes off, approaches or lands; `False` while that is unknown."""
        if self.mission is None or self.sequence is None:
            return False
        return self.mission.taking_off_or_landing(self.sequence)

    def destination(self, sequence: int | None) -> GeoPoint | None:
        """The place that a mission item leads to, by default the present item; `None` when it is unknown."""
        sequence = self.sequence if sequence is None else sequence
        if self.mission is None or sequence is None:
            return None
        return self.mission.destination(sequence, self._kinematics.home_altitude_m())

    def goal(self, frame: LocalFrame, now_s: float, *, in_mission: bool) -> Goal:
        """The mission item, otherwise the navigation target, otherwise the present course and height.

        Where item and target are different places, the known mission is outdated, and the target counts,
        unless it was reported before that item was selected.
        """
        place = self.target(now_s)
        item = self._item_place(now_s) if in_mission else None
        if item is None:
            self._differs_since_s = None
        elif self._target_reported_s < self._item_since_s or not self._differs(item, place, frame, now_s):
            place = item
        own = self._kinematics
        goal = Goal(
            airspeed_mps=own.airspeed_mps(), height_is_known=place is item or self._has_target_height()
        )
        line = self._line() if item is not None and place is item else None
        if line is not None:
            return line.goal(frame, goal)
        if place is not None:
            return replace(goal, position_m=frame.to_ned_m(place), altitude_m=place.altitude_m)
        altitude_m = None if own.position is None else own.position.altitude_m
        return replace(goal, course_rad=own.course_rad(), altitude_m=altitude_m, height_is_known=False)

    def _has_target_height(self) -> bool:
        return self._target is not None and self._target.altitude_m is not None

    def leg(self) -> Leg | None:
        """The leg where the aircraft belongs; `None` when it is unknown, or another place is flown to."""
        if self.mission is None or self.sequence is None or self._differs_since_s is not None:
            return None
        own = self._kinematics
        return self.legs.leg(self.mission, self.sequence, own.place(), own.home_altitude_m())

    def _line(self) -> Leg | None:
        """The line that the autopilot flies to the mission's item."""
        if self.mission is None or self.sequence is None:
            return None
        own = self._kinematics
        return self.legs.line(self.mission, self.sequence, own.place(), own.home_altitude_m())

    def mission_outdated(self, now_s: float) -> bool:
        """Whether the autopilot has flown for a while to another place than the known mission leads to."""
        since_s = self._differs_since_s
        return since_s is not None and now_s - since_s > _DIFFERENCE_S

    def _item_place(self, now_s: float) -> GeoPoint | None:
        is_old = now_s - self._sequence_s > _PROGRESS_FRESH_S
        return None if is_old else self.destination(self.sequence)

    def _differs(self, item: GeoPoint, target: GeoPoint | None, frame: LocalFrame, now_s: float) -> bool:
        """Whether the item and the target are different places; stores since when."""
        away_m = 0.0
        if target is not None:
            here, there = frame.to_ned_m(item), frame.to_ned_m(target)
            away_m = math.hypot(here[0] - there[0], here[1] - there[1])
        if away_m <= _SAME_PLACE_M:
            self._differs_since_s = None
            return False
        if self._differs_since_s is None:
            self._differs_since_s = now_s
        return True
