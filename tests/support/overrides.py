"""Overrides by pilot or autopilot, and flights in each of the states that fly the aircraft."""

from collections.abc import Callable
from dataclasses import dataclass

from companion.autopilots import ArduPlane, Px4FixedWing
from companion.control.state_machine import State
from companion.engine import EngineConfig
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, FenceStatus, Heartbeat, LandedState, RcChannels
from sim.scenario import Autopilot
from sim.vehicle.fence import EXCLUSION_CIRCLE
from sim.vehicle.mission import MissionItem
from tests.support.autopilots import ARDUPILOT, PX4, PX4_1_18
from tests.support.monitored_loop import MonitoredLoop, is_mode_request, without_traffic

TICK_US = 100_000
# The recommended setting: PX4 enters HOLD by itself when our stream ends.
HOLDS = {"COM_OBL_RC_ACT": 5.0}

# --- overrides, and the facts that report them


@dataclass(frozen=True)
class Override:
    """An override, and the first fact that reports it."""

    name: str
    act: Callable[[MonitoredLoop], None]
    shows: Callable[[Fact], bool]

    def __str__(self) -> str:
        return self.name


def mode_change(name: str) -> Override:
    return Override(name, lambda loop: loop.world.vehicle.set_mode(name), _heartbeat_of(name))


def _heartbeat_of(name: str) -> Callable[[Fact], bool]:
    def shows(fact: Fact) -> bool:
        return isinstance(fact, Heartbeat) and name in (
            ArduPlane.mode_name(fact.custom_mode),
            Px4FixedWing.mode_name(fact.custom_mode),
        )

    return shows


def disarm(loop: MonitoredLoop) -> None:
    loop.world.vehicle.flight.armed = False


def land(loop: MonitoredLoop) -> None:
    """Let the autopilot report a landing, in any mode."""

    def landing(message: Message) -> Message:
        if message.get_type() == "EXTENDED_SYS_STATE":
            message.landed_state = mavlink.MAV_LANDED_STATE_LANDING
        return message

    loop.alter = landing


def breach_fence(loop: MonitoredLoop, *, action: float) -> None:
    """Put an exclusion zone around the aircraft, unknown to the companion."""
    vehicle = loop.world.vehicle
    here = vehicle.truth.place
    ours = {"FENCE_ENABLE": 1.0, "FENCE_ACTION": action, "GF_ACTION": action}
    for name, value in ours.items():
        if name in vehicle.parameters:
            vehicle.parameters.record(name, value)
    place = round(here.lat_deg * 1e7), round(here.lon_deg * 1e7)
    vehicle.flight.fence.replace([MissionItem(EXCLUSION_CIRCLE, (2000.0, 0.0, 0.0, 0.0), *place, 0.0, 0)])


def failing(fact: Fact) -> bool:
    return isinstance(fact, Heartbeat) and fact.system_status == mavlink.MAV_STATE_CRITICAL


STICKS = Override(
    "sticks",
    lambda loop: loop.world.vehicle.move_sticks(roll=0.5),
    lambda fact: isinstance(fact, RcChannels) and fact.pulses_us[0] == 1700,
)
RUDDER = Override(
    "rudder",
    lambda loop: loop.world.vehicle.move_sticks(yaw=-0.4),
    lambda fact: isinstance(fact, RcChannels) and fact.pulses_us[3] == 1340,
)
DISARMED = Override("disarmed", disarm, lambda fact: isinstance(fact, Heartbeat) and not fact.armed)
LANDING = Override("landing", land, lambda fact: isinstance(fact, LandedState) and fact.landed_state == 4)
FAILSAFE = Override("failsafe", lambda loop: loop.world.vehicle.fail_safe(True), failing)
FAILSAFE_HOME = Override(
    "failsafe home", lambda loop: loop.world.vehicle.fail_safe(True, return_home=True), failing
)
FENCE = Override(
    "fence",
    lambda loop: breach_fence(loop, action=0.0),
    lambda fact: isinstance(fact, FenceStatus) and fact.breached,
)
FENCE_HOME = Override("fence home", lambda loop: breach_fence(loop, action=1.0), FENCE.shows)
FENCE_HOLD = Override("fence hold", lambda loop: breach_fence(loop, action=2.0), _heartbeat_of("HOLD"))

COMMON = (STICKS, RUDDER, DISARMED, LANDING, FAILSAFE, FAILSAFE_HOME)
_PX4 = (
    *COMMON,
    FENCE_HOLD,
    *map(mode_change, ("MANUAL", "STABILIZED", "ALTCTL", "POSCTL", "HOLD", "RETURN", "LAND", "MISSION")),
)
OVERRIDES: dict[Autopilot, tuple[Override, ...]] = {
    ARDUPILOT: (
        *COMMON,
        FENCE,
        FENCE_HOME,
        *map(mode_change, ("MANUAL", "FBWA", "CRUISE", "LOITER", "RTL", "AVOID_ADSB", "AUTO")),
    ),
    PX4: _PX4,
    PX4_1_18: _PX4,
}

# --- states at the time of the override


def to_engaging(loop: MonitoredLoop) -> None:
    """The mode request does not reach the autopilot."""
    loop.drops = is_mode_request
    loop.intrude(3500.0)
    loop.until(State.ENGAGING, limit_s=10.0)
    loop.run(0.7)  # until after the request


def to_outer(loop: MonitoredLoop) -> None:
    loop.intrude(3500.0)
    loop.until(State.OUTER, limit_s=10.0)
    loop.run(1.5)


def to_inner(loop: MonitoredLoop) -> None:
    loop.intrude(1200.0)
    loop.until(State.INNER, limit_s=10.0)
    loop.run(0.3)
    assert loop.state is State.INNER


def to_releasing(loop: MonitoredLoop) -> None:
    """Clear of traffic, but the mode request for the release does not reach the autopilot."""
    loop.intrude(3500.0, goes_s=3.0)
    loop.until(State.OUTER, limit_s=10.0)
    loop.drops = is_mode_request
    loop.until(State.RELEASING, limit_s=30.0)
    loop.run(0.7)


STATES = {
    State.ENGAGING: to_engaging,
    State.OUTER: to_outer,
    State.INNER: to_inner,
    State.RELEASING: to_releasing,
}


def in_state(autopilot: Autopilot, state: State, config: EngineConfig | None = None) -> MonitoredLoop:
    """A flight on the mission, brought into one of the states that fly the aircraft."""
    parameters = HOLDS if autopilot == PX4 else {}
    loop = MonitoredLoop(without_traffic(), autopilot=autopilot, parameters=parameters, config=config)
    loop.run(2.5)
    STATES[state](loop)
    assert loop.state is state
    return loop
