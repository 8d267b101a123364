"""Agreement: which proposals are flown, whatever the messages between the members suffer."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.avoidance.group.agreement import Agreement, Plan, is_same
from companion.avoidance.group.formation import MemberState
from companion.model import Goal, Guidance, Intent, Member, Proposal

RIGHT, LEFT = Guidance(0.5, 22.0, 300.0), Guidance(6.0, 22.0, 300.0)


def state(name: str, intent: Intent | None) -> MemberState:
    member = Member(Goal(0.0, 22.0, 300.0), 16.0, 28.0, 0.25, intent, name)
    return MemberState(name, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), member)


def accepts(_plan: Plan, _counted: Mapping[str, Sequence[Plan]]) -> bool:
    return True


def settled(agreement: Agreement, others: Sequence[MemberState], now_s: float = 1.0) -> Agreement:
    agreement.settle(now_s, "1", others, accepts, 6.0)
    return agreement


def proposing(plan: Plan = RIGHT) -> tuple[Agreement, int]:
    agreement = Agreement()
    agreement.propose(plan, 0.0)
    proposal = agreement.intent(answers=True).proposal
    assert proposal is not None
    return agreement, proposal.number


def test_a_proposal_waits_for_every_acknowledgement() -> None:
    agreement, number = proposing()
    heard = state("2", Intent(heard={"1": number}))
    assert settled(agreement, [heard, state("3", Intent())]).flown is None
    assert agreement.pending
    assert settled(agreement, [heard, state("3", Intent(heard={"1": number}))]).flown == RIGHT
    assert not agreement.pending
    assert agreement.agreed


def test_an_acknowledgement_of_another_proposal_does_not_count() -> None:
    agreement, number = proposing()
    assert settled(agreement, [state("2", Intent(heard={"1": number - 1}))]).flown is None


def test_a_member_that_cannot_answer_is_not_waited_for() -> None:
    agreement, _ = proposing()
    assert settled(agreement, [state("2", Intent(answers=False))]).flown == RIGHT


def test_a_proposal_that_nobody_acknowledges_is_dropped() -> None:
    agreement, _ = proposing()
    assert settled(agreement, [state("2", Intent())], now_s=6.1).flown is None
    assert not agreement.pending


@pytest.mark.parametrize(("own_id", "counts"), [("1", False), ("3", True)])
def test_the_proposals_of_lower_ids_count(own_id: str, counts: bool) -> None:
    agreement, other = Agreement(), state("2", Intent(LEFT, Proposal(7, None)))
    agreement.hear([other])
    assert agreement.intent(answers=True).heard == {"2": 7}
    assert agreement.counted(own_id, [other])["2"] == ([LEFT, None] if counts else [LEFT])


def test_what_was_not_agreed_drops_the_proposal() -> None:
    agreement, _ = proposing()
    agreement.override(None)
    assert agreement.pending, "the mission is flown as before"
    agreement.override(LEFT)
    assert not agreement.pending
    assert agreement.flown == LEFT
    assert not agreement.agreed


def test_plans_are_the_same_within_what_can_be_flown() -> None:
    assert is_same(RIGHT, Guidance(0.51, 22.2, 301.0))
    assert not is_same(RIGHT, LEFT)
    assert not is_same(RIGHT, None)
    assert is_same(None, None)
    assert is_same(Guidance(0.01, 22.0, 300.0), Guidance(2.0 * math.pi - 0.01, 22.0, 300.0))


@dataclass
class Node:
    """A member that proposes plans at random and hears the others late, in any order, or not at all."""

    name: str
    agreement: Agreement = field(default_factory=Agreement)
    known: dict[str, tuple[int, Intent]] = field(default_factory=dict)

    @property
    def others(self) -> list[MemberState]:
        return [state(name, intent) for name, (_, intent) in sorted(self.known.items())]

    def receive(self, sender: str, counter: int, intent: Intent) -> None:
        if sender not in self.known or counter > self.known[sender][0]:
            self.known[sender] = counter, intent
            self.agreement.hear(self.others)


def conflicts(one: Plan, other: Plan) -> bool:
    """Plans of two members conflict if both turn to the same side."""
    return one is not None and other is not None and one == other


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.integers(2, 4), st.floats(0.0, 0.6), st.integers(1, 12))
def test_two_plans_in_conflict_are_never_flown_at_once(
    seed: int, count: int, loss: float, longest: int
) -> None:
    """Any delay up to `longest` steps, any order, any loss, and members that propose whenever they like."""
    rng = np.random.default_rng(seed)
    nodes = [Node(str(number)) for number in range(1, count + 1)]
    for node in nodes:
        for other in nodes:
            if other is not node:
                node.known[other.name] = -1, Intent()
    under_way: list[tuple[int, Node, str, int, Intent]] = []
    flown = 0
    for step in range(150):
        for message in [one for one in under_way if one[0] <= step]:
            under_way.remove(message)
            message[1].receive(*message[2:])
        for node in nodes:
            agreement, others = node.agreement, node.others

            def acceptable(plan: Plan, counted: Mapping[str, Sequence[Plan]]) -> bool:
                return not any(conflicts(plan, theirs) for plans in counted.values() for theirs in plans)

            before = agreement.flown
            agreement.settle(step * 0.1, node.name, others, acceptable, 3.0)
            flown += agreement.flown is not None and agreement.flown != before
            if not agreement.pending and rng.random() < 0.3:
                plan = (RIGHT, LEFT, None)[int(rng.integers(3))]
                if not is_same(plan, agreement.flown) and acceptable(
                    plan, agreement.counted(node.name, others)
                ):
                    agreement.propose(plan, step * 0.1)
        plans = [node.agreement.flown for node in nodes]
        assert not any(conflicts(a, b) for k, a in enumerate(plans) for b in plans[k + 1 :])
        for node in nodes:
            if step % 3:
                continue
            for other in nodes:
                if other is not node and rng.random() >= loss:
                    late = int(rng.integers(0, longest + 1))
                    intent = node.agreement.intent(answers=True)
                    under_way.append((step + late, other, node.name, step, intent))
    if loss < 0.3 and longest < 6:
        assert flown, "some proposals are flown"
