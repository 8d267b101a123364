"""What we know of our aircraft by asking its autopilot: limits, fence and mission.

One question at a time, five a second at most, and none of them twice without need.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

from companion.airspace.altitude_limits import HeightLimits
from companion.airspace.autopilot_fences import AutopilotFence, FenceSettings, zones_of
from companion.airspace.fence_in_force import FenceInForce
from companion.airspace.fence_zones import FenceZone
from companion.autopilots import Adapter
from companion.avoidance import Envelope, Fence
from companion.gcs.statustext import StatusText
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    Fact,
    FenceStatus,
    HomePosition,
    MissionItem,
    MissionProgress,
    Parameter,
    Sender,
)
from companion.output.effects import Effect, Say
from companion.ownship.mission import Mission
from companion.ownship.mission_reader import FENCE, MISSION, MISSION_PROTOCOL, MissionReader
from companion.ownship.parameter_reader import ParameterReader
from companion.ownship.performance_limits import AircraftLimits, PerformanceLimits, effective
from companion.ownship.reported_limits import ReportedLimits, believe

# What it is told by; most facts are of other things.
HEEDED: frozenset[type] = frozenset(
    (Parameter, FenceStatus, HomePosition, MissionProgress, *MISSION_PROTOCOL)
)
_GAP_S = 0.2
# FENCE_STATUS comes once a second from an autopilot that keeps to its fence.
_FENCE_HEARD_S = 5.0
# Values come one by one; they are told when no more have come for so long.
_SETTLED_S = 3.0
# Where it flies elsewhere for reasons of its own, reading the mission over and over does not help.
_DOUBTED_AGAIN_S = 120.0


class AutopilotQueries:
    """Asks, believes with care, and tells what it took from where."""

    def __init__(
        self,
        announcer: StatusText,
        assumed: Envelope,
        configured: AircraftLimits,
        zones: tuple[FenceZone, ...] = (),
    ) -> None:
        self._announcer = announcer
        self._assumed = assumed
        self._configured = configured
        self._configured_zones = zones
        self._adapter: Adapter | None = None
        self._parameters = ParameterReader(())
        self._missions = MissionReader()
        self.belief = ReportedLimits()
        self.limits: PerformanceLimits = effective(assumed, configured, self.belief)
        self.mission: Mission | None = None
        self._mission_items: tuple[MissionItem, ...] | None = None
        self._fence_items: tuple[MissionItem, ...] | None = None
        self._uploaded_zones: tuple[FenceZone, ...] = ()
        self._fence_settings = FenceSettings()  # by the parameters alone
        self._fence_heard_s = -math.inf
        self._fence_in_force = FenceInForce(zones)
        self._home: HomePosition | None = None
        self._next_s = -math.inf
        self._doubted_s = -math.inf
        self._untold_since_s: float | None = None
        self._told = ""

    @property
    def envelope(self) -> Envelope:
        """What the avoidance may count upon, floor and ceiling aside."""
        return self.limits.envelope

    @property
    def parameters(self) -> Mapping[str, float]:
        """The autopilot's parameters as far as it told them, in its own units."""
        return self._parameters.values

    @property
    def zones(self) -> tuple[FenceZone, ...]:
        """The zones of the configuration, and those of the autopilot's own fence."""
        return *self._configured_zones, *self._uploaded_zones

    @property
    def complete(self) -> bool:
        """Whether all limits are answered or given up, and the lists read."""
        if self._adapter is None or self._missions.mission is None or self._missions.fence is None:
            return False
        limits = self._adapter.parameters.limits
        return self._parameters.settled(named.name for limit in limits for named in limit.names)

    def restart(self) -> None:
        """The autopilot started anew, or came back."""
        self._parameters.restart()
        self._missions.restart()

    def observe(self, fact: Fact, adapter: Adapter, us: Sender, now_s: float) -> None:
        """Take a fact in, whoever it came from; any that is not `HEEDED` means nothing."""
        self._adopt(adapter, now_s)
        self._missions.observe(fact, us, adapter.target, now_s)
        if fact.sender != adapter.target:
            return
        match fact:
            case Parameter():
                self._learn(fact, adapter, now_s)
            case FenceStatus():
                self._fence_heard_s = now_s
            case HomePosition():
                self._home = fact
            case _:
                pass

    def tick(self, adapter: Adapter, now_s: float) -> list[Effect]:
        """What to ask for now, and what there is to tell."""
        self._adopt(adapter, now_s)
        effects = self._announcer.transmit(self._requests(adapter, now_s))
        effects += self._take_lists()
        if self._untold_since_s is not None and now_s - self._untold_since_s >= _SETTLED_S:
            self._untold_since_s = None
            effects += self._tell_limits(now_s)
        return effects

    def _tell_limits(self, now_s: float) -> list[Effect]:
        effects: list[Effect] = []
        text = f"Aircraft: {', '.join(map(str, self.limits.taken))}"
        if text != self._told:
            self._told = text
            effects.append(Say(mavlink.MAV_SEVERITY_INFO, text))
        for doubt in self.limits.doubts:
            warning = f"Avoidance: {doubt}"
            effects += self._announcer.tell(mavlink.MAV_SEVERITY_WARNING, warning, now_s, once=True)
        return effects

    def doubt_mission(self, now_s: float) -> None:
        """The autopilot flies elsewhere than the mission that we know leads to: it may be another one."""
        if now_s - self._doubted_s >= _DOUBTED_AGAIN_S:
            self._doubted_s = now_s
            self._missions.changed(MISSION, now_s)

    # --- the fence

    def heights(self, min_height_m: float, max_height_m: float | None, now_s: float) -> HeightLimits:
        """The heights to keep between: those given, and those of the autopilot's fence within its margin."""
        return HeightLimits.within_fence(min_height_m, max_height_m, self._settings(now_s))

    def autopilot_fence(self, now_s: float) -> AutopilotFence:
        """The autopilot's own fence as known at present."""
        home_deg = None if self._home is None else (self._home.lat_deg, self._home.lon_deg)
        return AutopilotFence(self._settings(now_s), self._uploaded_zones, home_deg)

    def local_fence(self, frame: LocalFrame, home_altitude_m: float, now_s: float) -> Fence | None:
        """The fence in force in the local frame, see `FenceInForce`."""
        return self._fence_in_force.in_frame(frame, home_altitude_m, self.autopilot_fence(now_s))

    def _settings(self, now_s: float) -> FenceSettings:
        """What the autopilot makes of its fence; one that is known to be off is none at all."""
        if self._adapter is None:
            return FenceSettings()
        settings = self._fence_settings
        heard = now_s - self._fence_heard_s <= _FENCE_HEARD_S
        if settings.on is False and not heard:
            return FenceSettings(on=False, zones=False)
        return replace(settings, on=True) if heard else settings

    # --- asking and believing

    def _adopt(self, adapter: Adapter, now_s: float) -> None:
        if self._adapter is not adapter:
            self._adapter = adapter
            self._parameters = ParameterReader(adapter.parameters.questions())
            self._fence_settings = adapter.parameters.fence(self.parameters)
            self._untold_since_s = now_s

    def _requests(self, adapter: Adapter, now_s: float) -> list[Message]:
        if now_s < self._next_s:
            return []
        message = self._parameters.tick(adapter.request_parameter, now_s)
        if message is None:
            message = self._missions.tick(adapter.target, now_s)
        if message is None:
            return []
        self._next_s = now_s + _GAP_S - 1e-3
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
        self.belief = believe(self.parameters, table)
        limits = effective(self._assumed, self._configured, self.belief)
        if limits != self.limits:
            self.limits = limits
            self._untold_since_s = now_s

    def _take_lists(self) -> list[Effect]:
        """Take over what was read anew."""
        effects: list[Effect] = []
        mission, fence = self._missions.mission, self._missions.fence
        if mission is not self._mission_items:
            if mission is not None and mission != self._mission_items:
                effects.append(Say(mavlink.MAV_SEVERITY_INFO, f"Mission: {len(mission)} items"))
            self._mission_items = mission
            self.mission = None if mission is None else Mission(mission)
        if fence is not None and fence != self._fence_items:
            news = bool(fence or self._fence_items)
            self._fence_items = fence
            self._uploaded_zones, useless = zones_of(fence)
            words = f"Fence: {len(self._uploaded_zones)} zones of the autopilot"
            words += f", {useless} items not understood" if useless else ""
            effects += [Say(mavlink.MAV_SEVERITY_INFO, words)] if news else []
        return effects
