"""One flight test from connecting to giving the aircraft back. All times are the vehicle's own."""

import asyncio
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from companion.errors import ConfigError
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.model import Role
from sim.clock import ScaledClock
from sim.flight_test.connections import Connections, FlightTestError
from sim.flight_test.judge import Judged
from sim.flight_test.mission import MissionFlown, shifted, with_waypoint
from sim.flight_test.observer import Observer, Sample
from sim.flight_test.pilot import PilotActions, mode_name, mode_number, set_mode, set_role
from sim.flight_test.plan import EncounterPlan, FlightTest
from sim.flight_test.preparation import Preparation
from sim.flight_test.result import Result
from sim.flight_test.station import StationError
from sim.flight_test.traffic import Meeting, Traffic
from sim.flight_test.under_test import CompanionUnderTest, companion_under_test
from sim.vehicle import FakeVehicle, MissionItem

_COMPANION_WITHIN_S = 60.0  # of our time
_ON_LEG_WITHIN_S = 600.0
# A mode that was requested is waited for this often, this long.
_SHOWN_AFTER, _SHOWN_EVERY_S = 20, 0.25
_READY_AFTER_S = 8.0  # for Companion to read parameters and mission
# The aircraft needs more of its leg than until the meeting.
_LEG_MARGIN_S = 60.0
# A waypoint that leads back to the leg is this far ahead.
_REJOIN_S, _REJOIN_M = 60.0, 1200.0
_REJOINED_WITHIN_S, _ATTEMPTS = 200.0, 4
_UPLOAD_SHIFT_M = 60.0


@dataclass(frozen=True)
class Options:
    """What is flown. `vehicle` is a link, or a fake vehicle in this process that flies by `clock`."""

    test: FlightTest
    vehicle: str | FakeVehicle
    folder: Path
    clock: ScaledClock | None = None
    inside: bool = False  # Companion runs in this process, by `clock`
    companion: str | None = None
    set_parameters: bool = False
    real_aircraft: bool = False
    simulated_flag: bool = False
    only: tuple[str, ...] = ()
    seed: int = 0


class Flight:
    """Flies one test; `result` grows while it does, and `doing` says in words what happens."""

    def __init__(
        self, options: Options, on_event: Callable[[float, str], None] = lambda _s, _text: None
    ) -> None:
        self.options, self.result = options, Result()
        self.doing = "waiting for the vehicle"
        self.judged: Judged | None = None  # the encounter that is flown
        self._on_event = on_event
        self._connections = Connections(options.vehicle, options.clock, options.folder, options.seed)
        self._preparation = Preparation(self._connections, self._note)
        self._companion: CompanionUnderTest = companion_under_test(
            options.companion, options.folder, options.clock
        )
        self._mission: MissionFlown | None = None
        self._number = 1  # of the next intruder
        observer = self.observer
        observer.on_sample, observer.on_mode = self._sampled, self._mode_changed
        observer.on_text, observer.on_refusal = self._said, self._refused
        observer.on_command = self._commanded
        self._connections.check = self._check_companion
        self._role: int | None = None  # of Companion at the start
        self._ours: set[str] = set()  # modes that the present encounter led to

    @property
    def observer(self) -> Observer:
        """The state of the vehicle."""
        return self._connections.observer

    async def run(self) -> Result:
        """Fly; the result. `CompanionError` when the test cannot begin; cancelling ends it in order."""
        begun_s = time.monotonic()
        async with self._connections.connect():
            try:
                await self._prepare()
                await self._fly_encounters()
            except (FlightTestError, StationError) as error:
                self.result.problem = str(error)
            except asyncio.CancelledError:
                _uncancel()
                self.result.problem = "interrupted"
            finally:
                await self._give_back()
        self.result.wall_s = time.monotonic() - begun_s
        return self.result

    async def _prepare(self) -> None:
        preparation, options, observer = self._preparation, self.options, self.observer
        await preparation.find_vehicle()
        self.result.autopilot = observer.name
        self.result.simulation = await preparation.check_simulated(real_aircraft=options.real_aircraft)
        self.result.version = _version_words(observer.version)
        self._check_modes()
        wanted = next((p for name, p in options.test.parameters.items() if name == observer.name), {})
        await preparation.set_parameters(wanted, allowed=options.set_parameters)
        await preparation.request_rates()
        await self._start_companion()
        self.doing = "taking off"
        self._mission = mission = await preparation.take_off(options.test.mission)
        self.doing = "climbing to the leg"
        await self._connections.until(
            lambda: mission.is_settled, _ON_LEG_WITHIN_S, "the aircraft did not come to its leg"
        )
        await self._connections.sleep(_READY_AFTER_S)

    def _check_modes(self) -> None:
        """Refuse a plan with a mode that the autopilot does not have, before anything is flown."""
        for plan in self._plans:
            for name in [*(action.mode for action in plan.actions), plan.expect.mode]:
                try:
                    if name is not None:
                        mode_number(self.observer, name)
                except ValueError as error:
                    raise ConfigError(f"encounter {plan.name}: {error}") from error

    async def _start_companion(self) -> None:
        self.doing = "starting companion"
        await self._companion.start(self._connections.relay.local_port)
        self.result.companion = self._companion.name
        if not self._companion.on_our_link:
            return  # it may be at a link from which nothing is passed on
        begun_s = time.monotonic()
        while math.isinf(self.observer.companion_s):
            if time.monotonic() - begun_s > _COMPANION_WITHIN_S:
                raise FlightTestError(f"no heartbeat of companion ({self._companion.name})")
            await self._connections.pause()
        self._role = self.observer.role

    def _check_companion(self) -> None:
        """`FlightTestError` when Companion ended by itself."""
        if self._companion.ended:
            raise FlightTestError("companion ended during the flight")

    # --- encounters

    @property
    def _plans(self) -> list[EncounterPlan]:
        """The encounters that can be flown here, of those that were chosen."""
        only, name = self.options.only, self.observer.name
        return [
            plan
            for plan in self.options.test.encounters
            if name in plan.autopilots and (not only or plan.name in only) and self._can_be_flown(plan)
        ]

    def _can_be_flown(self, plan: EncounterPlan) -> bool:
        """Whether Companion can be disturbed and observed as the plan needs."""
        stalls = any(action.stall_s is not None for action in plan.actions)
        needs_link = any(action.link is not None or action.claims for action in plan.actions)
        return (self._companion.can_stall or not stalls) and (self._companion.on_our_link or not needs_link)

    async def _fly_encounters(self) -> None:
        chosen = self._plans
        names = {plan.name for plan in chosen}
        self.result.left_out = [p.name for p in self.options.test.encounters if p.name not in names]
        for plan in chosen:
            self.doing = f"waiting for the leg before {plan.name}"
            await self._settle(plan)
            await self._fly(plan)

    async def _settle(self, plan: EncounterPlan) -> None:
        """Wait until the aircraft flies along a leg, and lead it there when it does not come by itself."""
        mission = self._the_mission
        for _ in range(_ATTEMPTS):
            await self._rejoin()
            if await self._connections.settles(
                lambda: mission.is_settled and self._fits(plan), _REJOINED_WITHIN_S
            ):
                return
        why = "the leg is too short for" if mission.is_settled else "not on its leg before"
        raise FlightTestError(f"{why} {plan.name}, in {self.observer.mode}")

    def _fits(self, plan: EncounterPlan) -> bool:
        """Whether enough of the present leg is left for an encounter."""
        leg, sample = self._the_mission.leg, self.observer.sample
        if leg is None or sample is None:
            return False
        frame = LocalFrame(sample.place.lat_deg, sample.place.lon_deg)
        left_m = math.hypot(*frame.to_north_east_m(leg.end.lat_deg, leg.end.lon_deg))
        return left_m >= sample.speed_mps * (plan.meets_s + _LEG_MARGIN_S)

    async def _fly(self, plan: EncounterPlan) -> None:
        observer, connections = self.observer, self._connections
        meeting, frame = self._meeting(plan)
        flags = mavlink.ADSB_FLAGS_SIMULATED if self.options.simulated_flag else 0
        traffic = Traffic(plan, meeting, frame, self._number, flags=flags, seed=self.options.seed)
        self._number += len(plan.intruders)
        judged = Judged(plan, observer.now_s(), frame, traffic.intruders, traffic.meetings_s)
        judged.on_mission, judged.modes = observer.on_mission, [observer.mode]
        if plan.expect.mode is not None:
            judged.expected_mode = mode_name(observer, plan.expect.mode)
        self.judged, self.doing = judged, plan.name
        self.result.encounters.append(judged)
        actions = PilotActions(
            plan.actions, observer, connections.station, connections.relay, self._companion, self._upload
        )
        self._ours = actions.modes
        try:
            await self._until_over(judged, traffic, actions)
        except BaseException:
            judged.problems.append("ended early")
            raise
        finally:
            judged.problems += [f"never done: {action}" for action in actions.never_done]
            await actions.end()
            self.result.failures[plan.name] = judged.failures(observer.mode)
            self.judged = None
            self.result.rate = observer.time.rate
        await self._put_right()

    async def _until_over(self, judged: Judged, traffic: Traffic, actions: PilotActions) -> None:
        observer, plan = self.observer, judged.plan
        earliest_s = max(traffic.meetings_s) + plan.lasts_s
        latest_s = earliest_s + plan.expect.back_within_s
        while observer.now_s() < latest_s:
            own = observer.sample
            assert own is not None
            for report in traffic.reports(observer.now_s(), judged.frame.to_ned_m(own.place)):
                self._connections.report(report)
            actions.step(judged)
            if observer.now_s() >= earliest_s and actions.done and judged.is_over:
                return
            await self._connections.pause()

    def _meeting(self, plan: EncounterPlan) -> tuple[Meeting, LocalFrame]:
        """Where the aircraft will be on its leg when the intruders meet it."""
        leg, sample = self._the_mission.leg, self.observer.sample
        assert leg is not None
        assert sample is not None
        frame = LocalFrame(sample.place.lat_deg, sample.place.lon_deg)
        speed_mps = sample.speed_mps
        here = leg.ahead(sample.place, 0.0)
        there = leg.ahead(sample.place, speed_mps * plan.meets_s)
        climb_mps = (there.altitude_m - here.altitude_m) / plan.meets_s
        course_rad = leg.course_rad
        velocity_mps = speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), -climb_mps
        return Meeting(self.observer.now_s() + plan.meets_s, frame.to_ned_m(there), velocity_mps), frame

    # --- between encounters

    async def _put_right(self) -> None:
        """Restore the role and the mission that the encounter changed; what someone else chose is left."""
        await self._restore_role()
        problem = await self._resume_mission()
        if problem is not None:
            raise FlightTestError(problem)

    async def _restore_role(self) -> None:
        if self._role is not None and self.observer.role != self._role:
            await set_role(self._connections.station, Role(self._role))

    async def _resume_mission(self) -> str | None:
        """Go on with the mission after a mode that the test led to; a problem in words."""
        observer = self.observer
        if observer.on_mission:
            return None
        if not (observer.guided or observer.mode in self._ours):
            return f"the aircraft is in {observer.mode}, which is not of this test: it is left there"
        self._note(f"the test resumes the mission, after {observer.mode}")
        for _ in range(_ATTEMPTS):
            await set_mode(observer, self._connections.station, "mission")
            for _ in range(_SHOWN_AFTER):
                await asyncio.sleep(_SHOWN_EVERY_S)
                if self.observer.on_mission:
                    return None
        return f"the mission was not resumed, the aircraft is in {observer.mode}"

    async def _rejoin(self) -> None:
        """Lead the aircraft back to its leg if an encounter left it beside: no autopilot flies back to it."""
        mission, sample, number = self._the_mission, self.observer.sample, self.observer.sequence
        leg = mission.leg
        if sample is None or leg is None or number is None or mission.is_on_leg or not mission.can_begin:
            return
        if not mission.can_be_changed:
            raise FlightTestError("the aircraft is beside its leg, and a mission with jumps is not changed")
        self._note(f"{mission.off_leg_m()[0]:.0f} m beside the leg: a waypoint on it is added ahead")
        place = leg.ahead(sample.place, max(sample.speed_mps * _REJOIN_S, _REJOIN_M))
        await self._change_mission(with_waypoint(mission.items, number, place))

    async def _upload(self, what: str) -> None:
        """Upload the mission again, or one beside it, and go on with the same item."""
        items = self._the_mission.items
        await self._change_mission(shifted(items, _UPLOAD_SHIFT_M) if what == "shifted" else items)

    async def _change_mission(self, items: list[MissionItem]) -> None:
        number = self.observer.sequence
        await self._connections.station.upload(items)
        if number is not None:
            await self._connections.station.select_item(number)
        self._the_mission.replace(items)

    # --- after the encounters

    async def _give_back(self) -> None:
        """End Companion, give the aircraft back to its mission, and restore mission, role and parameters.

        Each step is tried, whatever became of the others.
        """
        self.doing = "giving the aircraft back"
        problems = [self.result.problem]
        for step in (
            self._restore_role,
            self._companion.stop,
            self._return_mission,
            self._restore_parameters,
        ):
            try:
                problems.append(await step())
            except Exception as error:  # noqa: BLE001 - the other steps must still be done
                problems.append(f"{error or type(error).__name__}")
        self.result.problem = next((problem for problem in problems if problem is not None), None)
        self.doing = "done"

    async def _return_mission(self) -> str | None:
        mission, observer = self._mission, self.observer
        if mission is None or not observer.armed:
            return None
        problem = await self._resume_mission()
        if problem is None and mission.flown_before and mission.items != mission.original:
            number = mission.original_number(observer.sequence or 0)
            await self._connections.station.upload(mission.original)
            await self._connections.station.select_item(number)
        return problem

    async def _restore_parameters(self) -> str | None:
        return await self._preparation.restore_parameters()

    # --- what the observer reports

    def _sampled(self, sample: Sample) -> None:
        if self.judged is not None:
            self.judged.observe_position(sample, None if self._mission is None else self._mission.leg)

    def _mode_changed(self, mode: str) -> None:
        observer = self.observer
        if self.judged is not None:
            guided, on_mission = observer.guided, observer.on_mission
            self.judged.observe_mode(observer.now_s(), mode, guided=guided, on_mission=on_mission)
        self._note(f"mode {mode}")

    def _said(self, who: str, text: str) -> None:
        if self.judged is not None:
            self.judged.note(self.observer.now_s(), f"{who}: {text}")
        self._note(f"{who}: {text}")

    def _refused(self, command: int, result: int) -> None:
        if self.judged is not None:
            self.judged.observe_refusal(command, result)

    def _commanded(self, message: Message) -> None:
        if self.judged is not None:
            self.judged.observe_command(self.observer.now_s(), message)

    def _note(self, text: str) -> None:
        now_s = self.observer.now_s()
        self._on_event(0.0 if math.isnan(now_s) else now_s, text)

    @property
    def _the_mission(self) -> MissionFlown:
        assert self._mission is not None
        return self._mission


def _uncancel() -> None:
    """Go on after a cancellation: giving back must not be cancelled by it."""
    task = asyncio.current_task()
    if task is not None:
        task.uncancel()


def _version_words(version: int | None) -> str | None:
    return None if not version else f"{version >> 24 & 0xFF}.{version >> 16 & 0xFF}.{version >> 8 & 0xFF}"
