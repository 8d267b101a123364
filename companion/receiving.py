"""From what links and receivers pass on to facts in the engine, in the order of arrival."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

from companion.clock import Clock
from companion.control.emergency import EmergencyRelease
from companion.engine import Stepper
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import OtherCompanion
from companion.mavlink.framing import Frame
from companion.mavlink.intake import Intake, Received
from companion.mavlink.own_frames import OwnFrames
from companion.recording.pieces import is_piece
from companion.recording.recorder import Recorder
from companion.sources.receiver import Piece, Receiver
from companion.traffic_queue import TrafficQueue


class Receiving:
    """Takes frames and pieces in: ticks that are due first, then the record, then the engine.

    `own_frames` are those that we sent, `imitated` counts frames that pretend to be of our own record.
    `arrived_s` is when the frames that are being processed arrived, by `time.perf_counter`.
    """

    def __init__(
        self, stepper: Stepper, clock: Clock, recorder: Recorder | None, advance: Callable[[int], None]
    ) -> None:
        """`advance(now_us)` makes the ticks that are due."""
        self.intake = Intake(stepper.engine.sender.component_id)
        self.queue = TrafficQueue(stepper.engine.urgency)
        self.own_frames = OwnFrames()
        self.imitated = 0
        self.arrived_s: float | None = None
        self._stepper = stepper
        self._engine = stepper.engine
        self._clock = clock
        self._recorder = recorder
        self._advance = advance
        # Frames that the engine has not processed yet. When it fails, the emergency release processes them.
        self._unheard: deque[Frame] = deque()

    def add(self, frames: Sequence[Frame]) -> None:
        """Add frames that arrived."""
        self._unheard.extend(frames)

    def take_in(self) -> None:
        """Frames to facts, and facts into the engine."""
        now_us = self._clock.now_us()
        self.arrived_s = time.perf_counter()
        while self._unheard:
            # The ticks that are due come before this frame, in the record too.
            self._advance(now_us)
            if self.queue.takes(self._unheard[0], now_us):
                self._unheard.popleft()
            else:
                self.queue.process(self._unheard[0], partial(self._process, now_us))
        self.arrived_s = None

    def after_tick(self, now_us: int) -> None:
        """Take in the traffic that had to wait, as far as there is time for it."""
        self.queue.begin(now_us)
        while (frame := self.queue.next()) is not None:
            self._unheard.appendleft(frame)
            self.queue.process(frame, partial(self._process, now_us))

    def _process(self, now_us: int, frame: Frame) -> None:
        """Process the first of the unheard frames."""
        self._record(now_us, frame)
        received = self._received(frame, now_us / 1e6)
        self._unheard.popleft()  # from here on the engine has it
        if received is not None:
            self._stepper.receive(received.fact, now_us, received.true_s)

    def is_echo(self, frame: Frame) -> bool:
        """Whether this is traffic that we sent on, come back; a receiver may have the same address."""
        if frame.component_id != mavlink.MAV_COMP_ID_ADSB:
            return False
        return self.own_frames.is_echo(frame.raw, self._clock.now_us() / 1e6)

    def take_piece(self, receiver: Receiver, piece: Piece) -> None:
        """What a receiver sent to facts, and facts into the engine."""
        now_us = self._clock.now_us()
        self.arrived_s = time.perf_counter()
        self._advance(now_us)
        if self._recorder is not None:
            self._recorder.heard(now_us, piece, self._engine.sender)
        self._stepper.receive_together(receiver.take(piece, now_us / 1e6), now_us)
        self.arrived_s = None

    def pass_on(self, release: EmergencyRelease, guarded: Callable[[Callable[[], None]], None]) -> None:
        """Pass the unprocessed frames to the emergency release, as the engine has failed."""
        while self._unheard:
            guarded(partial(self._let_hear, release, self._unheard.popleft(), guarded))

    def _let_hear(
        self, release: EmergencyRelease, frame: Frame, guarded: Callable[[Callable[[], None]], None]
    ) -> None:
        now_us = self._clock.now_us()
        guarded(partial(self._record, now_us, frame))
        received = self.intake.judge(frame, now_us / 1e6)
        if received is not None:
            release.observe(received.fact, received.true_s)

    def _record(self, now_us: int, frame: Frame) -> None:
        if is_piece(frame):
            self.imitated += 1  # a replay would believe that one of our receivers sent it
        elif self._recorder is not None:
            self._recorder.received(now_us, frame.raw)

    def _received(self, frame: Frame, now_s: float) -> Received | None:
        """The fact in a frame. Our own frames may come back; any other from our address is a companion's."""
        us = self._engine.sender
        if (frame.system_id, frame.component_id) == us and self.own_frames.is_foreign(frame.raw, now_s):
            return Received(OtherCompanion(us), now_s)
        if self.is_echo(frame):
            return None
        return self.intake.judge(frame, now_s)
