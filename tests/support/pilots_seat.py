"""An aircraft on its mission with one intruder ahead, flown step by step from the pilot's seat."""

import math
from collections.abc import Callable

from companion.control.state_machine import State, SupervisorParams
from companion.engine import Effect, Engine, EngineConfig, EngineParams, Transmit
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    AirData,
    AttitudeTarget,
    AutopilotVersion,
    CommandResult,
    Fact,
    Heartbeat,
    LandedState,
    LinkAnswer,
    OwnPosition,
    Parameter,
    ParameterSet,
    Sender,
    Traffic,
)
from companion.model import TrafficReport, TrafficSource
from tests.support.missions import empty_missions

AUTOPILOT, US, GCS = Sender(1, 1), Sender(1, 196), Sender(255, 190)
T0 = 1_700_000_000.0
# MAV_AUTOPILOT; PX4 1.18 is told from earlier versions by its version.
ARDUPILOT, PX4, PX4_1_18 = 3, 12, 12 + 1_000
AUTO, LOITER, GUIDED, FBWA = 10, 12, 15, 5
HOLD, MISSION, OFFBOARD = 4 << 16 | 3 << 24, 4 << 16 | 4 << 24, 6 << 16
GUIDED_COURSE = 4 << 16 | 19 << 24
GUIDED_MODES = {ARDUPILOT: GUIDED, PX4: OFFBOARD, PX4_1_18: GUIDED_COURSE}
SET_MODE, SELECT_ITEM = mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_DO_SET_MISSION_CURRENT
REPOSITION, CHANGE_ALTITUDE = mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_CMD_DO_CHANGE_ALTITUDE
# The sticks, as pulses of a receiver [us].
CENTERED_US, MOVED_US = (1500, 1500, 1000, 1500), (1900, 1500, 1000, 1500)
_QUESTIONS = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE}
_ACTS = {"COMMAND_LONG", "COMMAND_INT", "SET_POSITION_TARGET_GLOBAL_INT", "PARAM_SET"}


def acts(message: Message) -> bool:
    """Whether a message changes what the aircraft does."""
    return message.get_type() in _ACTS and getattr(message, "command", None) not in _QUESTIONS


def asks_version(message: Message) -> bool:
    """Whether a message requests AUTOPILOT_VERSION."""
    asks = getattr(message, "command", None) == mavlink.MAV_CMD_REQUEST_MESSAGE
    return asks and message.param1 == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION


class Seat:
    """Obeys those mode and parameter commands that `obeys` accepts; a test changes everything else."""

    def __init__(self, autopilot: int = ARDUPILOT, rules: SupervisorParams | None = None) -> None:
        self.engine = Engine(
            EngineConfig(engine=EngineParams(autopilot_system_id=1), supervisor=rules or SupervisorParams())
        )
        self.autopilot = autopilot
        self.prior_mode = self.mode = AUTO if autopilot == ARDUPILOT else MISSION
        self.armed, self.status, self.finite = True, 4, True
        self.positions = self.heartbeats = self.intruder = True
        self.meet_s = T0 + 40.0
        self.trim_mps = 22.0
        self.obeys: Callable[[Message], bool] = lambda _message: True
        self.extra_facts: list[Fact] = []  # received at every tick
        self.height_m = 300.0
        self.transmits = True  # whether our messages arrive
        self.knows_mission = True  # whether it answers that there is none
        self.intruder_altitude_m = 884.0
        self.sink_mps = 0.0
        self.hovers = False  # the intruder stands still ahead of us, wherever we fly
        self.vehicle_type = 1
        self.sent: list[Message] = []
        self._answers: list[Fact] = []
        self._tick = 0

    @property
    def now_s(self) -> float:
        return T0 + self._tick / 10

    @property
    def state(self) -> State:
        return self.engine.supervisor.state

    def fly(self, seconds: float) -> list[Message]:
        """Fly on; returns the messages sent meanwhile that act on the aircraft."""
        first = len(self.sent)
        for _ in range(round(seconds * 10)):
            self._tick += 1
            for fact in self._telemetry():
                self.receive(fact)
            self._perform(self.engine.tick(self.now_s))
        return self.sent[first:]

    def until(self, *states: State, limit_s: float = 60.0) -> None:
        for _ in range(round(limit_s * 10)):
            if self.state in states:
                return
            self.fly(0.1)
        raise AssertionError(f"never came to {states}, stayed in {self.state}")

    def receive(self, fact: Fact) -> None:
        if self.engine.receive(fact, self.now_s):
            self._perform(self.engine.tick(self.now_s))

    def answer(self, command: int, result: int) -> None:
        self.receive(CommandResult(AUTOPILOT, command, result, US))

    def set_role(self, role: int) -> None:
        self.receive(ParameterSet(GCS, US, "CA_ROLE", float(role)))

    def stop(self) -> None:
        self._perform(self.engine.request_stop(self.now_s))

    def _perform(self, effects: list[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Transmit) and effect.message.get_type() == "TIMESYNC" and self.transmits:
                self._answers.append(LinkAnswer(AUTOPILOT, self.now_s))
            if isinstance(effect, Transmit) and self.knows_mission:
                self._answers += empty_missions([effect.message], AUTOPILOT, US)
            if isinstance(effect, Transmit) and self.autopilot == PX4_1_18 and asks_version(effect.message):
                self._answers.append(AutopilotVersion(AUTOPILOT, "1.18.0", 1, 18, capabilities=0))
            if isinstance(effect, Transmit) and acts(effect.message):
                self.sent.append(effect.message)
                if self.obeys(effect.message):
                    self._obey(effect.message)

    def _obey(self, message: Message) -> None:
        if message.get_type() == "PARAM_SET":
            self.trim_mps = message.param_value
            self._answers.append(Parameter(AUTOPILOT, "FW_AIRSPD_TRIM", self.trim_mps))
        elif getattr(message, "command", None) == SET_MODE:
            wanted = round(message.param2)
            self.mode = wanted if self.autopilot == ARDUPILOT else wanted << 16 | round(message.param3) << 24
            self._answers.append(CommandResult(AUTOPILOT, SET_MODE, 0, US))

    def _telemetry(self) -> list[Fact]:
        now_s, flown_s = self.now_s, self.now_s - T0
        facts, self._answers = [*self._answers, *self.extra_facts, AirData(AUTOPILOT, 22.0)], []
        facts.append(AttitudeTarget(AUTOPILOT, self.finite))
        if self._tick == 1:
            facts.append(LandedState(AUTOPILOT, mavlink.MAV_LANDED_STATE_IN_AIR))
        if self._tick == 1:
            facts.append(Parameter(AUTOPILOT, "FW_AIRSPD_TRIM", self.trim_mps))
        if self.positions:
            lat_deg, height_m = -35.0 + flown_s * 22.0 / 110_940.0, self.height_m
            velocity_mps = 22.0, 0.0, self.sink_mps
            facts.append(
                OwnPosition(AUTOPILOT, flown_s, lat_deg, 149.0, 584.0 + height_m, height_m, velocity_mps, 0.0)
            )
        if self.heartbeats and self._tick % 2 == 0:
            mode = self.armed, self.mode, self.status
            facts.append(Heartbeat(AUTOPILOT, self.vehicle_type, self.autopilot % 1_000, *mode))
        if self.intruder and self._tick % 10 == 0:
            north_m = 22.0 * (self.meet_s - T0) + 60.0 * (self.meet_s - now_s)
            speed_mps, course_rad = 60.0, math.pi
            if self.hovers:
                north_m, speed_mps, course_rad = 22.0 * flown_s + 400.0, 22.0, 0.0
            report = TrafficReport(
                TrafficSource.ADSB, "A00001", now_s, -35.0 + north_m / 110_940.0, 149.0,
                self.intruder_altitude_m, course_rad=course_rad, ground_speed_mps=speed_mps, climb_mps=0.0,
                icao=0xA00001,
            )  # fmt: skip
            facts.append(Traffic(AUTOPILOT, report))
        return facts
