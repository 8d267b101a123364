"""Ways in which somebody takes the aircraft from us, and ways to bring us into the states that have it."""

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
from tests.support.watched import Watched, alone, asks_for_a_mode

ARDUPILOT: Autopilot = "ardupilot"
PX4: Autopilot = "px4"
BOTH: tuple[Autopilot, ...] = (ARDUPILOT, PX4)
TICK_US = 100_000
MISSION_MODE = {ARDUPILOT: "AUTO", PX4: "MISSION"}
GUIDED_MODE = {ARDUPILOT: "GUIDED", PX4: "OFFBOARD"}
# PX4 then holds by itself when our stream ends, as is recommended.
HOLDS = {"COM_OBL_RC_ACT": 5.0}

# --- how somebody takes the aircraft, and what says so


@dataclass(frozen=True)
class Taking:
    """What somebody does, and the first message that tells of it."""

    name: str
    does: Callable[[Watched], None]
    says: Callable[[Fact], bool]

    def __str__(self) -> str:
        return self.name


def mode(name: str) -> Taking:
    return Taking(name, lambda loop: loop.world.vehicle.set_mode(name), _heartbeat_of(name))


def _heartbeat_of(name: str) -> Callable[[Fact], bool]:
    def says(fact: Fact) -> bool:
        return isinstance(fact, Heartbeat) and name in (
            ArduPlane.mode_name(fact.custom_mode),
            Px4FixedWing.mode_name(fact.custom_mode),
        )

    return says


def disarm(loop: Watched) -> None:
    loop.world.vehicle.flight.armed = False


def land(loop: Watched) -> None:
    """The autopilot says that it lands, whatever its mode."""

    def landing(message: Message) -> Message:
        if message.get_type() == "EXTENDED_SYS_STATE":
            message.landed_state = mavlink.MAV_LANDED_STATE_LANDING
        return message

    loop.altered = landing


def break_the_fence(loop: Watched, *, action: float) -> None:
    """A zone to keep out of is suddenly where the aircraft is, unknown to us."""
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


STICKS = Taking(
    "sticks",
    lambda loop: loop.world.vehicle.move_sticks(roll=0.5),
    lambda fact: isinstance(fact, RcChannels) and fact.pulses_us[0] == 1700,
)
RUDDER = Taking(
    "rudder",
    lambda loop: loop.world.vehicle.move_sticks(yaw=-0.4),
    lambda fact: isinstance(fact, RcChannels) and fact.pulses_us[3] == 1340,
)
DISARMED = Taking("disarmed", disarm, lambda fact: isinstance(fact, Heartbeat) and not fact.armed)
LANDING = Taking("landing", land, lambda fact: isinstance(fact, LandedState) and fact.landed_state == 4)
FAILSAFE = Taking("failsafe", lambda loop: loop.world.vehicle.fail_safe(True), failing)
FAILSAFE_HOME = Taking(
    "failsafe home", lambda loop: loop.world.vehicle.fail_safe(True, return_home=True), failing
)
FENCE = Taking(
    "fence",
    lambda loop: break_the_fence(loop, action=0.0),
    lambda fact: isinstance(fact, FenceStatus) and fact.breached,
)
FENCE_HOME = Taking("fence home", lambda loop: break_the_fence(loop, action=1.0), FENCE.says)
FENCE_HOLD = Taking("fence hold", lambda loop: break_the_fence(loop, action=2.0), _heartbeat_of("HOLD"))

COMMON = (STICKS, RUDDER, DISARMED, LANDING, FAILSAFE, FAILSAFE_HOME)
WAYS: dict[Autopilot, tuple[Taking, ...]] = {
    ARDUPILOT: (
        *COMMON,
        FENCE,
        FENCE_HOME,
        *map(mode, ("MANUAL", "FBWA", "CRUISE", "LOITER", "RTL", "AVOID_ADSB", "AUTO")),
    ),
    PX4: (
        *COMMON,
        FENCE_HOLD,
        *map(mode, ("MANUAL", "STABILIZED", "ALTCTL", "POSCTL", "HOLD", "RETURN", "LAND", "MISSION")),
    ),
}

# --- what we are doing when he does


def to_engaging(loop: Watched) -> None:
    """The autopilot does not hear that we want it."""
    loop.deaf = asks_for_a_mode
    loop.intrude(3500.0)
    loop.until(State.ENGAGING, limit_s=10.0)
    loop.run(0.7)  # the request is on its way


def to_outer(loop: Watched) -> None:
    loop.intrude(3500.0)
    loop.until(State.OUTER, limit_s=10.0)
    loop.run(1.5)


def to_inner(loop: Watched) -> None:
    loop.intrude(1200.0)
    loop.until(State.INNER, limit_s=10.0)
    loop.run(0.3)
    assert loop.state is State.INNER


def to_releasing(loop: Watched) -> None:
    """Clear of traffic, but the autopilot does not hear that it is given back."""
    loop.intrude(3500.0, goes_s=3.0)
    loop.until(State.OUTER, limit_s=10.0)
    loop.deaf = asks_for_a_mode
    loop.until(State.RELEASING, limit_s=30.0)
    loop.run(0.7)


STATES = {
    State.ENGAGING: to_engaging,
    State.OUTER: to_outer,
    State.INNER: to_inner,
    State.RELEASING: to_releasing,
}


def begun(autopilot: Autopilot, state: State, config: EngineConfig | None = None) -> Watched:
    """In the air on the mission, and in one of the states that have the aircraft."""
    loop = Watched(alone(), autopilot=autopilot, parameters=_known(autopilot), config=config)
    loop.run(2.5)
    STATES[state](loop)
    assert loop.state is state
    return loop


def _known(autopilot: Autopilot) -> dict[str, float]:
    return HOLDS if autopilot == PX4 else {}
