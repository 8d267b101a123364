"""RandomEncounter encounters: well clear, one engagement each, and none for an intruder that has passed."""

import math
import random
from dataclasses import replace

import pytest

from companion.control.state_machine import State
from companion.engine import Engine
from companion.model import Vec2
from companion.units import WELL_CLEAR_HORIZONTAL_M
from sim.closed_loop import ClosedLoop
from sim.scenario import Autopilot, Conflict, Scenario, load_scenario
from sim.traffic import AdsbReceiver, Intruder, Maneuver
from tests.support.thorough import sample

BASE = load_scenario("head-on")
ENCOUNTERS = sample(4, 60)
BATCHES = sample(4, 8)
# The airspeed in the scenarios; it determines where an encounter starts.
CRUISE_MPS = 24.0
# Time after the release, with the intruder past and opening, after which a flight ends.
QUIET_S, NEVER_ENGAGED_QUIET_S = 10.0, 3.0


def random_conflict(seed: int) -> Conflict:
    """A conflict from any side, slow or fast, hit or miss, level or climbing, that starts far outside."""
    chance = random.Random(seed)
    while True:
        conflict = Conflict(
            f"{chance.randrange(1, 0xFFFFFF):06X}",
            "RANDOM",
            meet_at_s=chance.uniform(60.0, 66.0),
            from_deg=chance.uniform(0.0, 360.0),
            speed_mps=chance.uniform(5.0, 110.0),
            climb_mps=chance.choice([0.0, 0.0, chance.uniform(-5.0, 5.0)]),
            miss_m=chance.uniform(-900.0, 900.0),
            miss_height_m=chance.uniform(-120.0, 120.0),
        )
        if starts_outside(conflict):
            return conflict


def starts_outside(conflict: Conflict) -> bool:
    """True if the intruder starts far enough away to be avoided."""
    from_rad = math.radians(conflict.from_deg)
    closing: Vec2 = (
        CRUISE_MPS + conflict.speed_mps * math.cos(from_rad),
        conflict.speed_mps * math.sin(from_rad),
    )
    away_m = math.hypot(math.hypot(*closing) * conflict.meet_at_s, conflict.miss_m)
    return away_m > 2.0 * WELL_CLEAR_HORIZONTAL_M


class RandomEncounter(ClosedLoop):
    """A flight until some time after the intruder has passed and the mission is resumed."""

    def __init__(self, conflict: Conflict, autopilot: Autopilot, *, seed: int) -> None:
        scenario: Scenario = replace(BASE, duration_s=90.0, intruders=(conflict,))
        super().__init__(scenario, Engine(), autopilot=autopilot, seed=seed)
        self.past_s = conflict.meet_at_s

    def meet(self, intruder: Intruder) -> None:
        """Replace the scenario's intruder before the flight."""
        scenario = self.scenario
        receiver = AdsbReceiver([intruder], scenario.frame, self.start_us / 1e6)
        self.world = replace(self.world, intruders=(intruder,), receiver=receiver)
        self.flight.score.intruders = (intruder,)

    def fly(self, limit_s: float = 240.0) -> None:
        quiet_s = 0.0
        while quiet_s < (QUIET_S if self.flight.engagements else NEVER_ENGAGED_QUIET_S):
            self.run(1.0)
            flown_s = (self._now_us - self.start_us) / 1e6
            assert flown_s < limit_s, "never released"
            assert self.engine is not None
            back = self.engine.supervisor.state is State.MONITOR and flown_s > self.past_s
            quiet_s = quiet_s + 1.0 if back and self.is_opening() else 0.0

    def is_opening(self) -> bool:
        """True if the distance to the intruder increases."""
        truth = self.world.vehicle.truth
        (intruder,) = self.world.intruders
        there_m, there_mps = intruder.state_at(self._now_us / 1e6)
        off_m = [a - b for a, b in zip(there_m[:2], truth.position_m[:2], strict=True)]
        off_mps = [a - b for a, b in zip(there_mps[:2], truth.velocity_mps[:2], strict=True)]
        return off_m[0] * off_mps[0] + off_m[1] * off_mps[1] > 0.0


@pytest.mark.parametrize("batch", range(BATCHES))
def test_one_engagement_for_each_encounter(batch: int) -> None:
    for seed in range(batch, ENCOUNTERS, BATCHES):
        conflict = random_conflict(seed)
        loop = RandomEncounter(conflict, "px4" if seed % 2 else "ardupilot", seed=seed)
        loop.fly()
        flight = loop.flight
        (encounter,) = flight.score.encounters.values()
        what = f"seed {seed}: {conflict}"
        assert not encounter.nmac, what
        assert not encounter.lowc, what
        assert flight.engagements <= 1, what
        assert not flight.uncontrolled, what
        assert flight.truth.on_mission, what


@pytest.mark.parametrize("seed", sample([1], range(4)))
def test_an_intruder_that_returns_is_avoided_once_more_at_most(seed: int) -> None:
    """It passes, turns around half a minute later, and follows."""
    chance = random.Random(1000 + seed)
    conflict = replace(
        random_conflict(seed), from_deg=chance.uniform(-60.0, 60.0), speed_mps=chance.uniform(35.0, 60.0),
        climb_mps=0.0, miss_m=chance.uniform(-300.0, 300.0), miss_height_m=chance.uniform(-40.0, 40.0),
    )  # fmt: skip
    loop = RandomEncounter(conflict, "px4" if seed % 2 else "ardupilot", seed=seed)
    (straight,) = loop.world.intruders
    turns_s = straight.anchor_s + 30.0
    rate_rps = chance.choice([-1.0, 1.0]) * math.radians(6.0)
    comes_back = replace(
        straight,
        maneuvers=(Maneuver(turns_s, turn_rate_rps=rate_rps), Maneuver(turns_s + math.pi / abs(rate_rps))),
    )
    loop.meet(comes_back)
    flight = loop.run(conflict.meet_at_s + 110.0)
    (encounter,) = flight.score.encounters.values()
    assert not encounter.nmac
    assert not encounter.lowc
    assert flight.engagements <= 2
    assert not flight.uncontrolled
