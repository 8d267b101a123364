"""Everything that is requested from the autopilot: parameters with limits and fence settings, mission, fence.

At most five requests a second are sent, and none is repeated without need.
"""

import math
from collections.abc import Mapping

from companion.airspace.fences import (
    AutopilotFence,
    FenceSettings,
    FenceZone,
    HeightLimits,
    fence_in_force,
    zones_of,
)
from companion.autopilots import Adapter
from companion.autopilots.parameters import ReportedLimits, reported_limits
from companion.avoidance import Envelope, Fence
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    CommandResult,
    Fact,
    FenceStatus,
    HomePosition,
    MissionItem,
    MissionProgress,
    Parameter,
    Sender,
)
from companion.output.notice import Condition, Notice
from companion.ownship.mission import Mission
from companion.ownship.mission_reader import FENCE, MISSION, MISSION_PROTOCOL, MissionReader
from companion.ownship.parameter_reader import ParameterReader
from companion.ownship.performance_limits import AircraftLimits, PerformanceLimits, limits_in_effect

# The facts that `AutopilotQueries.observe` processes.
RELEVANT_FACTS: frozenset[type] = frozenset(
    (Parameter, FenceStatus, HomePosition, MissionProgress, CommandResult, *MISSION_PROTOCOL)
)
UNANSWERED = "unanswered"  # key of the condition
# The autopilot sends heartbeats and answers none of our requests for this long; longer once it has answered,
# as it does not answer a request for a parameter that it does not have.
_UNANSWERED_S, _UNANSWERED_AGAIN_S = 10.0, 60.0
_ANSWERS: frozenset[type] = frozenset((Parameter, CommandResult, *MISSION_PROTOCOL))
_REQUEST_INTERVAL_S = 0.2
# FENCE_STATUS comes once a second from an autopilot whose fence is enabled.
_FENCE_HEARD_S, _EARLY_S = 5.0, 1e-6
_FENCE_OFF = FenceSettings(on=False, zones=False)
# Parameters arrive one by one; the limits are announced when none has changed them for this long.
_SETTLED_S = 3.0
# The autopilot may fly elsewhere for other reasons; then reading the mission again does not help.
_REREAD_INTERVAL_S = 120.0


class AutopilotQueries:
    """Requests, stores the answers, and announces the limits in effect with their sources."""

    def __init__(
        self, assumed: Envelope, configured: AircraftLimits, zones: tuple[FenceZone, ...] = ()
    ) -> None:
        self._assumed = assumed
        self._configured = configured
        self._configured_zones = zones
        self._adapter: Adapter | None = None
        self._parameters = ParameterReader(())
        self._missions = MissionReader()
        self.limits: PerformanceLimits = limits_in_effect(assumed, configured, ReportedLimits())
        self.mission: Mission | None = None
        self._mission: Mission | None = None
        self._fence_items: tuple[MissionItem, ...] | None = None
        self._uploaded_zones: tuple[FenceZone, ...] = ()
        self._fence_settings = FenceSettings()  # by the parameters alone
        self._fence_heard_s = -math.inf
        self._home: HomePosition | None = None
        # The autopilot's own fence as known at present, equal as long as nothing changes; valid until
        # `fence_until_s`, when it is looked at again (see `refresh_fence`).
        self.fence = AutopilotFence(self._fence_settings, self._uploaded_zones, None)
        self.fence_until_s = math.inf
        self._next_request_s = -math.inf
        self._reread_s = -math.inf
        self._limits_changed_s: float | None = None  # until they are announced
        self._announced = ""
        self._asked_s: float | None = None  # the first request since the last answer
        self._answered = False  # since the contact began
        self._unanswered = False

    @property
    def parameters(self) -> Mapping[str, float]:
        """The parameters that the autopilot reported, in its own units."""
        return self._parameters.values

    @property
    def zones(self) -> tuple[FenceZone, ...]:
        """The zones of the configuration and of the autopilot's own fence."""
        return *self._configured_zones, *self._uploaded_zones

    @property
    def mission_arrives(self) -> bool:
        """Whether the mission is being read, and the autopilot answers."""
        return self._missions.mission_arrives

    @property
    def complete(self) -> bool:
        """Whether all limits are answered or given up, and mission and fence are read."""
        if self._adapter is None or self._missions.mission is None or self._missions.fence is None:
            return False
        limits = self._adapter.parameters.limits
        return self._parameters.settled(named.name for limit in limits for named in limit.names)

    def restart(self) -> None:
        """Request everything again, because the autopilot restarted or was out of contact."""
        self._parameters.restart()
        self._missions.restart()
        self._asked_s, self._answered = None, False

    def observe(self, fact: Fact, adapter: Adapter, us: Sender, now_s: float) -> None:
        """Process a fact from any sender; those that are not `RELEVANT_FACTS` have no effect."""
        self._adopt(adapter, now_s)
        self._missions.observe(fact, us, adapter.target, now_s)
        if fact.sender != adapter.target:
            return
        if type(fact) in _ANSWERS:
            self._asked_s, self._unanswered, self._answered = None, False, True
        match fact:
            case Parameter():
                self._learn(fact, adapter, now_s)
            case FenceStatus():
                self._fence_heard_s = now_s
                self.refresh_fence(now_s)
            case HomePosition():
                self._home = fact
                self.refresh_fence(now_s)
            case _:
                pass

    def tick(self, adapter: Adapter, now_s: float) -> tuple[list[Message], list[Notice]]:
        """The messages to send now, and what to announce."""
        self._adopt(adapter, now_s)
        messages = self._requests(adapter, now_s)
        if messages and self._asked_s is None:
            self._asked_s = now_s
        patience_s = _UNANSWERED_AGAIN_S if self._answered else _UNANSWERED_S
        self._unanswered |= self._asked_s is not None and now_s - self._asked_s >= patience_s
        notices = self._take_lists(now_s)
        if self._limits_changed_s is not None and now_s - self._limits_changed_s >= _SETTLED_S:
            self._limits_changed_s = None
            notices += self._limit_notices()
        return messages, notices

    def _limit_notices(self) -> list[Notice]:
        text = f"Aircraft: {', '.join(map(str, self.limits.sourced))}"
        if text == self._announced:
            return []
        self._announced = text
        return [_to_log(text)]

    def conditions(self) -> list[Condition]:
        """An autopilot that is heard but answers nothing: limits, mission and fence are then unknown."""
        if not self._unanswered:
            return []
        text = "Avoidance: autopilot answers no request"
        return [Condition(UNANSWERED, mavlink.MAV_SEVERITY_ERROR, text, "Avoidance: autopilot answers again")]

    def reread_mission(self, now_s: float) -> None:
        """Read the mission again, as the autopilot flies elsewhere than the known one leads."""
        if now_s - self._reread_s >= _REREAD_INTERVAL_S:
            self._reread_s = now_s
            self._missions.changed(MISSION, now_s)

    # --- the fence

    def heights(self, min_height_m: float, max_height_m: float | None) -> HeightLimits:
        """Floor and ceiling: those given, and those of the autopilot's fence within its margin."""
        return HeightLimits.within_fence(min_height_m, max_height_m, self.fence.settings)

    def local_fence(self, frame: LocalFrame, home_altitude_m: float) -> Fence | None:
        """The fence in force in the local frame, see `fence_in_force`."""
        return fence_in_force(self._configured_zones, self.fence, frame, home_altitude_m)

    def refresh_fence(self, now_s: float) -> None:
        """Look at the fence again, as something changed, or after `fence_until_s`.

        It has no heights and zones when it is known to be off: by its settings, and not heard.
        """
        heard = now_s - self._fence_heard_s <= _FENCE_HEARD_S
        self.fence_until_s = self._fence_heard_s + _FENCE_HEARD_S - _EARLY_S if heard else math.inf
        off = self._fence_settings.on is False and not heard
        home_deg = None if self._home is None else (self._home.lat_deg, self._home.lon_deg)
        settings = _FENCE_OFF if off else self._fence_settings
        self.fence = AutopilotFence(settings, self._uploaded_zones, home_deg)

    # --- requests and answers

    def _adopt(self, adapter: Adapter, now_s: float) -> None:
        if self._adapter is not adapter:
            self._adapter = adapter
            self._parameters = ParameterReader(adapter.parameters.questions())
            self._fence_settings = adapter.parameters.fence(self.parameters)
            self.refresh_fence(now_s)
            self._limits_changed_s = now_s

    def _requests(self, adapter: Adapter, now_s: float) -> list[Message]:
        if now_s < self._next_request_s:
            return []
        # The mission first: until it is known, the aircraft may be about to land.
        message = self._missions.tick(adapter.target, now_s)
        if message is None:
            message = self._parameters.tick(adapter.request_parameter, now_s)
        if message is None:
            return []
        self._next_request_s = now_s + _REQUEST_INTERVAL_S - 1e-3
        return [message]

    def _learn(self, fact: Parameter, adapter: Adapter, now_s: float) -> None:
        table = adapter.parameters
        before = self.parameters.get(fact.name)
        if not self._parameters.observe(fact.name, fact.value, now_s):
            return
        if before is not None:
            if fact.name == table.mission_total:
                self._missions.changed(MISSION, now_s)
            elif fact.name == table.fence_total:
                self._missions.changed(FENCE, now_s)
        self._fence_settings = table.fence(self.parameters)
        self.refresh_fence(now_s)
        reported = reported_limits(self.parameters, table)
        limits = limits_in_effect(self._assumed, self._configured, reported)
        if limits != self.limits:
            self.limits = limits
            self._limits_changed_s = now_s

    def _take_lists(self, now_s: float) -> list[Notice]:
        """Store the lists that were read; returns what to announce about them."""
        notices: list[Notice] = []
        mission, fence = self._missions.mission, self._missions.fence
        if mission is None:
            self.mission = None
        elif self._mission is None or mission != self._mission.items:
            self.mission = self._mission = Mission(mission)
            notices.append(_to_log(f"Mission: {len(mission)} items"))
        else:
            self.mission = self._mission  # the same object for the same items
        if fence is not None and fence != self._fence_items:
            news = bool(fence or self._fence_items)
            self._fence_items = fence
            self._uploaded_zones, useless = zones_of(fence)
            self.refresh_fence(now_s)
            words = f"Fence: {len(self._uploaded_zones)} zones of the autopilot"
            words += f", {useless} items not understood" if useless else ""
            notices += [_to_log(words)] if news else []
        return notices


def _to_log(text: str) -> Notice:
    return Notice(mavlink.MAV_SEVERITY_INFO, text, log_only=True)
