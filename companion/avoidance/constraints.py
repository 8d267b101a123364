"""Constraints: what may be flown, by the aircraft's limits, the fence and the autopilot's refusals."""

from typing import NamedTuple

from companion.avoidance.envelope import Envelope
from companion.avoidance.fence import Fence
from companion.avoidance.own_flight import OwnState
from companion.avoidance.prediction_times import HORIZON_S
from companion.avoidance.refusals import Refusals
from companion.avoidance.trajectory import Commands, fly_ahead, turn_around_s
from companion.model import Guidance


class Constraints(NamedTuple):
    """All that limits a guidance. `look_ahead_turns` is the fence's look-ahead, in times to turn around."""

    envelope: Envelope
    fence: Fence | None
    refusals: Refusals
    look_ahead_turns: float

    def within_limits(self, guidance: Guidance) -> Guidance:
        """The guidance, with airspeed and height within the aircraft's limits."""
        return Guidance(
            guidance.course_rad,
            self.envelope.clamp_airspeed_mps(guidance.airspeed_mps),
            self.envelope.clamp_altitude_m(guidance.altitude_m),
        )

    def allow(self, guidance: Guidance, state: OwnState) -> bool:
        """Whether a guidance stays within the fence and the autopilot has not refused it."""
        return self.refusals.allow(guidance) and self.keeps_fence(
            guidance, state, self.fence_look_ahead_s(state)
        )

    def keeps_fence(self, guidance: Guidance, state: OwnState, until_s: float) -> bool:
        """Whether a guidance stays within the fence until `until_s` from now."""
        if self.fence is None:
            return True
        paths = fly_ahead(state, Commands.of([guidance]), self.envelope)
        return not self.fence.breach(paths, until_s, until_s).deepest_m.any()

    def fence_look_ahead_s(self, state: OwnState) -> float:
        """How far ahead no row may leave the fence; 0 without one [s]."""
        if self.fence is None:
            return 0.0
        return min(self.look_ahead_turns * turn_around_s(state, self.envelope), HORIZON_S)
