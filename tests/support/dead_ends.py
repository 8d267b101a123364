"""A model of everything that can happen to control, and what must hold on every tick of it.

The engine is the real one; only its avoider is replaced by one that sees a conflict when told so. The model
checks on each tick:

- nothing acts on the aircraft after a claim that the engine has received;
- no mode is requested without a fresh heartbeat that shows the mode to be left;
- while everything works, the aircraft is in the guided mode by our doing and not flown by us for no longer
  than `abandoned_s` and the time that giving back takes; otherwise an alarm holds.

`python -m tests.support.dead_ends --depth 3` walks all sequences of events.
"""

import argparse
import itertools
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace

from companion.avoidance import AvoidanceParams, Avoider
from companion.control.state_machine import ENTERING, FLYING, State, SupervisorParams
from companion.engine import Engine, EngineConfig, EngineParams
from companion.mavlink.dialect import Message
from companion.mavlink.facts import (
    Heartbeat,
    LandedState,
    NavigationTarget,
    OtherVehicle,
    OwnPosition,
    Parameter,
    RcChannels,
)
from companion.model import Decision, Goal, Guidance, Layer, Ownship, Threat, Track
from tests.support.pilots_seat import (
    ARDUPILOT,
    AUTO,
    AUTOPILOT,
    CENTERED_US,
    CHANGE_ALTITUDE,
    FBWA,
    GUIDED,
    GUIDED_COURSE,
    GUIDED_MODES,
    HOLD,
    LOITER,
    MISSION,
    MOVED_US,
    OFFBOARD,
    PX4_1_18,
    SET_MODE,
    T0,
    Seat,
)
from tests.support.thorough import THOROUGH

RULES = SupervisorParams()
EVENT_S = 1.5
# Giving back takes a request, a heartbeat and, with PX4, a stream of setpoints before it.
_GIVEN_BACK_S = 3.5
_EVIDENCE_S = 1.6
# A target that is not ours counts once a later heartbeat still shows the guided mode.
_REDIRECTED_S = 1.2
# An alarm is due when giving back takes longer than usual.
_ALARM_S = 12.0
_SETPOINTS_LOST_S = 1.0
# A second vehicle counts for this long after it was heard.
_TWO_VEHICLES_S = 10.5
# What has lasted for this long after everything was mended is what it comes to.
_SETTLED_S = 3.0
# Sticks that moved count until they have rested for this long.
_STICKS_REST_S = 10.5

EVENTS = (
    "conflict ends",
    "conflict begins",
    "pilot takes over",
    "pilot resumes mission",
    "pilot holds",
    "flicker",
    "flicker to mission",
    "fly here",
    "sticks",
    "failsafe",
    "landing",
    "reception lost",
    "transmission lost",
    "modes refused",
    "stall",
    "position lost",
    "two vehicles",
    "role advise",
    "stop",
)


class ToldAvoider(Avoider):
    """Sees one intruder while `conflict` is set, and turns right."""

    conflict = True

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:  # noqa: ARG002
        if not self.conflict:
            return Decision(Layer.CLEAR, because="no conflict")
        threat = Threat("A00001", 0xA00001, 3000.0, 0.0, 0.0, 75.0, 40.0, 0.0, 0.0, Layer.OUTER)
        return Decision(Layer.OUTER, Guidance(1.0, 22.0, 884.0), (threat,), "told so")


class Model(Seat):
    """The aircraft, its pilot, its links and the companion."""

    def __init__(self, autopilot: int) -> None:
        super().__init__(autopilot, RULES)
        self.avoider = ToldAvoider(AvoidanceParams())
        self.engine = Engine(
            EngineConfig(engine=EngineParams(autopilot_system_id=1), supervisor=RULES), avoider=self.avoider
        )
        self.intruder = False
        self.receives = self.accepts = True
        self.obeys = self._does
        self.claims: set[str] = set()  # that hold now
        self.seen_mode = self.mode
        self.by_us = False  # it is in the guided mode because we asked for it
        self.shown_mode: int | None = None  # a heartbeat that shows another mode than the true one
        self.unattended_s = self.alarm_s = 0.0
        self.stopped = False
        self.claimed: set[str] = set()  # all claims so far
        self._heard: tuple[float, int] | None = None  # the newest heartbeat that was received
        self._setpoint_s = T0
        self.target = NavigationTarget(AUTOPILOT, -34.9, 149.0, 884.0)
        self.pulses = CENTERED_US
        self.landed = 2
        self.fell = self.failing = False
        self.attended_until_s = self.redirected_s = self.sticks_s = self.held_s = T0

    # --- the world

    @property
    def guided_modes(self) -> set[int]:
        """The modes in which we may fly: PX4 1.18 may refuse one and accept the other."""
        return {GUIDED_MODES[self.autopilot], *([OFFBOARD] if self.autopilot == PX4_1_18 else [])}

    @property
    def takes_targets(self) -> bool:
        """Whether the mode stays when someone else gives it a target: a place, or a height."""
        return self.mode in (GUIDED, GUIDED_COURSE)

    def _does(self, message: Message) -> bool:
        """Whether the autopilot obeys a message that was sent."""
        if not self.transmits:
            return False
        if message.get_type().startswith("SET_POSITION"):
            self._setpoint_s = self.now_s
        if getattr(message, "command", None) == SET_MODE:
            if not self.accepts:
                self.answer(SET_MODE, 4)
                return False
            wanted = round(message.param2)
            mode = wanted if self.autopilot == ARDUPILOT else wanted << 16 | round(message.param3) << 24
            self.by_us = mode in self.guided_modes
            self.claims.discard("pilot holds")  # not heard yet when this was sent, or it is a fault
            if self.by_us:
                self._is_here(884.0)
        if getattr(message, "command", None) == CHANGE_ALTITUDE and self.mode == GUIDED_COURSE:
            self._is_here(message.param1)
        return True

    def _is_here(self, altitude_m: float) -> None:
        """The target that the autopilot reports is where we are, at a height."""
        lat_deg = -35.0 + (self.now_s - T0) * 22.0 / 110_940.0
        self.target = NavigationTarget(AUTOPILOT, lat_deg, 149.0, altitude_m)

    def chooses(self, mode: int) -> None:
        """The pilot or the autopilot changes the mode."""
        if mode != self.mode or self.fell:
            self.by_us = False
        self.mode, self.fell = mode, False
        self.claims.discard("pilot holds")

    def receive(self, fact: object) -> None:
        if not getattr(self, "receives", True):
            return
        if isinstance(fact, OwnPosition) and not self.positions:
            return
        if isinstance(fact, Heartbeat):
            shown = self.mode if self.shown_mode is None else self.shown_mode
            self._heard = self.now_s, shown
            fact = replace(fact, custom_mode=shown)
        super().receive(fact)  # type: ignore[arg-type]

    def advance(self, seconds: float) -> None:
        """Fly on, and check every tick."""
        for _ in range(round(seconds * 10)):
            if self.mode == OFFBOARD:
                if self.now_s - self._setpoint_s > _SETPOINTS_LOST_S:
                    self.mode, self.fell = HOLD, True  # still by our doing
            else:
                self._setpoint_s = self.now_s
            # PX4 reports a failsafe after the end of the setpoints, until a mode is chosen.
            self.fell &= self.mode == HOLD
            self.status = 5 if self.fell or self.failing else 4
            self.extra_facts = [
                RcChannels(AUTOPILOT, self.pulses),
                LandedState(AUTOPILOT, self.landed),
                self.target,
            ]
            if self.autopilot != ARDUPILOT:
                self.extra_facts.append(Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 5.0))
            if "two vehicles" in self.claims:
                self.attended_until_s = self.now_s + _TWO_VEHICLES_S
                self.extra_facts.append(OtherVehicle(AUTOPILOT))
            claimed = {claim for claim in self.claims if self.receives}
            if not self.receives:
                self.redirected_s = self.now_s
            if self.now_s - self.redirected_s < _REDIRECTED_S:
                claimed.discard("fly here")
            if self._heard is None or self._heard[0] <= self.held_s or self.failing:
                claimed.discard("pilot holds")  # not heard yet, or the same as what a failsafe shows
            if self.now_s - self.sticks_s > _STICKS_REST_S:
                claimed.discard("sticks")
            sent = self.fly(0.1)
            self._check(sent, claimed)
            self._count()

    def settle(self, limit_s: float) -> None:
        """Fly on after everything was mended, until it is flown, or left to others, for a while."""
        settled_s = 0.0
        for _ in range(round(limit_s * 10)):
            self.advance(0.1)
            rests = self.now_s >= max(self.attended_until_s, self.sticks_s + _STICKS_REST_S)
            settled = self.state in FLYING or not (self.by_us or self.claims)
            settled_s = settled_s + 0.1 if settled and rests else 0.0
            if settled_s > _SETTLED_S and not THOROUGH:
                return

    # --- what must hold

    def _check(self, sent: Iterable[Message], claimed: set[str]) -> None:
        acting = [message for message in sent if message.get_type() != "PARAM_SET"]
        state = self.state
        for message in acting:
            if getattr(message, "command", None) == SET_MODE:
                assert self._heard is not None
                age_s = self.now_s - self._heard[0]
                assert age_s <= _EVIDENCE_S, f"mode requested {age_s:.1f} s after the last heartbeat"
        if claimed and state is not State.STOPPING:
            assert not acting, f"{[m.get_type() for m in acting]} after {claimed}"

    def _count(self) -> None:
        """Time in the guided mode, or in the one that follows it, by our doing and not flown by us."""
        left = self.by_us and (self.mode in self.guided_modes or self.mode == HOLD)
        flown = self.state in FLYING or self.state in ENTERING
        if not left or flown:
            self.unattended_s = self.alarm_s = 0.0
            return
        attended = self.claims & {"sticks", "landing", "fly here"} or self.now_s < self.attended_until_s
        # On the ground, or when every mode is refused, the service may end at once; in Hold, the pilot who
        # moved the sticks, or has a failsafe, is only warned.
        ended = self.stopped and bool(self.claimed & {"landing", "modes refused"})
        warned = self.mode == HOLD and bool(self.claimed & {"sticks", "failsafe"})
        works = self.receives and self.transmits and self.accepts and not (attended or ended or warned)
        self.unattended_s = self.unattended_s + 0.1 if works else 0.0
        limit_s = RULES.abandoned_s + _GIVEN_BACK_S
        assert self.unattended_s <= limit_s, f"flown by no one for {self.unattended_s:.1f} s in {self.state}"
        self.alarm_s += 0.1
        alarmed = any(condition.key == "unattended" for condition in self.engine.conditions)
        silent = "fly here" in self.claims or self.stopped
        assert alarmed or self.alarm_s < _ALARM_S or silent, "no alarm"

    # --- what can happen

    def happen(self, event: str) -> None:
        self.claimed.add(event)
        match event:
            case "conflict ends" | "conflict begins":
                self.avoider.conflict = event == "conflict begins"
            case "pilot takes over":
                self.chooses(FBWA if self.autopilot == ARDUPILOT else 3 << 16)
            case "pilot holds":  # also where PX4 has entered the same mode by itself
                self.chooses(LOITER if self.autopilot == ARDUPILOT else HOLD)
                self.claims.add("pilot holds")
                self.held_s = self.now_s
            case "pilot resumes mission":
                self.claims -= {"sticks", "fly here"}  # the mission flies
                self.chooses(AUTO if self.autopilot == ARDUPILOT else MISSION)
            case "flicker" | "flicker to mission":
                other = FBWA if self.autopilot == ARDUPILOT else 3 << 16
                self.shown_mode = other if event == "flicker" else self.prior_mode
                self.advance(0.3)
                self.shown_mode = None
            case "fly here":
                if self.takes_targets:
                    self.claims.add("fly here")
                    self.redirected_s = self.now_s
                    self.target = NavigationTarget(AUTOPILOT, -36.0, 150.0, 1_000.0)
            case "sticks":
                if self.by_us:  # a mission flies on, wherever the sticks are
                    self.claims.add("sticks")
                if self.pulses == CENTERED_US:
                    self.sticks_s = self.now_s
                self.pulses = MOVED_US
            case "failsafe":
                self.failing = True
            case "landing":
                self.claims.add("landing")
                self.landed = 4
            case "reception lost":
                self.receives = False
            case "transmission lost":
                self.transmits = False
            case "modes refused":
                self.accepts = False
            case "stall":
                self._tick += 20
                for effect in self.engine.note_gap(2.0, self.now_s):
                    self._perform([effect])
            case "position lost":
                self.positions = False
            case "two vehicles":
                self.claims.add("two vehicles")
            case "role advise":
                self.set_role(1)
            case "stop":
                self.stopped = True
                self.stop()

    def mend(self) -> None:
        """End everything that disturbs; what was chosen stays."""
        self.receives = self.transmits = self.accepts = self.positions = True
        if self.pulses != CENTERED_US:  # moving them back is a claim too
            self.attended_until_s = max(self.attended_until_s, self.now_s + _STICKS_REST_S)
        self.claims -= {"sticks", "landing", "two vehicles"}
        self.pulses, self.landed, self.failing = CENTERED_US, 2, False


def walk(autopilot: int, events: Sequence[str], *, before_conflict: bool = False) -> Model:
    """Let events happen one after the other while the aircraft is flown, and mend everything in the end."""
    model = Model(autopilot)
    model.avoider.conflict = not before_conflict
    model.advance(5.5)
    for event in events:
        model.happen(event)
        model.advance(EVENT_S)
    model.advance(6.0)
    model.mend()
    model.settle(RULES.abandoned_s + _TWO_VEHICLES_S + 9.0)
    left = model.mode in model.guided_modes and model.by_us and model.state not in FLYING
    assert not left or model.claims or model.stopped, "left in the guided mode"
    return model


def seconds_after(autopilot: int, first: str) -> list[str]:
    """Events to follow a first one: of two events one order, in one way of flying; all in `make thorough`."""
    ways = list(GUIDED_MODES)
    own = EVENTS.index(first)
    turn = ways.index(autopilot) + own
    return [
        event
        for place, event in enumerate(EVENTS)
        if THOROUGH or ((place + own + (own < place)) % 2 == 0 and (place + turn) % len(ways) == 0)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--depth", type=int, default=2)
    depth = parser.parse_args().depth
    walked = failed = 0
    for autopilot in GUIDED_MODES:
        for events in itertools.product(EVENTS, repeat=depth):
            walked += 1
            try:
                walk(autopilot, events)
            except AssertionError as error:
                failed += 1
                sys.stdout.write(f"{autopilot} {events}: {error}\n")
    sys.stdout.write(f"{walked} sequences of {depth} of {len(EVENTS)} events, {failed} failed\n")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
