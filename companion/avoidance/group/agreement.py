"""Agreement: an answer is flown only after all members know it and it was checked against theirs.

Each member announces, several times a second, the answer that it flies, at most one proposal with a number,
and for each other member the number of the newest proposal that it has heard of it: the acknowledgement. A
proposal is flown after every member of the group has acknowledged it and a check has then found that it
brings us no nearer to any plan that counts than the separation, or than what we fly already does. Until then,
and after a failed check, the last checked answer goes on. The idea is the delay check of decentralised
planners (RMADER, Kondo et al. 2023), with acknowledgements in place of a bound on the delay.

Which plans count for us: what each other member flies, and the proposal of each member with a lower id.

Guaranteed: of two proposals that conflict with each other, at most one is flown, for any delay, loss and
order of the messages; no clock is compared. Take members L and H, L with the lower id, and their proposals l
and h. Say H flies h from some moment on. If H had heard l by then, its check has counted l, proposed or
flown, so that h agrees with l. Otherwise H has not acknowledged l by then. L needs that acknowledgement; the
message that brings it was sent after that moment, and so it says that H flies h. L's check comes after it, so
that l agrees with h or is dropped.

Not guaranteed, and left to the two layers, which treat a member like a stranger with a small volume: a start
that is too near, plans that change without a proposal (an avoidance of a stranger, a new goal, a pilot), and
errors in following a plan. While messages are late by up to D, what is known of a member's position is that
old: at 25 m/s and 1 s that is 25 m, which the difference between `separation_m` and `smallest_m` covers. What
is lost is repeated by the next message; a member that is silent for `silent_s` is not waited for any more.
"""

import math
from collections.abc import Callable, Mapping, Sequence

from companion.avoidance.group.formation import MemberState
from companion.geodesy import wrap_pi
from companion.model import Guidance, Intent, Proposal

Plan = Guidance | None
"""A guidance, or `None` for the mission."""

CountedPlans = Mapping[str, Sequence[Plan]]
"""The plans of each other member that count, by its id."""

# Proposal numbers are 16 bits on the wire, where 0 means none.
NUMBERS = 65_535
_SAME_COURSE_RAD, _SAME_SPEED_MPS, _SAME_HEIGHT_M = math.radians(2.0), 0.5, 3.0


def is_same(one: Plan, other: Plan) -> bool:
    """Whether two plans are the same, apart from what no member could fly exactly."""
    if one is None or other is None:
        return one is other
    return (
        abs(wrap_pi(one.course_rad - other.course_rad)) <= _SAME_COURSE_RAD
        and abs(one.airspeed_mps - other.airspeed_mps) <= _SAME_SPEED_MPS
        and abs(one.altitude_m - other.altitude_m) <= _SAME_HEIGHT_M
    )


class Agreement:
    """Our answer: what we fly, what we propose, and what we have heard of the other members."""

    def __init__(self) -> None:
        self.flown: Plan = None
        self.agreed = False  # whether what is flown was agreed on
        self.flown_since_s = -math.inf
        self.answering_since_s = -math.inf  # since when other than the mission
        self._proposal: Proposal | None = None
        self._made_s = -math.inf
        self._number = 0
        self._heard: dict[str, int] = {}

    @property
    def pending(self) -> bool:
        """Whether a proposal waits for its check."""
        return self._proposal is not None

    def intent(self, *, answers: bool) -> Intent:
        """What to announce to the other members."""
        return Intent(self.flown, self._proposal, dict(self._heard), answers)

    def reset(self) -> None:
        """Fly the mission and propose nothing. What was heard is still acknowledged."""
        self.flown = self._proposal = None
        self.agreed = False

    def override(self, flown: Plan) -> None:
        """Note that something else is flown, which was not agreed; a proposal is dropped then."""
        if not is_same(flown, self.flown):
            self.flown, self._proposal, self.agreed = flown, None, False

    def hear(self, others: Sequence[MemberState]) -> None:
        """Acknowledge the proposals of the other members."""
        for other in others:
            intent = other.member.intent
            if intent is not None and intent.proposal is not None:
                self._heard[other.member_id] = intent.proposal.number

    def counted(self, own_id: str, others: Sequence[MemberState]) -> dict[str, list[Plan]]:
        """The plans of the other members that count for us."""
        plans: dict[str, list[Plan]] = {}
        for other in others:
            intent = other.member.intent or Intent()
            plans[other.member_id] = [intent.flown]
            if intent.proposal is not None and other.member_id < own_id:
                plans[other.member_id].append(intent.proposal.guidance)
        return plans

    def propose(self, plan: Plan, now_s: float) -> None:
        """Propose a plan in place of what is flown."""
        # The first number differs from those of a former run, whose acknowledgements may still arrive.
        number = self._number if self._number else int(now_s) % NUMBERS
        self._number = number % NUMBERS + 1
        self._proposal = Proposal(self._number, plan)
        self._made_s = now_s

    def settle(
        self,
        now_s: float,
        own_id: str,
        others: Sequence[MemberState],
        is_acceptable: Callable[[Plan, CountedPlans], bool],
        propose_for_s: float,
    ) -> None:
        """Fly our proposal once it is acknowledged and passes its check; drop it if it fails or ages."""
        proposal = self._proposal
        if proposal is None:
            return
        if all(_acknowledges(other, own_id, proposal.number) for other in others):
            if is_acceptable(proposal.guidance, self.counted(own_id, others)):
                if self.flown is None:
                    self.answering_since_s = now_s
                self.flown, self.agreed, self.flown_since_s = proposal.guidance, True, now_s
            self._proposal = None
        elif not 0.0 <= now_s - self._made_s <= propose_for_s:
            self._proposal = None


def _acknowledges(other: MemberState, own_id: str, number: int) -> bool:
    """Whether a member has heard our proposal. One that flies its mission in any case need not."""
    intent = other.member.intent
    return intent is None or not intent.answers or intent.heard.get(own_id) == number
