"""When the engine ticks: on whole tenths of a second of its clock, in flight as in a replay.

A tick at time T sees exactly the facts received before T, whenever its timer fires. Therefore a recorded
flight, replayed by the time stamps of its log, makes the decisions that were flown.
"""

from collections.abc import Callable, Sequence
from itertools import islice

from companion.engine.engine import Engine
from companion.mavlink.facts import Fact, Traffic
from companion.output.effects import Effect
from companion.traffic import Urgency

TICK_US = 100_000
# How long the service may do nothing. A longer stall is a gap: its ticks are never made, and nothing acts on
# the aircraft before a heartbeat from after the gap (see `Engine.note_gap`).
LONGEST_STALL_US = 500_000
# Without a tick for this long the service manager restarts the service (WatchdogSec in its unit), and the
# next run gives the aircraft back.
WATCHDOG_S = 3.0
# A log has no record of our stalls. Its longer gaps are of a machine that was suspended.
LONGEST_GAP_IN_LOG_US = 5_000_000

# Traffic prompts a tick not more often than this: a flood must not be answered one by one.
SHORTEST_PROMPT_US = 20_000
# Of facts that came together so many are taken in between two ticks, the most urgent first, and as many that
# waited before each tick: a document of thousands of aircraft must not delay a tick. Of those that wait, the
# oldest are dropped.
FACTS_AT_ONCE, MOST_FACTS_WAITING = 150, 10_000

Perform = Callable[[int, Sequence[Effect]], None]


class Stepper:
    """Drives an engine along a clock of whole microseconds that never runs backwards.

    `perform(time_us, effects)` carries out the effects. Ticks that are overdue by more than
    `longest_stall_us` are skipped, and the engine notes the gap. `ticks` counts those made, `dropped_facts`
    those of `receive_together` that came faster than they could be taken in.
    """

    def __init__(self, engine: Engine, perform: Perform, *, longest_stall_us: int | None = None) -> None:
        self.engine = engine
        self.ticks = 0
        self.skipped_ticks = 0
        self._perform = perform
        self._longest_stall_us = longest_stall_us
        self._next_tick_us: int | None = None
        self._prompted_us: int | None = None
        self._waiting: dict[object, Fact] = {}
        self.dropped_facts = 0
        self._taken = 0  # of facts that came together, since the last tick

    def next_tick_us(self, now_us: int) -> int:
        """Time of the next tick [us]."""
        if self._next_tick_us is None:
            self._next_tick_us = -(-now_us // TICK_US) * TICK_US
        return self._next_tick_us

    def advance(self, now_us: int) -> None:
        """Make all ticks that are due."""
        due_us = self.next_tick_us(now_us)
        if self._longest_stall_us is not None and now_us - due_us > self._longest_stall_us:
            # The latest tick is skipped too: facts that arrived meanwhile come first.
            last_us = due_us - TICK_US
            resumed_us = (now_us // TICK_US + 1) * TICK_US
            self.skipped_ticks += (resumed_us - due_us) // TICK_US
            due_us = self._next_tick_us = resumed_us
            self._perform(now_us, self.engine.note_gap((now_us - last_us) / 1e6, now_us / 1e6))
        while due_us <= now_us:
            self._next_tick_us = due_us + TICK_US
            self._taken = 0
            if self._waiting:
                self._take_in_waiting(due_us)
            self._perform(due_us, self.engine.tick(due_us / 1e6))
            self.ticks += 1
            due_us = self._next_tick_us
        self._next_tick_us = due_us

    def receive(self, fact: Fact, now_us: int, true_s: float | None = None) -> None:
        """Make the ticks that are due, take a fact in, and tick at once when the fact cannot wait.

        `true_s` is when the fact was true; by default, now.
        """
        self.advance(now_us)
        prompts = self.engine.receive(fact, now_us / 1e6, true_s)
        if prompts and (not isinstance(fact, Traffic) or self._may_prompt(now_us)):
            self._perform(now_us, self.engine.tick(now_us / 1e6))

    def receive_together(self, facts: Sequence[Fact], now_us: int) -> None:
        """Make the ticks that are due, take facts in, and tick once at once when one of them cannot wait."""
        self.advance(now_us)
        now_s, at_once = now_us / 1e6, len(facts)
        if self._taken + len(facts) > FACTS_AT_ONCE:
            ranks = [(self.engine.urgency(fact, now_s) or 0, number) for number, fact in enumerate(facts)]
            ranks.sort()
            facts = [facts[number] for _, number in ranks]
            urgent = sum(rank <= Urgency.NEAR_AGAIN for rank, _ in ranks)
            at_once = min(max(FACTS_AT_ONCE - self._taken, min(urgent, FACTS_AT_ONCE)), len(facts))
        self._taken += at_once
        if self._waiting:
            for fact in facts[:at_once]:
                self.dropped_facts += self._waiting.pop(_key_of(fact), None) is not None
        prompts = [self.engine.receive(fact, now_s) for fact in facts[:at_once]]
        for fact in facts[at_once:]:
            self._wait(fact)
        if any(prompts) and self._may_prompt(now_us):
            self._perform(now_us, self.engine.tick(now_us / 1e6))

    def _may_prompt(self, now_us: int) -> bool:
        """Whether traffic may prompt a tick now; if so, it does."""
        last_us = self._prompted_us
        if last_us is not None and 0 <= now_us - last_us < SHORTEST_PROMPT_US:
            return False
        self._prompted_us = now_us
        return True

    def _wait(self, fact: Fact) -> None:
        """Let a fact wait; it replaces an older one of the same aircraft from the same receiver."""
        key = _key_of(fact)
        self.dropped_facts += self._waiting.pop(key, None) is not None
        self._waiting[key] = fact
        if len(self._waiting) > MOST_FACTS_WAITING:
            del self._waiting[next(iter(self._waiting))]
            self.dropped_facts += 1

    def _take_in_waiting(self, now_us: int) -> None:
        """Take in the next facts that came together with others; the tick follows anyway."""
        for key in list(islice(self._waiting, FACTS_AT_ONCE)):
            self.engine.receive(self._waiting.pop(key), now_us / 1e6)


def _key_of(fact: Fact) -> object:
    """What a newer fact replaces: a report of the same aircraft, or its name, from the same receiver."""
    report = fact.report if isinstance(fact, Traffic) else None
    if report is None or not report.key:
        return fact
    return report.heard_by, report.key, report.lat_deg is None and report.relative_m is None
