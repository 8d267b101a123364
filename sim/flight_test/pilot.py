"""The pilot's actions and the faults of an encounter, at their times."""

import asyncio
import math
from collections.abc import Awaitable, Callable

from companion.geodesy import LocalFrame
from companion.mavlink.dialect import mavlink
from companion.model import Role
from sim.faults import Faults
from sim.flight_test.judge import Claim, Judged
from sim.flight_test.observer import Observer
from sim.flight_test.plan import PILOT_MODES, Action, FlyTo, LinkFault, Sticks
from sim.flight_test.station import Station, StationError
from sim.flight_test.under_test import CompanionUnderTest
from sim.relay import Relay

_COMPANION = mavlink.MAV_COMP_ID_OBSTACLE_AVOIDANCE
_STICK_CENTRE_US, _STICK_REACH_US = 1500, 500
_STICKS_EVERY_S = 0.1
_IGNORED_US = 65_535
_ABSOLUTE_INT = mavlink.MAV_FRAME_GLOBAL_INT


class PilotActions:
    """Does the actions of one encounter, in the vehicle's time, each once and one after the other."""

    def __init__(
        self,
        actions: tuple[Action, ...],
        observer: Observer,
        station: Station,
        relay: Relay,
        companion: CompanionUnderTest,
        upload: Callable[[str], Awaitable[None]],
    ) -> None:
        self._waiting = list(actions)
        self._observer, self._station, self._relay, self._companion = observer, station, relay, companion
        self._upload = upload
        self._running: set[asyncio.Task[None]] = set()
        self._last_s: float | None = None
        self.modes: set[str] = set()  # that were requested

    @property
    def never_done(self) -> list[str]:
        """What has not been done, in words."""
        return [words(action, self._observer.name) for action in self._waiting]

    @property
    def done(self) -> bool:
        """Whether nothing more is to be done."""
        return not self._waiting and not self._running

    def step(self, judged: Judged) -> None:
        """Begin the next action when its time has come."""
        now_s = self._observer.now_s()
        while self._waiting:
            since_s = self._since_s(self._waiting[0], judged)
            if since_s is None or now_s < since_s + self._waiting[0].after_s:
                return
            action = self._waiting.pop(0)
            self._last_s = now_s
            self._begin(action, judged, now_s)

    def _since_s(self, action: Action, judged: Judged) -> float | None:
        if action.when == "last":
            return self._last_s
        moments = {"start": 0.0, "taken over": judged.first_action_s, "given back": judged.given_back_s}
        moment_s = moments[action.when]
        return None if moment_s is None else judged.begun_s + moment_s

    def _begin(self, action: Action, judged: Judged, now_s: float) -> None:
        judged.note(now_s, words(action, self._observer.name))
        if judged.claim is not None and action.mode == "mission":
            judged.claim.ended = True
        if action.claims:
            # What is not shown by a mode, or by the present one, is shown as soon as it is done.
            mode = None if action.mode is None else mode_name(self._observer, action.mode)
            shown = mode is None or judged.modes[-1:] == [mode]
            judged.claim = Claim(mode, shown_s=now_s if shown else None)
        if action.releases:
            judged.release_asked_s = now_s
        task = asyncio.create_task(self._do(action), name="pilot")
        self._running.add(task)
        task.add_done_callback(lambda done: self._ended(done, judged))

    def _ended(self, task: "asyncio.Task[None]", judged: Judged) -> None:
        self._running.discard(task)
        if not task.cancelled() and task.exception() is not None:
            judged.problems.append(str(task.exception()))

    async def end(self) -> None:
        """Do nothing more, and end the faults."""
        self._waiting.clear()
        running = list(self._running)
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)
        self._companion.stall(stalled=False)
        _mend(self._relay)

    async def _do(self, action: Action) -> None:
        if action.mode is not None:
            self.modes.add(mode_name(self._observer, action.mode))
            _demand(await set_mode(self._observer, self._station, action.mode), action.mode)
        elif action.fly_to is not None:
            await self._fly_to(action.fly_to)
        elif action.sticks is not None:
            await self._move_sticks(action.sticks)
        elif action.select_item is not None:
            await self._station.select_item(action.select_item)
        elif action.upload is not None:
            await self._upload(action.upload)
        elif action.role is not None:
            await set_role(self._station, Role[action.role.upper()])
        elif action.resume:
            resume = mavlink.MAV_CMD_DO_PAUSE_CONTINUE
            _demand(await self._station.companion_command(_COMPANION, resume, 1), "resume")
        elif action.stall_s is not None:
            await self._stall(action.stall_s)
        elif action.link is not None:
            await self._disturb(action.link)

    async def _fly_to(self, wanted: FlyTo) -> None:
        sample = self._observer.sample
        if sample is None:
            return
        course_rad = math.atan2(sample.velocity_mps[1], sample.velocity_mps[0])
        cos, sin = math.cos(course_rad), math.sin(course_rad)
        north_m = wanted.ahead_m * cos - wanted.right_m * sin
        east_m = wanted.ahead_m * sin + wanted.right_m * cos
        frame = LocalFrame(sample.place.lat_deg, sample.place.lon_deg)
        place = frame.to_geo(north_m, east_m, -sample.place.altitude_m)
        change_mode = 1
        result = await self._station.command_at(
            mavlink.MAV_CMD_DO_REPOSITION, (-1, change_mode, 0, math.nan),
            place.lat_deg, place.lon_deg, place.altitude_m, _ABSOLUTE_INT,
        )  # fmt: skip
        _demand(result, "fly here")

    async def _move_sticks(self, sticks: Sticks) -> None:
        until_s = self._observer.now_s() + sticks.for_s
        try:
            while self._observer.now_s() < until_s:
                await self._send_sticks(sticks)
                await asyncio.sleep(_STICKS_EVERY_S / max(self._observer.time.rate, 0.1))
        finally:
            if self._observer.name == "ardupilot":
                released = 0
                await self._station.send("RC_CHANNELS_OVERRIDE", self._channels(released, released))

    async def _send_sticks(self, sticks: Sticks) -> None:
        if self._observer.name == "px4":
            fields: dict[str, object] = {
                "target": self._station.target, "z": 500, "r": 0, "buttons": 0,
                "x": round(sticks.pitch * 1000), "y": round(sticks.roll * 1000),
            }  # fmt: skip
            await self._station.send("MANUAL_CONTROL", fields)
            return
        roll_us = _STICK_CENTRE_US + round(sticks.roll * _STICK_REACH_US)
        pitch_us = _STICK_CENTRE_US + round(sticks.pitch * _STICK_REACH_US)
        await self._station.send("RC_CHANNELS_OVERRIDE", self._channels(roll_us, pitch_us))

    def _channels(self, roll_us: int, pitch_us: int) -> dict[str, object]:
        channels: dict[str, object] = {"target_system": self._station.target, "target_component": 1}
        pulses = [roll_us, pitch_us, *(_IGNORED_US for _ in range(6))]
        return channels | {f"chan{i}_raw": pulse for i, pulse in enumerate(pulses, 1)}

    async def _stall(self, stall_s: float) -> None:
        self._companion.stall(stalled=True)
        try:
            await asyncio.sleep(stall_s)
        finally:
            self._companion.stall(stalled=False)

    async def _disturb(self, fault: LinkFault) -> None:
        relay = self._relay
        rate = max(self._observer.time.rate, 0.1)
        faults = Faults(
            fault.loss,
            fault.duplication,
            fault.delay_s / rate,
            fault.jitter_s / rate,
            fault.copy_after_s / rate,
        )
        relay.forth.faults = relay.back.faults = faults
        if fault.cut in ("both", "to companion"):
            relay.back.cut()
        if fault.cut in ("both", "from companion"):
            relay.forth.cut()
        try:
            await asyncio.sleep(fault.for_s / rate)
        finally:
            _mend(relay)


def _mend(relay: Relay) -> None:
    relay.forth.faults = relay.back.faults = Faults()
    relay.mend()


async def set_mode(observer: Observer, station: Station, wanted: str) -> int:
    """Request a mode as a ground station does; the MAV_RESULT."""
    number = mode_number(observer, wanted)
    if observer.name == "px4":
        return await station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, number >> 16 & 0xFF, number >> 24 & 0xFF)
    return await station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, number)


async def set_role(station: Station, role: Role) -> None:
    """Set Companion's role as a ground station does, by its parameter."""
    # Not by DO_SET_MODE: ArduPilot executes it itself when it does not know the component.
    fields: dict[str, object] = {
        "target_system": station.target, "target_component": _COMPANION, "param_id": "CA_ROLE",
        "param_value": float(role.value), "param_type": mavlink.MAV_PARAM_TYPE_REAL32,
    }  # fmt: skip
    await station.send("PARAM_SET", fields)


def _demand(result: int, what: str) -> None:
    """`StationError` unless a request of the pilot was accepted."""
    if result != mavlink.MAV_RESULT_ACCEPTED:
        raise StationError(f"{what}: {'not answered' if result < 0 else f'refused with {result}'}")


def mode_name(observer: Observer, wanted: str) -> str:
    """The autopilot's own name of a mode that is given by a common name or by its own."""
    return PILOT_MODES.get(wanted, {}).get(observer.name, wanted)


def mode_number(observer: Observer, wanted: str) -> int:
    """The custom mode of a name, common or the autopilot's own; `ValueError` if it has none of that name."""
    assert observer.adapter is not None
    name = mode_name(observer, wanted)
    numbers = range(256) if observer.name == "ardupilot" else [
        main << 16 | sub << 24 for main in range(1, 12) for sub in range(32)
    ]  # fmt: skip
    for number in numbers:
        if observer.adapter.mode_name(number) == name:
            return number
    raise ValueError(f"{observer.name} has no mode {name}")


def words(action: Action, autopilot: str) -> str:
    """An action in words, for the timeline."""
    (kind,) = action.kinds
    value = getattr(action, kind)
    if kind == "mode":
        return f"pilot: mode {PILOT_MODES.get(value, {}).get(autopilot, value)}"
    if kind == "fly_to":
        return f"pilot: fly here, {value.ahead_m:.0f} m ahead, {value.right_m:.0f} m right"
    if kind == "sticks":
        return f"pilot: sticks for {value.for_s:.0f} s"
    if kind == "stall_s":
        return f"companion stalled for {value:g} s"
    if kind == "link":
        return f"link: {value.cut or 'faults'} for {value.for_s:.0f} s"
    return f"pilot: {kind} {value}"
