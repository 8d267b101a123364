"""A random aircraft for the engine: it obeys most commands, with overrides, failures and intruders."""

import math
import random
from collections.abc import Sequence
from typing import TypeVar

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    AirData,
    AttitudeTarget,
    CommandResult,
    Fact,
    FenceStatus,
    Heartbeat,
    LandedState,
    OwnPosition,
    Parameter,
    RcChannels,
    Traffic,
)
from companion.model import TrafficReport, TrafficSource
from tests.support.junk_facts import AUTOPILOT, T0, US

ARDUPILOT, PX4 = 3, 12
GUIDED = {ARDUPILOT: 15, PX4: 6 << 16}
MISSION = {ARDUPILOT: 10, PX4: 4 << 16 | 4 << 24}
OTHER_MODES = {ARDUPILOT: (0, 5, 11, 12, 14), PX4: (1 << 16, 3 << 16, 4 << 16 | 3 << 24, 4 << 16 | 5 << 24)}
QUERIES = frozenset({mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE})
_T = TypeVar("_T")


class RandomAircraft:
    """An aircraft that obeys most commands, with random overrides, failures and intruders."""

    def __init__(self, chance: random.Random, autopilot: int) -> None:
        self.chance = chance
        self.autopilot = autopilot
        self.mode = MISSION[autopilot]
        self.armed, self.status, self.landed, self.height_m = True, 4, 2, 300.0
        self.breached, self.sticks_us = False, 1500
        self.silent_until_s = self.hidden_until_s = -math.inf
        self.parameters = {"FW_AIRSPD_TRIM": 20.0, "COM_OBL_RC_ACT": 5.0}
        self._answers: list[Fact] = []
        self._meet_s = T0 + 40.0

    def receive(self, message: Message) -> None:
        """Obey a command, or not."""
        command = getattr(message, "command", None)
        if message.get_type() == "PARAM_SET" and message.target_component == 1:
            self.parameters[str(message.param_id)] = message.param_value
            self._answers.append(Parameter(AUTOPILOT, str(message.param_id), message.param_value))
        if (
            message.get_type() not in ("COMMAND_LONG", "COMMAND_INT")
            or command in QUERIES
            or self.chance.random() < 0.2
        ):
            return
        result = self.chance.choice((0, 0, 0, 0, 0, 1, 2, 4, 5))
        if result == 0 and command == mavlink.MAV_CMD_DO_SET_MODE:
            wanted = round(message.param2)
            self.mode = wanted if self.autopilot == ARDUPILOT else wanted << 16 | round(message.param3) << 24
        if self.chance.random() < 0.8:
            self._answers.append(CommandResult(AUTOPILOT, command, result, self.chance.choice((None, US))))

    def advance(self, now_s: float) -> None:
        """Let random events happen, for a tenth of a second."""
        pick = self.chance
        self.mode = self._rarely(0.004, self.mode, (*OTHER_MODES[self.autopilot], MISSION[self.autopilot]))
        if self.mode not in (GUIDED[self.autopilot], MISSION[self.autopilot]):
            self.mode = self._rarely(0.02, self.mode, (MISSION[self.autopilot],))
        self.armed = self._rarely(0.03 if not self.armed else 0.002, self.armed, (not self.armed,))
        self.status = self._rarely(0.03 if self.status != 4 else 0.002, self.status, (4, 5))
        self.landed = self._rarely(0.03 if self.landed != 2 else 0.002, self.landed, (2, 1, 4))
        self.breached = self._rarely(0.03 if self.breached else 0.002, self.breached, (not self.breached,))
        self.sticks_us = self._rarely(0.02 if self.sticks_us != 1500 else 0.003, self.sticks_us, (1500, 1900))
        self.height_m = self._rarely(0.02, self.height_m, (300.0, 300.0, 10.0, 29.0, 320.0))
        if pick.random() < 0.003:
            self.silent_until_s = now_s + pick.choice((0.5, 2.0, 7.0))
        if pick.random() < 0.003:
            self.hidden_until_s = now_s + pick.choice((0.7, 3.0, 7.0))
        if now_s > self._meet_s:
            self._meet_s = now_s + pick.uniform(20.0, 60.0)

    def facts(self, now_s: float, tick: int) -> list[Fact]:
        """Telemetry, answers and one intruder."""
        answers, self._answers = self._answers, []
        if now_s < self.silent_until_s:
            return []
        facts: list[Fact] = [*answers, AirData(AUTOPILOT, 22.0), AttitudeTarget(AUTOPILOT, True)]
        if now_s >= self.hidden_until_s:
            lat_deg, height_m = -35.0 + (now_s - T0) * 22.0 / 110_940.0, self.height_m
            velocity_mps = 22.0, 0.0, 0.0
            facts.append(
                OwnPosition(
                    AUTOPILOT, now_s - T0, lat_deg, 149.0, 584.0 + height_m, height_m, velocity_mps, 0.0
                )
            )
        if tick % 3 == 0:
            facts.append(Heartbeat(AUTOPILOT, 1, self.autopilot, self.armed, self.mode, self.status))
            facts.append(RcChannels(AUTOPILOT, (self.sticks_us, 1500, 1000, 1500)))
            facts.append(FenceStatus(AUTOPILOT, self.breached))
            facts.append(LandedState(AUTOPILOT, self.landed))
        if tick % 10 == 0:
            facts += [Parameter(AUTOPILOT, name, value) for name, value in self.parameters.items()]
            left_s = self._meet_s - now_s
            north_m = (now_s - T0 + left_s) * 22.0 + 60.0 * left_s
            report = TrafficReport(
                TrafficSource.ADSB,
                "A00001",
                now_s,
                -35.0 + north_m / 110_940.0,
                149.0,
                584.0 + self.height_m,
                course_rad=math.pi,
                ground_speed_mps=60.0,
                climb_mps=0.0,
                icao=0xA00001,
            )
            facts.append(Traffic(AUTOPILOT, report))
        return facts

    def _rarely(self, chance: float, present: _T, others: Sequence[_T]) -> _T:
        return self.chance.choice(others) if self.chance.random() < chance else present
