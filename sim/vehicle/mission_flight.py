"""Mission flight, as both autopilots do it: item by item, turning early, landing at the end."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace

from companion.geodesy import GeoPoint
from sim.vehicle import mission as mission_items
from sim.vehicle.flight import Flight
from sim.vehicle.mission import MissionItem
from sim.vehicle.navigation import Leg
from sim.vehicle.outputs import ItemReached

_FLARE_HEIGHT_M = 3.0
_FLARE_SINK_MPS = 0.7


class MissionFlight(Flight):
    """A flight that can fly its mission."""

    _leg = Leg((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))

    @abstractmethod
    def _mission_over(self) -> None:
        """Called when no mission item is left to fly."""

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

    def _start_or_resume(self) -> None:
        if self.mission.active is None:
            self.mission.rewind()
        self._start_item()

    def _start_item(self) -> None:
        """Start the active item from the present position; without one the mission is over."""
        item = self.mission.active
        while item is not None:
            self._say(f"Mission: {self.mission.current} {item.name}")
            if item.command in mission_items.NAVIGATION:
                break
            if item.command == mission_items.DO_CHANGE_SPEED and item.params[0] == 0.0 < item.params[1]:
                self.aircraft.hold_airspeed(item.params[1])
            item = self.mission.advance()
        if item is None:
            self._mission_over()
            return
        if item.command == mission_items.NAV_TAKEOFF and not self.on_ground:
            self._runway_rad = self.aircraft.course_rad
        if item.command == mission_items.NAV_RETURN_TO_LAUNCH:
            self._circle(self.home, self.home.altitude_m + self.limits.rtl_height_m)
            return
        self.target = item.place(self.place, self.home.altitude_m)
        self._leg = self._leg_to(self.target)

    def _leg_to(self, target: GeoPoint) -> Leg:
        """The leg from here to the active item, with the item after it."""
        following = self.mission.next_navigation()
        end_m = next_m = self.frame.to_ned_m(target)[:2]
        if following is not None:
            next_m = self.frame.to_ned_m(following.place(target, self.home.altitude_m))[:2]
        return Leg(self.aircraft.position_m[:2], end_m, next_m)

    def _finish_item(self) -> None:
        self.events.append(ItemReached(self.mission.current))
        done, corner_m = self.mission.active, self._leg.end_m
        self.mission.advance()
        self._start_item()
        if done is not None and done.command == mission_items.NAV_WAYPOINT:
            self._leg = replace(self._leg, start_m=corner_m)  # the corner, not the start of the turn

    def _fly_mission(self) -> None:
        item = self.mission.active
        if item is None:
            self._fly_circle()
            return
        if item.command in (mission_items.NAV_LOITER_UNLIM, mission_items.NAV_RETURN_TO_LAUNCH):
            self._fly_circle(item.params[2] if item.command == mission_items.NAV_LOITER_UNLIM else 0.0)
            return
        aircraft, leg = self.aircraft, self._leg
        here_m = (aircraft.north_m, aircraft.east_m)
        aircraft.hold_bank(leg.bank_rad(here_m, aircraft.velocity_mps[:2]))
        distance_m = math.dist(here_m, leg.end_m)
        if item.command == mission_items.NAV_LAND:
            self._glide_to(distance_m)
            return
        aircraft.hold_altitude(self.wanted_altitude_m)
        acceptance_m = item.params[1]
        if not acceptance_m > 0.0:
            acceptance_m = leg.turn_distance_m(self.ground_speed_mps, self.limits.turn_radius_m)
        if distance_m <= acceptance_m or leg.is_passed(here_m):
            self._say(f"Reached waypoint #{self.mission.current} dist {distance_m:.0f}m")
            self._finish_item()

    def _glide_to(self, distance_m: float) -> None:
        """Descend to reach the ground at the landing point, with a flare at the end."""
        height_m = self.aircraft.altitude_m - self.home.altitude_m
        if height_m <= _FLARE_HEIGHT_M:
            self.aircraft.hold_climb(-_FLARE_SINK_MPS)
            return
        seconds = max(distance_m / max(self.ground_speed_mps, 1.0), 1.0)
        self.aircraft.hold_climb(-height_m / seconds)
