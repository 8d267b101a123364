"""The traffic of an encounter: intruders aimed at where the aircraft will be, and a simulated receiver."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.model import Vec3
from sim.flight_test.plan import EncounterPlan, IntruderPlan
from sim.receivers.mavlink import ALL_VALID
from sim.traffic import AdsbReceiver, Intruder, Maneuver, ReceiverModel
from sim.world import aside

_FIRST_ICAO = 0xF00001
_GONE_AFTER_S = 60.0  # after the meeting


@dataclass(frozen=True)
class Meeting:
    """Where the aircraft would be at a time if it flew on, north-east-down [m], with its velocity."""

    time_s: float
    position_m: Vec3
    velocity_mps: Vec3


def aimed(plan: IntruderPlan, meeting: Meeting, number: int) -> Intruder:
    """The intruder of a plan on its whole path; `number` makes its address and its name."""
    own_north_mps, own_east_mps, _ = meeting.velocity_mps
    own_course_rad = math.atan2(own_east_mps, own_north_mps)
    course_rad = own_course_rad + math.radians(plan.from_deg) + math.pi
    north_mps, east_mps = plan.speed_mps * math.cos(course_rad), plan.speed_mps * math.sin(course_rad)
    aside_n, aside_e = aside(north_mps - own_north_mps, east_mps - own_east_mps, own_course_rad)
    north_m, east_m, down_m = meeting.position_m
    met_m = (
        north_m + plan.miss_m * aside_n,
        east_m + plan.miss_m * aside_e,
        down_m - plan.miss_height_m,
    )
    at_s = meeting.time_s + plan.meets_after_s
    begins_s = at_s - plan.appears_s
    maneuvers = tuple(
        Maneuver(at_s + turn.at_s, math.radians(turn.turn_deg_s), turn.climb_mps)
        for turn in sorted(plan.turns, key=lambda turn: turn.at_s)
    )
    turned_rad = _turned_before(maneuvers, at_s)
    velocity_mps = (
        plan.speed_mps * math.cos(course_rad - turned_rad),
        plan.speed_mps * math.sin(course_rad - turned_rad),
        -plan.climb_mps,
    )
    icao = _FIRST_ICAO + number if plan.icao is None else plan.icao
    anchor_s = min([begins_s, *(maneuver.at_s for maneuver in maneuvers)])
    path = Intruder(icao, f"TEST{number}", anchor_s, (0.0, 0.0, 0.0), velocity_mps, maneuvers)
    moved_m, _ = path.state_at(at_s)
    start_m = (met_m[0] - moved_m[0], met_m[1] - moved_m[1], met_m[2] - moved_m[2])
    return Intruder(
        icao,
        path.callsign,
        anchor_s,
        start_m,
        velocity_mps,
        maneuvers,
        appears_s=begins_s,
        disappears_s=at_s + _GONE_AFTER_S,
    )


def _turned_before(maneuvers: Sequence[Maneuver], until_s: float) -> float:
    """The angle turned until a time [rad], to the right."""
    turned_rad = 0.0
    for i, maneuver in enumerate(maneuvers):
        ends_s = min(maneuvers[i + 1].at_s if i + 1 < len(maneuvers) else until_s, until_s)
        turned_rad += maneuver.turn_rate_rps * max(ends_s - maneuver.at_s, 0.0)
    return turned_rad


class Traffic:
    """The intruders of one encounter and the reports of a receiver beside the autopilot."""

    def __init__(
        self,
        plan: EncounterPlan,
        meeting: Meeting,
        frame: LocalFrame,
        first_number: int,
        *,
        flags: int = 0,
        seed: int = 0,
    ) -> None:
        """`flags` are set in every report in addition to those of the plan."""
        numbered = list(enumerate(plan.intruders, first_number))
        # When each of them meets the aircraft.
        self.meetings_s = [meeting.time_s + each.meets_after_s for each in plan.intruders] or [meeting.time_s]
        self.intruders = tuple(aimed(each, meeting, number) for number, each in numbered)
        self._gaps = [
            [(meeting.time_s + each.meets_after_s + a, meeting.time_s + each.meets_after_s + b)
             for a, b in each.gaps_s]
            for each in plan.intruders
        ]  # fmt: skip
        self._receivers = [
            AdsbReceiver([one], frame, one.appears_s, model=_model(each, flags), seed=seed)
            for each, one in zip(plan.intruders, self.intruders, strict=True)
        ]

    def reports(self, now_s: float, own_m: Vec3) -> list[Message]:
        """The reports that are due; those in a gap are lost."""
        due: list[Message] = []
        for receiver, gaps in zip(self._receivers, self._gaps, strict=True):
            heard = receiver.reports(now_s, own_m)
            if not any(begin_s <= now_s < end_s for begin_s, end_s in gaps):
                due += heard
        return due


def _model(plan: IntruderPlan, flags: int) -> ReceiverModel:
    geometric = ALL_VALID & ~mavlink.ADSB_FLAGS_BARO_VALID
    return ReceiverModel(
        period_s=plan.period_s,
        horizontal_sigma_m=plan.sigma_m,
        vertical_sigma_m=plan.sigma_m / 3.0,
        delay_s=plan.delay_s,
        loss=plan.loss,
        flags=(geometric if plan.flags is None else plan.flags) | flags,
    )
