"""The shell around the engine: sockets, clock and signals. It decides nothing.

Every task has an owner and a name. When the service ends for any reason, the aircraft is given back first.
"""

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import replace
from functools import partial

from companion import signals
from companion.autopilots import is_setpoint
from companion.clock import Clock, SteadyClock
from companion.control.emergency import EmergencyRelease
from companion.control.state_machine import State
from companion.engine import (
    LONGEST_STALL_US,
    TICK_US,
    Effect,
    Engine,
    Keep,
    Record,
    Save,
    Say,
    Stepper,
    Transmit,
)
from companion.errors import CompanionError, ungrouped
from companion.gcs.requests import role_request
from companion.links import Link, ReceiverLink, Reconnect, open_all
from companion.links.receiver_link import conditions_of
from companion.links.sides import Sides
from companion.load import Load
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.facts import Sender
from companion.mavlink.framing import Frame, FrameSplitter
from companion.mavlink.intake import Intake
from companion.model import Role
from companion.output.effects import Place
from companion.output.notice import Condition
from companion.output.persisted_state import PersistedState
from companion.receiving import Receiving
from companion.recording.pieces import HeardElsewhere
from companion.recording.recorder import Recorder
from companion.recording.state_file import DurableStateFile, StateFile
from companion.sources.receiver import Piece, Receiver
from companion.summary import summary
from companion.watchdog import Watchdog
from companion.web import Display, Observers
from companion.web.health import Health, LoopTimes, ReceiverCount

_log = logging.getLogger("companion")

# From the time of a tick to its last message; a tick may be late by a stall that is no gap yet.
_LONGEST_DELAY_US = LONGEST_STALL_US + 200_000
# The autopilot has this long to take the aircraft back before the service ends anyway.
_LONGEST_RELEASE_US = 12_000_000
# Longest emergency release, in ticks: a heartbeat comes every second and shows the result of a request.
_EMERGENCY_TICKS = 30
_SILENCE_REPORTED_AFTER_US = 5_000_000
_LATENCIES_KEPT = 20_000
# Requests of a browser come from this component of our system.
_BROWSER = mavlink.MAV_COMP_ID_USER1


class Runtime:
    """Runs one engine over its links until `stop`. A link that fails is opened again; the others go on.

    `latencies_s` holds the time from a datagram with traffic to the setpoint that answers it at once.
    """

    def __init__(
        self,
        engine: Engine,
        links: Sequence[Link],
        *,
        receivers: Sequence[ReceiverLink] = (),
        recorder: Recorder | None = None,
        clock: Clock | None = None,
        watchdog: Watchdog | None = None,
        state_file: StateFile | None = None,
        display: Display | None = None,
        not_recorded: str | None = None,
        settings: DurableStateFile | None = None,
    ) -> None:
        self.engine = engine
        self.links = list(links)
        self.receivers = list(receivers)
        self.recorder = recorder
        self.clock = clock or SteadyClock()
        self.setpoints_sent = 0
        self.unsent = 0  # messages that came too late to be sent
        self.latencies_s: deque[float] = deque(maxlen=_LATENCIES_KEPT)
        self._stepper = Stepper(engine, self._perform, longest_stall_us=LONGEST_STALL_US)
        self._watchdog = watchdog or Watchdog({})
        self._state_file = state_file
        self._display = display
        self._not_recorded = not_recorded  # the reason, when nothing is recorded from the start
        if display is not None:
            display.on_role = self._request_role
        self._observers = Observers(display, recorder)
        self._times = LoopTimes()
        self._load = Load()
        self._started_s = time.monotonic()
        self._settings = settings
        self._encoder = Encoder()
        self._receiving = Receiving(self._stepper, self.clock, recorder, self._advance)
        self._sides = Sides(self.links, self._receiving.is_echo)
        self._release: EmergencyRelease | None = None
        self._kept: PersistedState | None = None  # the newest state for the next run
        self._autopilot: Sender | None = None  # its address, as the links know it
        self._stop = asyncio.Event()
        self._failure: Exception | None = None
        self._reported_problem: str | None = None

    @property
    def intake(self) -> Intake:
        """What became of the frames of all links."""
        return self._receiving.intake

    def links_to(self, place: Place) -> list[Link]:
        """The links of this place that we send on."""
        return self._sides.links_to(place)

    def stop(self) -> None:
        """Give the aircraft back, then end."""
        self._stop.set()

    async def run(self, *, on_signals: bool = False) -> None:
        """Run until `stop`, with `on_signals` also as `signals` says; `CompanionError` if it cannot go on."""
        with signals.handled(self.stop) if on_signals else contextlib.nullcontext():
            try:
                await open_all(self._all_links)
                await self._run_tasks()
            finally:
                self._close()
        if self._failure is not None:
            raise self._failure
        if not self.engine.finished:
            what = "its own speed" if self.engine.supervisor.state is State.STOPPED else "the aircraft"
            raise CompanionError(f"the autopilot did not confirm that it took {what} back")

    @property
    def _all_links(self) -> list[Link]:
        return [*self.links, *(one.link for one in self.receivers)]

    def _close(self) -> None:
        for link in self._all_links:
            link.close()
        for line in summary(self.links, self.receivers, self._health(), self.engine):
            _log.info(line)
        if self.recorder is not None:
            self.recorder.close()
        if self._settings is not None:
            self._settings.close()

    async def _run_tasks(self) -> None:
        with ungrouped():
            async with asyncio.TaskGroup() as tasks:
                works = [
                    (f"link {link.address}", Reconnect(link).run(self._on_frames)) for link in self.links
                ]
                works += [(f"receiver {one.link.address}", one.run(self._on_piece)) for one in self.receivers]
                if self.recorder is not None:
                    works.append(("recorder", self.recorder.run()))
                owned = [tasks.create_task(self._owned(work), name=name) for name, work in works]
                if self._display is not None:
                    owned.append(tasks.create_task(_optional(self._display.run()), name="display"))
                owned.append(tasks.create_task(self._owned(self._watch_silence()), name="silence"))
                await self._tick_until_stopped()
                for task in owned:
                    task.cancel()

    async def _owned(self, work: Coroutine[None, None, None]) -> None:
        """Run a task whose failure ends the service, after the aircraft is given back."""
        try:
            await work
        except Exception as error:  # noqa: BLE001 - as in `_guarded`, for tasks
            self._failure = self._failure or error
            self._stop.set()

    async def _tick_until_stopped(self) -> None:
        self._recover()
        self._watchdog.ready()
        while not self._stop.is_set():
            self._guarded(self._tick)
            wait_s = self.clock.wall_seconds_until(self._stepper.next_tick_us(self.clock.now_us()))
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stop.wait(), wait_s)
        self._watchdog.stopping()
        if self._failure is None:
            self._guarded(lambda: self._perform(now := self.clock.now_us(), self._request_stop(now)))
        if self._failure is None:
            await self._await_release()
        if self._failure is not None:
            await self._give_back_in_emergency()

    def _recover(self) -> None:
        """Read what the former run left; find out now whether this run can leave something, too."""
        for file in (self._state_file, self._settings):
            if file is not None:
                file.try_writing()
        if self._state_file is None:
            return
        kept = self._state_file.read()
        if kept is None:
            return
        text, age_s = kept
        if PersistedState.from_text(text) is None:
            self._state_file.set_aside("damaged")
        else:
            self.engine.recover(text, self.clock.now_us() / 1e6, age_s)

    def _tick(self) -> None:
        """Make the ticks that are due, and report to the watchdog."""
        files = (file for file in (self._state_file, self._settings) if file is not None)
        now_us = self.clock.now_us()
        self.engine.shell_conditions = (
            *(one for file in files for one in file.conditions()),
            *conditions_of(self.receivers, now_us / 1e6),
            *self._overload(now_us / 1e6),
        )
        self._advance(now_us)
        self._note_sources(now_us)
        self._watchdog.alive(self._stepper.ticks, time.monotonic())

    def _overload(self, now_s: float) -> list[Condition]:
        """The condition that the service does not keep up, if that is so."""
        stepper = self._stepper
        dropped = self._dropped_reports + sum(link.counters.dropped for link in self._all_links)
        held = self._load.condition(
            now_s, ticks=stepper.ticks, skipped=stepper.skipped_ticks, dropped=dropped
        )
        return [] if held is None else [held]

    @property
    def _dropped_reports(self) -> int:
        """Reports that came faster than they were processed, after their links."""
        return self._stepper.dropped_facts + self._receiving.queue.dropped

    def _note_sources(self, now_us: int) -> None:
        """Note which traffic may be sent on: that of working receivers, and what is heard elsewhere."""
        forwarding = self.engine.forwarding
        if forwarding.to is None:
            return
        works = any(one.problem(now_us / 1e6) is None for one in self.receivers)
        elsewhere = HeardElsewhere(self._sides.elsewhere(forwarding.to), works)
        if elsewhere != (forwarding.elsewhere, forwarding.receiver_works):
            forwarding.note_sources(receiver_works=works, elsewhere=elsewhere.senders)
            if self.recorder is not None:  # the log does not say by which link a frame came
                self.recorder.heard(now_us, elsewhere.to_piece(), self.engine.sender)

    def _advance(self, now_us: int) -> None:
        """Make the ticks that are due; measure and display them."""
        stepper = self._stepper
        due_us, ticks, begun_s = stepper.next_tick_us(now_us), stepper.ticks, time.perf_counter()
        stepper.advance(now_us)
        if stepper.ticks > ticks:
            self._note_autopilot()
            self._times.observe(time.perf_counter() - begun_s)
            self._load.note_tick(now_us - due_us)
            self._observers.look(self.engine, now_us, self._health)
            self._receiving.after_tick(now_us)

    def _note_autopilot(self) -> None:
        """Pass the autopilot's address to the links when it becomes known."""
        own = self.engine.aircraft.sender
        if own is not self._autopilot:
            self._autopilot = own
            for link in self.links:
                link.ours = None if own is None else (own.system_id, own.component_id)

    def _health(self) -> Health:
        health = Health.of(time.monotonic() - self._started_s, self._times, self.links)
        now_s = self.clock.now_us() / 1e6
        return replace(
            health,
            receivers=tuple(ReceiverCount.of(one, now_s) for one in self.receivers),
            skipped_ticks=self._stepper.skipped_ticks,
            unusable=self.intake.unusable,
            past=self.intake.past,
            of_others=self.intake.of_others,
            repeated=self.intake.repeated,
            unsent=self.unsent,
            setpoints_sent=self.setpoints_sent,
            dropped_reports=self._dropped_reports,
            late_ticks=self._load.late_ticks,
            forwarded=self.engine.forwarding.sent,
            mavlink_sources=tuple(
                (f"{source} {sender.system_id}/{sender.component_id}", count)
                for (source, sender), count in sorted(self.engine.mavlink_sources.items())
            ),
            recording_problem=self._recording_problem,
        )

    @property
    def _recording_problem(self) -> str | None:
        return self._not_recorded if self.recorder is None else self.recorder.problem

    def _request_role(self, name: str) -> None:
        """Request a role for a browser, by a ground station's message, so that the request is recorded."""
        role = Role.__members__.get(name.upper())
        if role is None:
            return
        us = self.engine.sender
        raw = self._encoder.encode(role_request(us, role), us.system_id, _BROWSER)
        self._hear(FrameSplitter().feed_datagram(raw))

    def _request_stop(self, now_us: int) -> list[Effect]:
        self._stepper.advance(now_us)
        return self.engine.request_stop(now_us / 1e6)

    async def _await_release(self) -> None:
        deadline_us = self.clock.now_us() + _LONGEST_RELEASE_US
        while not self.engine.finished and self._failure is None and self.clock.now_us() < deadline_us:
            self._guarded(self._tick)
            await asyncio.sleep(
                self.clock.wall_seconds_until(self._stepper.next_tick_us(self.clock.now_us()))
            )

    def _guarded(self, act: Callable[[], None]) -> None:
        """Run `act`; a bug in it ends the service, after the aircraft is given back."""
        try:
            act()
        except Exception as error:  # noqa: BLE001
            self._failure = self._failure or error
            self._stop.set()

    async def _give_back_in_emergency(self) -> None:
        """Give the aircraft back without the engine, which failed; everything sent and heard is recorded."""
        _log.critical("internal error, giving the aircraft back: %r", self._failure)
        self._guarded(self._begin_release)
        if (release := self._release) is None:
            return
        for tick in range(_EMERGENCY_TICKS):
            self._watchdog.alive(self._stepper.ticks + tick + 1, time.monotonic())
            # What waits in the sockets is heard first: the pilot may have taken the aircraft meanwhile.
            await asyncio.sleep(self.clock.wall_seconds_until(self.clock.now_us() + TICK_US))
            self._receiving.pass_on(release, self._guarded)
            self._guarded(partial(self._send_release, release))
            if release.finished:
                self._guarded(self._keep_role_only)
                break

    def _begin_release(self) -> None:
        self._release = self.engine.emergency_release(self.clock.now_us() / 1e6)

    def _keep_role_only(self) -> None:
        """The aircraft is given back: the next run must not give it back again, over a mode of the pilot."""
        kept = self._kept
        if self._state_file is not None and kept is not None:
            role_only = replace(kept, before=None, left_behind=None, borrowed={})
            self._state_file.write(None if kept.role is None else role_only.to_text())

    def _send_release(self, release: EmergencyRelease) -> None:
        now_us = self.clock.now_us()
        for message in release.messages(now_us / 1e6):
            self._guarded(partial(self._send, now_us, Transmit(self.engine.sender, message)))

    def _on_frames(self, frames: list[Frame], link: Link) -> None:
        self._sides.observe(frames, link)
        self._hear(frames)

    def _hear(self, frames: list[Frame]) -> None:
        self._receiving.add(frames)
        if self._failure is None:
            self._guarded(self._receiving.take_in)
        elif self._release is not None:
            self._receiving.pass_on(self._release, self._guarded)

    def _on_piece(self, receiver: Receiver, piece: Piece) -> None:
        if self._failure is None:
            self._guarded(partial(self._receiving.take_piece, receiver, piece))

    def _perform(self, time_us: int, effects: Sequence[Effect]) -> None:
        for effect in effects:
            match effect:
                case Transmit():
                    self._send(time_us, effect)
                case Record():
                    if self.recorder is not None:
                        self.recorder.decision(time_us, effect.line)
                case Keep():
                    self._kept = effect.state
                    if self._state_file is not None:
                        self._state_file.write(effect.text)
                case Save():
                    if self._settings is not None:
                        self._settings.write(effect.text)
                case Say():
                    if self.recorder is not None:
                        self.recorder.text(time_us, effect.severity, effect.text)
                    warns = effect.severity <= mavlink.MAV_SEVERITY_WARNING
                    _log.log(logging.WARNING if warns else logging.INFO, effect.text)
        self._report_recorder_problem(time_us)

    def _send(self, time_us: int, effect: Transmit) -> None:
        """Send a message, unless we stalled since it was made: it would act on the past."""
        if self.clock.now_us() - time_us > _LONGEST_DELAY_US:
            self.unsent += 1
            return
        links = self._sides.links_to(effect.to)
        if not links and effect.to != "all":
            return
        raw = self._encoder.encode(effect.message, effect.sender.system_id, effect.sender.component_id)
        self._receiving.own_frames.sent(raw, time_us / 1e6)
        for link in links:
            link.send(raw)
        if self.recorder is not None:
            self.recorder.sent(time_us, raw)
        if is_setpoint(effect.message):
            self.setpoints_sent += 1
            if (arrived_s := self._receiving.arrived_s) is not None:
                self.latencies_s.append(time.perf_counter() - arrived_s)

    def _report_recorder_problem(self, time_us: int) -> None:
        """Report a problem of the recording once, in the log and to the operator (without the path)."""
        problem = self._recording_problem
        if problem is not None and problem != self._reported_problem:
            self._reported_problem = problem
            _log.error("recording: %s", problem)
            why = problem.rpartition(": ")[2]
            self._perform(time_us, self.engine.announce(f"Not recorded: {why}", time_us / 1e6))

    async def _watch_silence(self) -> None:
        """Log once that no autopilot is heard, and once the autopilot that is adopted."""
        started_us = self.clock.now_us()
        reported = False
        while self.engine.aircraft.adapter is None:
            await asyncio.sleep(0.2)
            if not reported and self.clock.now_us() - started_us > _SILENCE_REPORTED_AFTER_US:
                reported = True
                where = ", ".join(link.address for link in self.links)
                _log.warning("no autopilot heard on %s; waiting for one", where)
        adapter = self.engine.aircraft.adapter
        _log.info("%s, system %d", adapter.name, adapter.target.system_id)


async def _optional(work: Coroutine[None, None, None]) -> None:
    """Run a task that may fail: its failure is logged, and everything else goes on."""
    try:
        await work
    except Exception:  # noqa: BLE001 - the display must not end the flight
        _log.exception("display: switched off")
