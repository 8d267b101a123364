"""The shell around the engine: sockets, clock, signals. It decides nothing.

Every task has an owner and a name. When anything ends the service, the aircraft is given back first.
"""

import asyncio
import contextlib
import logging
import signal
import time
from collections import deque
from collections.abc import Callable, Coroutine, Sequence

from companion.clock import Clock, SteadyClock
from companion.control.state_machine import State
from companion.engine import LONGEST_CATCH_UP_US, Effect, Engine, Keep, Record, Save, Say, Stepper, Transmit
from companion.errors import CompanionError, alone
from companion.links import Link, Reconnect, open_at_start
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import Frame, FrameSplitter
from companion.mavlink.heartbeat_sequence import HeartbeatSequence
from companion.mavlink.translate import WANTED, frame_to_fact
from companion.model import Role
from companion.recording.recorder import Recorder
from companion.recording.state_file import DurableStateFile, StateFile
from companion.watchdog import Watchdog
from companion.web import Display, Observers
from companion.web.health import Health, LoopTimes

_log = logging.getLogger("companion")

# How long the autopilot gets to take the aircraft back before the service ends regardless.
_LONGEST_GIVING_BACK_US = 8_000_000
_LETTING_GO_S, _LETTING_GO_TIMES = 1.4, 14
_SILENCE_TOLD_AFTER_US = 5_000_000
_LATENCIES_KEPT = 20_000
# What a browser asks for comes from this component of our system.
_BROWSER = mavlink.MAV_COMP_ID_USER1


class Runtime:
    """Runs one engine over its links until told to stop. A link that fails is opened again, the others go on.

    `latencies_s` holds, for traffic that was answered at once, the time from its datagram to the setpoint.
    """

    def __init__(
        self,
        engine: Engine,
        links: Sequence[Link],
        *,
        recorder: Recorder | None = None,
        clock: Clock | None = None,
        watchdog: Watchdog | None = None,
        keeper: StateFile | None = None,
        display: Display | None = None,
        not_recorded: str | None = None,
        settings: DurableStateFile | None = None,
    ) -> None:
        self.engine = engine
        self.links = list(links)
        self.recorder = recorder
        self.clock = clock or SteadyClock()
        self.setpoints_sent = 0
        self.unusable = 0  # messages that we want, of which nothing could be believed
        self.latencies_s: deque[float] = deque(maxlen=_LATENCIES_KEPT)
        self._stepper = Stepper(engine, self._perform, longest_catch_up_us=LONGEST_CATCH_UP_US)
        self._watchdog = watchdog or Watchdog({})
        self._keeper = keeper
        self._display = display
        self._not_recorded = not_recorded  # why, from the beginning
        if display is not None:
            display.on_role = self._ask_for_role
        self._onlookers = Observers(display, recorder)
        self._times = LoopTimes()
        self._started_s = time.monotonic()
        self._settings = settings
        self._encoder = Encoder()
        self._orders: dict[str, HeartbeatSequence] = {}  # by link: each counts for itself
        self._arrived_s: float | None = None
        self._stop = asyncio.Event()
        self._failure: Exception | None = None
        self._problem_told: str | None = None

    def stop(self) -> None:
        """Give the aircraft back, then end."""
        self._stop.set()

    async def run(self, *, on_signals: bool = False) -> None:
        """Run until `stop` (`on_signals`: also SIGINT, SIGTERM); `CompanionError` when it cannot go on."""
        try:
            await open_at_start(self.links)
            with contextlib.ExitStack() as undo:
                if on_signals:
                    self._catch_signals(undo)
                await self._run_tasks()
        finally:
            for link in self.links:
                link.close()
            self._sum_up()
            if self.recorder is not None:
                self.recorder.close()
            if self._settings is not None:
                self._settings.close()
        if self._failure is not None:
            raise self._failure
        if not self.engine.finished:
            what = "its own speed" if self.engine.supervisor.state is State.STOPPED else "the aircraft"
            raise CompanionError(f"the autopilot did not confirm that it took {what} back")

    async def _run_tasks(self) -> None:
        with alone():
            async with asyncio.TaskGroup() as tasks:
                owned = [
                    tasks.create_task(
                        self._owned(Reconnect(link).run(self._on_frames)), name=f"link {link.address}"
                    )
                    for link in self.links
                ]
                if self.recorder is not None:
                    owned.append(tasks.create_task(self._owned(self.recorder.run()), name="recorder"))
                if self._display is not None:
                    owned.append(tasks.create_task(_beside(self._display.run()), name="display"))
                owned.append(tasks.create_task(self._owned(self._watch_silence()), name="silence"))
                await self._tick_until_stopped()
                for task in owned:
                    task.cancel()

    async def _owned(self, work: Coroutine[None, None, None]) -> None:
        """A task whose failure ends the service, after the aircraft is given back."""
        try:
            await work
        except Exception as error:  # noqa: BLE001 - as in `_guarded`, for tasks
            self._failure = self._failure or error
            self._stop.set()

    async def _tick_until_stopped(self) -> None:
        kept = None if self._keeper is None else self._keeper.read()
        if kept is not None:
            text, age_s = kept
            self.engine.recover(text, self.clock.now_us() / 1e6, age_s)
        self._watchdog.ready()
        while not self._stop.is_set():
            self._guarded(self._tick)
            wait_s = self.clock.wall_seconds_until(self._stepper.next_tick_us(self.clock.now_us()))
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stop.wait(), wait_s)
        self._watchdog.stopping()
        if self._failure is None:
            self._guarded(lambda: self._perform(now := self.clock.now_us(), self._ask_back(now)))
        if self._failure is None:
            await self._await_given_back()
        if self._failure is not None:
            await self._let_go()

    def _tick(self) -> None:
        """Make the ticks that are due; who watches us hears of it."""
        self._advance(self.clock.now_us())
        self._watchdog.alive(self._stepper.ticks, time.monotonic())

    def _advance(self, now_us: int) -> None:
        """The ticks that are due, measured and shown."""
        ticks, begun_s = self._stepper.ticks, time.perf_counter()
        self._stepper.advance(now_us)
        if self._stepper.ticks > ticks:
            self._times.observe(time.perf_counter() - begun_s)
            self._onlookers.look(self.engine, now_us, self._health)

    def _health(self) -> Health:
        return Health.of(
            time.monotonic() - self._started_s,
            self._times,
            self.links,
            skipped_ticks=self._stepper.skipped_ticks,
            unusable=self.unusable,
            setpoints_sent=self.setpoints_sent,
            recording_problem=self._recording_problem,
        )

    @property
    def _recording_problem(self) -> str | None:
        return self._not_recorded if self.recorder is None else self.recorder.problem

    def _ask_for_role(self, name: str) -> None:
        """A browser asks for another role: by a message like a ground station's, so that it is recorded."""
        role = Role.__members__.get(name.upper())
        if role is None:
            return
        us = self.engine.sender
        message = mavlink.MAVLink_command_long_message(
            us.system_id,
            us.component_id,
            mavlink.MAV_CMD_DO_SET_MODE,
            0,
            mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            role,
            *[0.0] * 5,
        )
        raw = self._encoder.encode(message, us.system_id, _BROWSER)
        frames = FrameSplitter().feed_datagram(raw)
        self._guarded(lambda: self._take_in(frames, HeartbeatSequence()))

    def _ask_back(self, now_us: int) -> list[Effect]:
        self._stepper.advance(now_us)
        return self.engine.request_stop(now_us / 1e6)

    async def _await_given_back(self) -> None:
        deadline_us = self.clock.now_us() + _LONGEST_GIVING_BACK_US
        while not self.engine.finished and self._failure is None and self.clock.now_us() < deadline_us:
            self._guarded(self._tick)
            await asyncio.sleep(
                self.clock.wall_seconds_until(self._stepper.next_tick_us(self.clock.now_us()))
            )

    def _guarded(self, act: Callable[[], None]) -> None:
        """The one broad except: a bug ends the service, but not before the aircraft is given back."""
        try:
            act()
        except Exception as error:  # noqa: BLE001
            self._failure = self._failure or error
            self._stop.set()

    async def _let_go(self) -> None:
        """The engine broke: ask for the former mode without it; several times, as nobody awaits answers."""
        _log.critical("internal error, giving the aircraft back: %r", self._failure)
        for _ in range(_LETTING_GO_TIMES):
            for message in self.engine.emergency_release(self.clock.now_us() / 1e6):
                raw = self._encoder.encode(message, *_address(self.engine))
                for link in self.links:
                    link.send(raw)
            await asyncio.sleep(_LETTING_GO_S / _LETTING_GO_TIMES)

    def _on_frames(self, frames: list[Frame], link: Link) -> None:
        if self._failure is None:
            self._guarded(
                lambda: self._take_in(frames, self._orders.setdefault(link.address, HeartbeatSequence()))
            )

    def _take_in(self, frames: list[Frame], order: HeartbeatSequence) -> None:
        now_us = self.clock.now_us()
        self._arrived_s = time.perf_counter()
        for frame in frames:
            # The ticks that are due come before this frame, in the record too.
            self._advance(now_us)
            if self.recorder is not None:
                self.recorder.received(now_us, frame.raw)
            # A mode that is not any more would look as if somebody had chosen it.
            if order.is_overtaken(frame, now_us / 1e6) or frame.message_id not in WANTED:
                continue
            fact = frame_to_fact(frame, now_us / 1e6)
            if fact is None:
                self.unusable += 1
            else:
                self._stepper.receive(fact, now_us)
        self._arrived_s = None

    def _perform(self, time_us: int, effects: Sequence[Effect]) -> None:
        for effect in effects:
            match effect:
                case Transmit():
                    self._send(time_us, effect)
                case Record():
                    if self.recorder is not None:
                        self.recorder.decision(time_us, effect.line)
                case Keep():
                    if self._keeper is not None:
                        self._keeper.keep(effect.text)
                case Save():
                    if self._settings is not None:
                        self._settings.keep(effect.text)
                case Say():
                    if self.recorder is not None:
                        self.recorder.text(time_us, effect.severity, effect.text)
                    level = (
                        logging.WARNING if effect.severity <= mavlink.MAV_SEVERITY_WARNING else logging.INFO
                    )
                    _log.log(level, effect.text)
        self._tell_recorder_problem(time_us)

    def _send(self, time_us: int, effect: Transmit) -> None:
        raw = self._encoder.encode(effect.message, effect.sender.system_id, effect.sender.component_id)
        for link in self.links:
            link.send(raw)
        if self.recorder is not None:
            self.recorder.sent(time_us, raw)
        if effect.message.get_msgId() == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT:
            self.setpoints_sent += 1
            if self._arrived_s is not None:
                self.latencies_s.append(time.perf_counter() - self._arrived_s)

    def _tell_recorder_problem(self, time_us: int) -> None:
        """Once, in the log and to the operator; to him without the path."""
        problem = self._recording_problem
        if problem is not None and problem != self._problem_told:
            self._problem_told = problem
            _log.error("recording: %s", problem)
            why = problem.rpartition(": ")[2]
            self._perform(time_us, self.engine.announce(f"Not recorded: {why}", time_us / 1e6))

    async def _watch_silence(self) -> None:
        """Say once that nobody answers, and once that somebody does."""
        started_us = self.clock.now_us()
        told = False
        while self.engine.aircraft.adapter is None:
            await asyncio.sleep(0.2)
            if not told and self.clock.now_us() - started_us > _SILENCE_TOLD_AFTER_US:
                told = True
                where = ", ".join(link.address for link in self.links)
                _log.warning("no autopilot heard on %s; waiting for one", where)
        adapter = self.engine.aircraft.adapter
        _log.info("%s, system %d", adapter.name, adapter.target.system_id)

    def _sum_up(self) -> None:
        """What the links carried, and what was dropped."""
        for link in self.links:
            heard = link.counters
            _log.info(
                "%s: %d frames in (%d bad bytes, %d lost, %d unknown), %d out (%d errors)",
                link.address,
                heard.frames,
                heard.bad_bytes,
                heard.lost,
                heard.unknown,
                heard.sent_frames,
                heard.send_errors,
            )
        refused = self.engine.tracker.dropped.total()
        _log.info(
            "%d unusable messages, %d from others, %d traffic reports refused",
            self.unusable,
            self.engine.foreign,
            refused,
        )

    def _catch_signals(self, undo: contextlib.ExitStack) -> None:
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.stop)
            undo.callback(loop.remove_signal_handler, number)


async def _beside(work: Coroutine[None, None, None]) -> None:
    """A task that nobody's life depends on: its failure is told, and all else goes on."""
    try:
        await work
    except Exception:  # noqa: BLE001 - as in `Runtime._guarded`, and to less effect
        _log.exception("display: switched off")


def _address(engine: Engine) -> tuple[int, int]:
    return engine.sender.system_id, engine.sender.component_id
