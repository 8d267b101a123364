"""Facts of every kind, as extreme as the translation from the wire lets them through."""

import math
import random

from companion.gcs.parameters import BY_NAME
from companion.mavlink.facts import (
    AirData,
    AttitudeTarget,
    AutopilotVersion,
    CommandRequest,
    CommandResult,
    Fact,
    FenceStatus,
    GeoidSeparation,
    Heartbeat,
    HeightAbove,
    HomePosition,
    LandedState,
    MissionAck,
    MissionCount,
    MissionItem,
    MissionProgress,
    NavigationTarget,
    OtherMissionMessage,
    OwnPosition,
    Parameter,
    ParameterRequest,
    ParameterSet,
    PressureAltitude,
    RcChannels,
    Sender,
    SystemTime,
    TerrainReport,
    Traffic,
    Wind,
)
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource

AUTOPILOT, US, GCS = Sender(1, 1), Sender(1, 196), Sender(255, 190)
SENDERS = (AUTOPILOT, AUTOPILOT, AUTOPILOT, US, GCS, Sender(1, 191), Sender(7, 1), Sender(0, 0))
T0 = 1_700_000_000.0
PARAMETERS = (
    "ADSB_ICAO_ID", "AIRSPEED_MIN", "AIRSPEED_MAX", "AIRSPEED_CRUISE", "ROLL_LIMIT_DEG", "LIM_ROLL_CD",
    "TECS_CLMB_MAX", "TECS_SINK_MAX", "WP_LOITER_RAD", "AVD_ENABLE", "AVD_F_ACTION", "FENCE_ENABLE",
    "FENCE_TYPE", "FENCE_OPTIONS", "FENCE_RADIUS", "FENCE_ALT_MIN", "FENCE_ALT_MAX", "FENCE_MARGIN",
    "MIS_TOTAL", "FENCE_TOTAL", "FW_AIRSPD_MIN", "FW_AIRSPD_MAX", "FW_AIRSPD_TRIM", "FW_R_LIM",
    "NAV_TRAFF_AVOID", "GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST", "COM_OBL_RC_ACT", "NOBODY_KNOWS_IT",
)  # fmt: skip


class Junk:
    """Facts of every kind, as extreme as the translation lets them through."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self._kinds = (
            self._heartbeat, self._position, self._air, self._heights, self._mission, self._answers,
            self._control, self._requests, self._traffic, self._places,
        )  # fmt: skip

    def fact(self, now_s: float) -> Fact:
        sender = self._chance.choice(SENDERS)
        return self._chance.choice(self._kinds)(sender, now_s)

    def number(self, largest: float = 3.4e38) -> float:
        pick = self._chance.random()
        if pick < 0.3:
            return self._chance.choice((0.0, -0.0, 1.0, -1.0, 2.0, 3.0, 65535.0, largest, -largest))
        return self._chance.uniform(-1.0, 1.0) * 10.0 ** self._chance.uniform(-3.0, math.log10(largest))

    def place(self) -> tuple[float, float]:
        if self._chance.random() < 0.5:
            return self._chance.gauss(-35.0, 0.02), self._chance.gauss(149.0, 0.02)
        return self._chance.choice((90.0, -90.0, self._chance.uniform(-90, 90))), self._chance.choice(
            (180.0, -180.0, self._chance.uniform(-180, 180))
        )

    def _target(self) -> Sender:
        return self._chance.choice((US, Sender(1, 0), Sender(0, 0), AUTOPILOT, Sender(255, 190)))

    def _heartbeat(self, sender: Sender, _now_s: float) -> Fact:
        pick = self._chance
        modes = (
            10,
            15,
            12,
            0,
            6 << 16,
            4 << 16 | 4 << 24,
            4 << 16 | 3 << 24,
            2**32 - 1,
            pick.randrange(2**32),
        )
        return Heartbeat(
            sender, pick.randrange(45), pick.choice((0, 3, 8, 12)), pick.random() < 0.8, pick.choice(modes),
            pick.choice((0, 3, 4, 4, 4, 5, 6, 8)),
        )  # fmt: skip

    def _position(self, sender: Sender, now_s: float) -> Fact:
        velocity = tuple(self._chance.choice((0.0, self._chance.uniform(-327.68, 327.67))) for _ in range(3))
        heading_rad = self._chance.choice((None, self._chance.uniform(0.0, 2 * math.pi)))
        return OwnPosition(
            sender, self._chance.choice((0.0, now_s - T0, 4e6)), *self.place(),
            self._chance.uniform(-500, 5_000), self.number(2_147_483.0), velocity, heading_rad,  # type: ignore[arg-type]
        )  # fmt: skip

    def _air(self, sender: Sender, _now_s: float) -> Fact:
        return self._chance.choice(
            (
                AirData(sender, self._chance.choice((None, 0.0, abs(self.number(300.0))))),
                PressureAltitude(sender, self._chance.uniform(-2_000, 30_000)),
                GeoidSeparation(sender, self._chance.uniform(-200, 200)),
                Wind(sender, self.number(), self.number()),
            )
        )

    def _heights(self, sender: Sender, _now_s: float) -> Fact:
        return self._chance.choice(
            (
                FenceStatus(sender, self._chance.random() < 0.2),
                LandedState(sender, self._chance.choice((None, 1, 2, 2, 2, 3, 4))),
                TerrainReport(
                    sender,
                    *self.place(),
                    self._chance.uniform(-500, 9_000),
                    self._chance.uniform(-9_000, 9_000),
                ),
                HomePosition(sender, *self.place(), self.number(2_147_483.0)),
            )
        )

    def _mission(self, sender: Sender, _now_s: float) -> Fact:
        pick, target = self._chance, self._target()
        kind, sequence = pick.choice((0, 1, 2, 255)), pick.choice((0, 1, 2, 65535))
        lat_deg, lon_deg = self.place() if pick.random() < 0.8 else (None, None)
        command = pick.choice(
            (16, 17, 18, 20, 21, 22, 82, 177, 178, 189, 5000, 5001, 5002, 5003, 5004, 65535)
        )
        params = tuple(pick.choice((None, self.number())) for _ in range(4))
        height_m = pick.choice((None, self.number(100_000.0)))
        return pick.choice(
            (
                MissionProgress(sender, sequence, pick.choice((None, 1, 65534)), pick.choice((None, 9))),
                MissionItem(
                    sender, target, kind, sequence, command, params, lat_deg, lon_deg, height_m,  # type: ignore[arg-type]
                    pick.choice(list(HeightAbove)),
                ),
                MissionCount(sender, target, kind, pick.choice((0, 1, 3, 65535))),
                MissionAck(sender, target, kind, pick.randrange(20)),
                OtherMissionMessage(sender, target, kind),
            )
        )  # fmt: skip

    def _answers(self, sender: Sender, _now_s: float) -> Fact:
        pick = self._chance
        commands = (176, 192, 511, 512, 224, 43000, 43001, 43002, 65535)
        return pick.choice(
            (
                CommandResult(
                    sender, pick.choice(commands), pick.randrange(11), pick.choice((None, US, GCS))
                ),
                Parameter(sender, pick.choice(PARAMETERS), self.number()),
                AutopilotVersion(sender, "4.7", 4, 7, pick.randrange(2**32)),
                SystemTime(sender, pick.choice((None, self.number(1.8e13)))),
            )
        )

    def _control(self, sender: Sender, _now_s: float) -> Fact:
        pick = self._chance
        pulses = tuple(pick.choice((None, 1500, 1000, 65534)) for _ in range(pick.randrange(19)))
        return pick.choice((RcChannels(sender, pulses), AttitudeTarget(sender, pick.random() < 0.5)))

    def _requests(self, sender: Sender, _now_s: float) -> Fact:
        pick, target = self._chance, self._target()
        params = tuple(pick.choice((None, self.number())) for _ in range(4))
        name = pick.choice((*BY_NAME, "X"))
        return pick.choice(
            (
                CommandRequest(sender, target, pick.choice((176, 193, 400, 0, 65535)), params),  # type: ignore[arg-type]
                ParameterRequest(sender, target, pick.choice((None, name)), pick.choice((None, 0, 32767))),
                ParameterSet(sender, target, name, pick.choice((None, 5.0, 80.0, self.number()))),
            )
        )  # fmt: skip

    def _traffic(self, sender: Sender, now_s: float) -> Fact:
        pick = self._chance
        icao = pick.choice((0, 1, 0xFFFFFF, pick.randrange(1 << 24)))
        lat_deg, lon_deg = self.place() if pick.random() < 0.9 else (None, None)
        report = TrafficReport(
            pick.choice(list(TrafficSource)),
            f"{icao:06X}",
            now_s - pick.choice((0.0, 1.0, 255.0)),
            lat_deg,
            lon_deg,
            pick.choice((None, pick.uniform(-1_000, 40_000))),
            pick.choice(list(AltitudeReference)),
            pick.choice((None, pick.uniform(0, 6.28))),
            pick.choice((None, pick.uniform(0, 655))),
            pick.choice((None, pick.uniform(-327, 327))),
            kind=pick.choice(list(TrafficKind)),
            icao=icao or None,
            airborne=pick.random() < 0.9,
        )
        return Traffic(sender, report)

    def _places(self, sender: Sender, _now_s: float) -> Fact:
        return NavigationTarget(sender, *self.place(), self._chance.choice((None, self.number(40_000.0))))
