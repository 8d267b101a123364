"""Mission flight, as both autopilots do it: item by item, turning early, landing at the end.

Where the mission is entered or another item is selected, a new straight line to the item begins at that place
and height. After a waypoint the line is that between the items.
"""

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace

from companion.geodesy import GeoPoint, wrap_pi
from companion.model import Vec2
from sim.vehicle import mission as mission_items
from sim.vehicle.flight import STEP_S, Flight
from sim.vehicle.mission import MissionItem
from sim.vehicle.navigation import Leg
from sim.vehicle.outputs import ItemReached

_FLARE_HEIGHT_M = 3.0
_FLARE_SINK_MPS = 0.7
# A loiter counts from when the aircraft is this near to its circle.
_ON_CIRCLE_M = 50.0


class MissionFlight(Flight):
    """A flight that can fly its mission."""

    _leg = Leg((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), 0.0)
    _circled_s = 0.0
    _circled_rad = 0.0
    _bearing_rad: float | None = None  # from the centre of the loiter, once on its circle

    @property
    def slopes_after_takeoff(self) -> bool:
        """Whether the first leg after a take-off is sloped; otherwise its end's height is flown at once."""
        return True

    @abstractmethod
    def _mission_over(self) -> None:
        """Called when no mission item is left to fly."""

    @abstractmethod
    def _leg_altitude_m(self, item: MissionItem, leg: Leg, here_m: Vec2) -> float:
        """The height that the autopilot flies at a place of its way to an item [m above mean sea level]."""

    def load_mission(self, items: Sequence[MissionItem]) -> None:
        """Replace the mission; in the mission's mode it is flown at once from its first item."""
        self.mission.replace(items)
        if self.on_mission:
            self._start_or_resume()

    def select_item(self, sequence: int) -> bool:
        """Select a mission item, flown at once in the mission's mode; False if it does not exist."""
        if not self.mission.select(sequence):
            return False
        if self.on_mission:
            self._start_or_resume()
        return True

    def resume_line(self) -> None:
        """Fly on to the active item straight from here, as if the mission had been flown all the while."""
        self._start_item()
        before = self.mission.item_at(self.mission.current - 1)
        if before is not None and before.command == mission_items.NAV_TAKEOFF:
            self._leave_takeoff()

    def _leave_takeoff(self) -> None:
        """Fly the first leg after a take-off as this autopilot does."""
        if not self.slopes_after_takeoff:
            self._leg = replace(self._leg, start_altitude_m=None)

    def _start_or_resume(self) -> None:
        if self.mission.active is None:
            self.mission.rewind()
        self._start_item()

    def _start_item(self) -> None:
        """Start the active item from the present position; without one the mission is over."""
        item = self._next_to_fly()
        if item is None:
            self._mission_over()
            return
        self._circled_s, self._circled_rad, self._bearing_rad = 0.0, 0.0, None
        if item.command == mission_items.NAV_TAKEOFF and not self.on_ground:
            self._runway_rad = self.aircraft.course_rad
        if item.command == mission_items.NAV_RETURN_TO_LAUNCH:
            self._circle(self.home, self.home.altitude_m + self.limits.rtl_height_m)
            return
        self.target = item.place(self.place, self.home.altitude_m)
        self._leg = self._leg_to(self.target)

    def _next_to_fly(self) -> MissionItem | None:
        """The active item, after those that are executed on the way; `None` at the end."""
        item = self.mission.active
        for _ in range(2 * len(self.mission.items)):  # a DO_JUMP to itself is flown by no autopilot
            if item is None:
                return None
            self._say(f"Mission: {self.mission.current} {item.name}")
            if item.command in mission_items.NAVIGATION:
                return item
            if item.command == mission_items.DO_JUMP:
                item = self.mission.jump()
                continue
            if item.command == mission_items.DO_CHANGE_SPEED and item.params[0] == 0.0 < item.params[1]:
                self.aircraft.hold_airspeed(item.params[1])
            item = self.mission.advance()
        return None

    def _leg_to(self, target: GeoPoint) -> Leg:
        """The leg from this place and height to the active item, with the item after it."""
        following = self.mission.next_navigation()
        end_m = next_m = self.frame.to_ned_m(target)[:2]
        if following is not None:
            next_m = self.frame.to_ned_m(following.place(target, self.home.altitude_m))[:2]
        aircraft = self.aircraft
        return Leg(aircraft.position_m[:2], end_m, next_m, target.altitude_m, aircraft.altitude_m)

    def _finish_item(self) -> None:
        self.events.append(ItemReached(self.mission.current))
        done, before = self.mission.active, self._leg
        self.mission.advance()
        self._start_item()
        if done is None:
            return
        if done.command == mission_items.NAV_TAKEOFF:
            self._leave_takeoff()
        elif done.command in mission_items.LOITERS | {mission_items.NAV_WAYPOINT}:
            # From the corner, or the centre of the circle, not from the start of the turn.
            self._leg = replace(self._leg, start_m=before.end_m, start_altitude_m=before.end_altitude_m)

    def _fly_mission(self) -> None:
        item = self.mission.active
        if item is None:
            self._fly_circle()
            return
        if item.command == mission_items.NAV_RETURN_TO_LAUNCH:
            self._fly_circle()
            return
        aircraft, leg = self.aircraft, self._leg
        here_m = (aircraft.north_m, aircraft.east_m)
        if item.command in mission_items.LOITERS:
            self._fly_loiter(item, leg, here_m)
            return
        self._follow(leg)
        distance_m = math.dist(here_m, leg.end_m)
        if item.command == mission_items.NAV_LAND:
            self._glide_to(distance_m)
            return
        aircraft.hold_altitude(self._leg_altitude_m(item, leg, here_m))
        acceptance_m = item.params[1]
        if not acceptance_m > 0.0:
            acceptance_m = leg.turn_distance_m(self.ground_speed_mps, self.limits.turn_radius_m)
        if distance_m <= acceptance_m or leg.is_passed(here_m):
            self._say(f"Reached waypoint #{self.mission.current} dist {distance_m:.0f}m")
            self._finish_item()

    def _follow(self, leg: Leg) -> None:
        """Command the bank or the course that joins and follows a leg."""
        aircraft = self.aircraft
        aircraft.hold_bank(leg.bank_rad(aircraft.position_m[:2], aircraft.velocity_mps[:2]))

    def _fly_loiter(self, item: MissionItem, leg: Leg, here_m: Vec2) -> None:
        """Fly to the circle and along it, until its turns or its time are over."""
        radius_m = item.params[2] or self.limits.loiter_radius_m or 1.0
        self._fly_circle(radius_m)
        if self._bearing_rad is None:  # once the circle is reached, its height is flown
            self.aircraft.hold_altitude(self._leg_altitude_m(item, leg, here_m))
        if abs(math.dist(here_m, leg.end_m) - abs(radius_m)) <= _ON_CIRCLE_M:
            self._circled_s += STEP_S
            bearing_rad = math.atan2(here_m[1] - leg.end_m[1], here_m[0] - leg.end_m[0])
            if self._bearing_rad is not None:
                self._circled_rad += abs(wrap_pi(bearing_rad - self._bearing_rad))
            self._bearing_rad = bearing_rad
        if self._has_circled(item):
            self._finish_item()

    def _has_circled(self, item: MissionItem) -> bool:
        """Whether the loiter's turns or its time are over."""
        if item.command == mission_items.NAV_LOITER_TURNS:
            return self._circled_rad >= max(item.params[0], 0.0) * math.tau
        return item.command == mission_items.NAV_LOITER_TIME and self._circled_s >= item.params[0]

    def _glide_to(self, distance_m: float) -> None:
        """Descend to reach the ground at the landing point, with a flare at the end."""
        height_m = self.aircraft.altitude_m - self.home.altitude_m
        if height_m <= _FLARE_HEIGHT_M:
            self.aircraft.hold_climb(-_FLARE_SINK_MPS)
            return
        seconds = max(distance_m / max(self.ground_speed_mps, 1.0), 1.0)
        self.aircraft.hold_climb(-height_m / seconds)
