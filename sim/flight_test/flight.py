"""One flight test from connecting to giving the aircraft back. All times are the vehicle's own."""

import asyncio
import contextlib
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
from sim.flight_test.beside import Beside, beside
from sim.flight_test.deeds import Deeds, mode_number, set_mode, set_role
from sim.flight_test.judge import Judged, Leg
from sim.flight_test.mission import MissionFlown, shifted, with_waypoint
from sim.flight_test.observer import Observer, Sample
from sim.flight_test.plan import EncounterPlan, FlightTest
from sim.flight_test.preparation import Preparation
from sim.flight_test.result import Result
from sim.flight_test.station import StationError
from sim.flight_test.traffic import Meeting, Traffic
from sim.flight_test.wires import FlightTestError, Wires
from sim.vehicle import FakeVehicle, MissionItem

_COMPANION_WITHIN_S = 60.0  # of our time
_ON_LEG_WITHIN_S, _RESUMED_WITHIN_S = 600.0, 60.0
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
        self._wires = Wires(options.vehicle, options.clock, options.folder, options.seed)
        self._preparation = Preparation(self._wires, self._note)
        self._beside: Beside = beside(options.companion, options.folder, options.clock)
        self._mission: MissionFlown | None = None
        self._number = 1  # of the next intruder
        observer = self.observer
        observer.on_sample, observer.on_mode = self._sampled, self._mode_changed
        observer.on_text, observer.on_refusal = self._said, self._refused
        observer.on_command = self._commanded

    @property
    def observer(self) -> Observer:
        """The state of the vehicle."""
        return self._wires.observer

    async def run(self) -> Result:
        """Fly; the result. `CompanionError` when the test cannot begin; cancelling ends it in order."""
        begun_s = time.monotonic()
        async with self._wires.connect():
            try:
                await self._prepare()
                await self._fly_encounters()
            except (FlightTestError, StationError) as error:
                self.result.problem = str(error)
            finally:
                await asyncio.shield(self._give_back())
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
        await self._wires.until(
            lambda: mission.is_settled, _ON_LEG_WITHIN_S, "the aircraft did not come to its leg"
        )
        await self._wires.sleep(_READY_AFTER_S)

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
        await self._beside.start(self._wires.relay.local_port)
        self.result.companion = self._beside.name
        if not self._beside.on_our_link:
            return  # it may be at a link from which nothing is passed on
        begun_s = time.monotonic()
        while math.isinf(self.observer.companion_s):
            if time.monotonic() - begun_s > _COMPANION_WITHIN_S:
                raise FlightTestError(f"no heartbeat of companion ({self._beside.name})")
            await self._wires.pause()

    # --- encounters

    @property
    def _plans(self) -> list[EncounterPlan]:
        only, name = self.options.only, self.observer.name
        return [
            plan
            for plan in self.options.test.encounters
            if name in plan.autopilots and (not only or plan.name in only)
        ]

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
            if await self._wires.settles(lambda: mission.is_settled and self._fits(plan), _REJOINED_WITHIN_S):
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
        observer, wires = self.observer, self._wires
        meeting, frame = self._meeting(plan)
        flags = mavlink.ADSB_FLAGS_SIMULATED if self.options.simulated_flag else 0
        traffic = Traffic(plan, meeting, frame, self._number, flags=flags, seed=self.options.seed)
        self._number += len(plan.intruders)
        judged = Judged(plan, observer.now_s(), frame, traffic.intruders)
        judged.on_mission, judged.modes = observer.on_mission, [observer.mode]
        self.judged, self.doing = judged, plan.name
        self.result.encounters.append(judged)
        relay = wires.relay if self._beside.on_our_link else None
        deeds = Deeds(plan.actions, observer, wires.station, relay, self._beside, self._upload)
        try:
            await self._until_over(judged, traffic, deeds, meeting)
        finally:
            deeds.cancel()
            self.result.failures[plan.name] = judged.failures(observer.mode)
            self.judged = None
            self.result.rate = observer.time.rate
        await self._put_right(plan)

    async def _until_over(self, judged: Judged, traffic: Traffic, deeds: Deeds, meeting: Meeting) -> None:
        observer, plan = self.observer, judged.plan
        earliest_s = meeting.time_s + plan.lasts_s
        latest_s = earliest_s + plan.expect.back_within_s
        while observer.now_s() < latest_s:
            own = observer.sample
            assert own is not None
            for report in traffic.reports(observer.now_s(), judged.frame.to_ned_m(own.place)):
                self._wires.report(report)
            deeds.step(judged)
            if observer.now_s() >= earliest_s and deeds.done and judged.is_over:
                return
            await self._wires.pause()

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

    async def _put_right(self, plan: EncounterPlan) -> None:
        """Resume the mission when the encounter left the aircraft in another mode."""
        observer, station = self.observer, self._wires.station
        if any(action.role is not None for action in plan.actions):
            await set_role(station, Role.FLY)
        if not observer.on_mission:
            self._note(f"the test resumes the mission, after {observer.mode}")
            await set_mode(observer, station, "mission")
            problem = "the mission could not be resumed"
            await self._wires.until(lambda: observer.on_mission, _RESUMED_WITHIN_S, problem)

    async def _rejoin(self) -> None:
        """Lead the aircraft back to its leg if an encounter left it beside: no autopilot flies back to it."""
        mission, sample, number = self._the_mission, self.observer.sample, self.observer.sequence
        leg = mission.leg
        if sample is None or leg is None or number is None or mission.is_on_leg or not mission.can_begin:
            return
        self._note(f"{mission.off_leg_m()[0]:.0f} m beside the leg: a waypoint on it is added ahead")
        place = leg.ahead(sample.place, max(sample.speed_mps * _REJOIN_S, _REJOIN_M))
        await self._change_mission(with_waypoint(mission.items, number, place))

    async def _upload(self, what: str) -> None:
        """Upload the mission again, or one beside it, and go on with the same item."""
        items = self._the_mission.items
        await self._change_mission(shifted(items, _UPLOAD_SHIFT_M) if what == "shifted" else items)

    async def _change_mission(self, items: list[MissionItem]) -> None:
        number = self.observer.sequence
        await self._wires.station.upload(items)
        if number is not None:
            await self._wires.station.select_item(number)
        self._the_mission.replace(items)

    # --- after the encounters

    async def _give_back(self) -> None:
        """End Companion, give the aircraft back to its mission, and restore the parameters."""
        self.doing = "giving the aircraft back"
        observer = self.observer
        problem = await self._beside.stop()
        if observer.vehicle is not None:
            with contextlib.suppress(StationError):
                if observer.armed and self._mission is not None and not observer.on_mission:
                    await set_mode(observer, self._wires.station, "mission")
            problem = problem or await self._preparation.restore_parameters()
        self.result.problem = self.result.problem or problem
        self.doing = "done"

    # --- what the observer reports

    def _sampled(self, sample: Sample) -> None:
        leg: Leg | None = None if self._mission is None else self._mission.leg
        if self.judged is not None and leg is not None:
            self.judged.observe_position(sample, leg)

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


def _version_words(version: int | None) -> str | None:
    return None if not version else f"{version >> 24 & 0xFF}.{version >> 16 & 0xFF}.{version >> 8 & 0xFF}"
