"""Counts the calls and files of `companion` that one datagram passes through.

`python -m tests.tools.flows` measures three flows while the aircraft is flown around a head-on intruder:

- report: an ADSB_VEHICLE datagram, to the setpoint that answers it;
- pilot: the heartbeat that shows the pilot's mode change, to hands off;
- parameter: an operator's PARAM_SET, to PARAM_VALUE.

The engine is driven from outside, by datagrams: the tool knows none of its rooms.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import Any

from companion.engine import Effect, Engine, Stepper, Transmit
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.translate import frame_to_fact
from companion.model import Layer
from sim.closed_loop import COMPANION_CHANNEL, ClosedLoop
from sim.scenario import Autopilot, load_scenario

_PACKAGE = "companion"
_AUTOPILOT, _GROUND_STATION = (1, 1), (255, 190)
_STEP_S = 0.05
_LONGEST_WAIT_S = 120.0
# By then the answer to the take-over is old, and each setpoint is a repetition.
_SETTLED_AFTER_S = 3.0

Call = tuple[str, str]  # module, qualified name


@dataclass
class Flow:
    """The calls that a datagram made, in order; the first `until_outcome` came before its outcome."""

    name: str
    outcome: str
    calls: list[Call] = field(default_factory=list)
    until_outcome: int | None = None
    sent: list[Message] = field(default_factory=list)

    @property
    def before(self) -> list[Call]:
        """The calls before the outcome; all of them when it is seen only in the effects returned."""
        return self.calls[: self.until_outcome]

    @property
    def after(self) -> list[Call]:
        """The calls after the outcome: housekeeping."""
        return [] if self.until_outcome is None else self.calls[self.until_outcome :]


def modules(calls: Sequence[Call]) -> set[str]:
    """The modules in which these functions stand, each of them one file."""
    return {module for module, _ in calls}


def in_room(calls: Sequence[Call], room: str) -> list[Call]:
    """The calls of functions of one room, such as `control`."""
    prefix = f"{_PACKAGE}.{room}"
    return [call for call in calls if call[0] == prefix or call[0].startswith(f"{prefix}.")]


def measure(autopilot: Autopilot = "ardupilot") -> dict[str, Flow]:
    """The three flows by their names, measured in one flight."""
    seat = _Seat(autopilot)
    flows = (seat.report(), seat.parameter(), seat.pilot())
    return {flow.name: flow for flow in flows}


class _Seat:
    """An aircraft that is flown around an intruder, and a wire on which each datagram can be measured."""

    def __init__(self, autopilot: Autopilot) -> None:
        self.engine = Engine()
        self._loop = ClosedLoop(load_scenario("head-on"), self.engine, autopilot=autopilot)
        self._encoder, self._splitter = Encoder(), FrameSplitter()
        self._sent: list[Message] = []
        self._mode: int | None = None  # of the newest heartbeat that was fed
        self._stepper = Stepper(self.engine, self._perform)
        self._now_s = self._loop.start_us / 1e6
        self._fly_into_conflict()

    def report(self) -> Flow:
        message = self._await(self._reports)
        flow = Flow("report", "setpoint made")
        datagram = self._encoder.encode(message, *_AUTOPILOT)
        with self._recorded(flow, made="MAVLink_set_position_target_global_int_message.__init__"):
            self._take_in(datagram)
        assert self._flies, "the aircraft was released before the report"
        _check(flow, lambda sent: sent.get_type().startswith("SET_POSITION_TARGET_"))
        return flow

    def pilot(self) -> Flow:
        self._loop.world.vehicle.set_mode("MANUAL")
        message = self._await(self._heartbeats)
        flow = Flow("pilot", "hands off")
        with self._recorded(flow, until=lambda: not self._flies):
            self._feed(message, _AUTOPILOT)
        assert flow.until_outcome is not None, "the heartbeat did not end our flying"
        return flow

    def parameter(self) -> Flow:
        us = self.engine.sender
        message = mavlink.MAVLink_param_set_message(us.system_id, us.component_id, b"CA_SETTLE", 6.0, 9)
        flow = Flow("parameter", "PARAM_VALUE sent")
        with self._recorded(flow):
            self._feed(message, _GROUND_STATION)
        _check(flow, lambda sent: sent.get_type() == "PARAM_VALUE")
        return flow

    @property
    def _flies(self) -> bool:
        return self.engine.supervisor.flying

    def _fly_into_conflict(self) -> None:
        settled_s, waited_s = 0.0, 0.0
        while settled_s < _SETTLED_AFTER_S:
            self._loop.run(0.5)
            waited_s += 0.5
            assert waited_s < _LONGEST_WAIT_S, "no conflict in which the aircraft is flown"
            conflict = self._flies and self.engine.decision.layer is not Layer.CLEAR
            settled_s = settled_s + 0.5 if conflict else 0.0
        self._now_s += waited_s

    def _await(self, source: Callable[[], list[Message]]) -> Message:
        """Let time pass until a source has a message to feed; everything due before it is done."""
        for _ in range(round(_LONGEST_WAIT_S / _STEP_S)):
            self._now_s += _STEP_S
            messages = source()
            self._stepper.advance(self._now_us)
            if messages:
                return messages[0]
        raise AssertionError("no such message came")

    def _reports(self) -> list[Message]:
        self._heartbeats()
        world = self._loop.world
        return list(world.receiver.reports(self._now_s, world.vehicle.truth.position_m))

    def _heartbeats(self) -> list[Message]:
        """Feed what the autopilot sends; a heartbeat that shows a mode change is returned instead."""
        found: list[Message] = []
        for outgoing in self._loop.world.vehicle.step(self._now_s):
            message = outgoing.message
            if outgoing.channel != COMPANION_CHANNEL or message.get_type() == "ADSB_VEHICLE":
                continue
            if message.get_type() == "HEARTBEAT":
                if self._mode not in (None, message.custom_mode):
                    found.append(message)
                self._mode = message.custom_mode
            if not found:
                self._feed(message, _AUTOPILOT)
        return found

    @property
    def _now_us(self) -> int:
        return round(self._now_s * 1e6)

    def _feed(self, message: Message, sender: tuple[int, int]) -> None:
        self._take_in(self._encoder.encode(message, *sender))

    def _take_in(self, datagram: bytes) -> None:
        """What the service does with a datagram, without its sockets, its recorder and its display."""
        for frame in self._splitter.feed_datagram(datagram):
            fact = frame_to_fact(frame, self._now_us / 1e6)
            if fact is not None:
                self._stepper.receive(fact, self._now_us)

    def _perform(self, _time_us: int, effects: Sequence[Effect]) -> None:
        self._sent += [effect.message for effect in effects if isinstance(effect, Transmit)]

    @contextmanager
    def _recorded(
        self, flow: Flow, until: Callable[[], bool] | None = None, made: str | None = None
    ) -> Iterator[None]:
        """Note in `flow` which functions run, and before which of them its outcome is there.

        The outcome is that `until` becomes true, or that the function `made` of the dialect runs.
        """
        self._sent = flow.sent

        def observe(frame: FrameType, event: str, _argument: Any) -> None:
            if event != "call":
                return
            if until is not None and flow.until_outcome is None and until():
                flow.until_outcome = len(flow.calls)
            if made is not None and frame.f_code.co_qualname == made and flow.until_outcome is None:
                flow.until_outcome = len(flow.calls)
            module = frame.f_globals.get("__name__", "")
            if module == _PACKAGE or module.startswith(f"{_PACKAGE}."):
                flow.calls.append((module, frame.f_code.co_qualname))

        sys.setprofile(observe)
        try:
            yield
        finally:
            sys.setprofile(None)
            self._sent = []


def _check(flow: Flow, answers: Callable[[Message], bool]) -> None:
    assert any(map(answers, flow.sent)), f"{flow.name}: no {flow.outcome}"


def _rooms(calls: Sequence[Call]) -> str:
    """Calls and files by room, most calls first."""
    counted = Counter(_room(module) for module, _ in calls)
    return ", ".join(
        f"{room} {count} ({len(modules(in_room(calls, room)))})" for room, count in counted.most_common()
    )


def _room(module: str) -> str:
    return module.split(".")[1] if "." in module else module


def describe(flow: Flow) -> list[str]:
    """Lines for people."""
    lines = [f"{flow.name}: {len(flow.calls)} calls in {len(modules(flow.calls))} files"]
    if flow.until_outcome is not None:
        before, after = flow.before, flow.after
        lines += [
            f"  until {flow.outcome}: {len(before)} calls in {len(modules(before))} files",
            f"  after it: {len(after)} calls in {len(modules(after))} files",
        ]
        calls = list(dict.fromkeys(in_room(before, "control")))
        lines.append(f"  control/ until then: {len(calls)} functions")
        lines += [f"    {module.removeprefix(_PACKAGE + '.')}.{name}" for module, name in calls]
        lines.append(f"  avoidance/ until then: {len(set(in_room(before, 'avoidance')))} functions")
        lines.append(f"  avoidance/ after it: {len(set(in_room(after, 'avoidance')))} functions")
    lines.append(f"  calls (files) by room: {_rooms(flow.calls)}")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--autopilot", choices=("ardupilot", "px4"), default="ardupilot")
    parser.add_argument("--calls", choices=("report", "pilot", "parameter"), help="list each call of a flow")
    arguments = parser.parse_args()
    flows = measure(arguments.autopilot)
    for flow in flows.values():
        sys.stdout.write("\n".join(describe(flow)) + "\n")
    if arguments.calls is not None:
        listed = flows[arguments.calls].calls
        sys.stdout.write("\n".join(f"{module} {name}" for module, name in listed) + "\n")


if __name__ == "__main__":
    main()
