"""What is flown or advised against traffic: each change that a pilot notices is announced as it is flown."""

import math
from dataclasses import dataclass

from companion.gcs.phrases import Maneuver, TrafficSituation, clear_notice, conflict_notice, resume_notice
from companion.geodesy import wrap_pi
from companion.model import Guidance, Ownship, TextUnits
from companion.output.notice import AnyNotice, ConflictNotice, Notice, ResumeNotice

# Changes that a pilot notices: of the course, of the height (50 ft) and of the airspeed.
_COURSE_RAD, _HEIGHT_M, _SPEED_MPS = math.radians(20.0), 15.0, 2.0
# The other way round, a smaller change is noticed.
_REVERSED_RAD, _REVERSED_M = math.radians(8.0), 6.0
# A conflict that goes on without a change is announced again only after this time.
_REPEAT_S = 30.0
# Many changes in a row: a burst of texts, then one each interval; reversals have as many in reserve.
_BURST, _INTERVAL_S = 3, 3.0
# The text that the aircraft is let go stays on the display for this long before advice follows.
_LET_GO_S = 3.0


@dataclass(frozen=True, slots=True)
class _Announced:
    """The guidance announced last, and from which flight: which way it turns and climbs."""

    guidance: Guidance
    flying: bool
    turn_rad: float
    climb_m: float

    @classmethod
    def of(cls, guidance: Guidance, own: Ownship, *, flying: bool) -> "_Announced":
        course_rad = math.atan2(own.velocity_mps[1], own.velocity_mps[0])
        turn_rad = wrap_pi(guidance.course_rad - course_rad)
        return cls(guidance, flying, turn_rad, guidance.altitude_m + own.position_m[2])

    def reverses(self, before: "_Announced") -> bool:
        """Whether it turns or climbs the other way than the one before."""
        turned_rad = wrap_pi(self.guidance.course_rad - before.guidance.course_rad)
        risen_m = self.guidance.altitude_m - before.guidance.altitude_m
        turns = self.turn_rad * before.turn_rad < 0.0 and self.turn_rad * turned_rad > 0.0
        climbs = self.climb_m * before.climb_m < 0.0 and self.climb_m * risen_m > 0.0
        return (turns and min(abs(self.turn_rad), abs(turned_rad)) > _REVERSED_RAD) or (
            climbs and min(abs(self.climb_m), abs(risen_m)) > _REVERSED_M
        )

    def differs(self, before: "_Announced") -> bool:
        """Whether a pilot notices the difference from the one before."""
        now, then = self.guidance, before.guidance
        return (
            abs(wrap_pi(now.course_rad - then.course_rad)) > _COURSE_RAD
            or abs(now.altitude_m - then.altitude_m) > _HEIGHT_M
            or abs(now.airspeed_mps - then.airspeed_mps) > _SPEED_MPS
            or self.reverses(before)
        )


class ManeuverNotices:
    """Words the notices about conflicts, and adds one for each noticeable change of what is flown."""

    def __init__(self) -> None:
        self.words = ""  # the manoeuvre announced last, while it lasts
        self.text = ""  # the same with the traffic, as announced
        # Of what was flown, and of what was advised: an attempt that fails again and again alternates.
        self._last: dict[bool, _Announced] = {}
        self._last_words: dict[bool, tuple[str, str]] = {}
        self._last_s: dict[str, float] = {}  # by layer, threat and whether it was flown
        self._number = 0
        self._texts_left, self._refilled_s = float(_BURST), 0.0
        self._commanded = False
        self._flown_s = -math.inf  # when it was last flown, or announced as flown

    def worded(
        self, notice: AnyNotice, situation: TrafficSituation, units: TextUnits, now_s: float
    ) -> Notice | None:
        """The notice in words; `None` when there is nothing to say, or nothing new."""
        match notice:
            case ConflictNotice(flying):
                return self._conflict(situation, units, now_s, flying=flying)
            case ResumeNotice(mode):
                self._forget()
                return resume_notice(situation, mode)
            case Notice():
                return notice

    def changes(
        self,
        commanded: Guidance | None,
        situation: TrafficSituation,
        units: TextUnits,
        now_s: float,
        *,
        returning: bool,
    ) -> list[Notice]:
        """The notice about what is commanded on this tick, when it differs from what was announced last.

        `commanded` is `None` while nothing is commanded; `returning`: it is the way back to the mission.
        """
        own = situation.own
        if commanded is None or own is None:
            if self._commanded:
                self._forget()
            elif not situation.decision.threats:
                self.words = self.text = ""
            self._commanded = False
            return []
        self._commanded, self._flown_s = True, now_s
        present = _Announced.of(commanded, own, flying=True)
        last = self._last.get(True)
        if last is not None and not present.differs(last):
            return []
        if not self._take_text(present, now_s):
            return []
        why = "returning" if returning else situation.decision.because.split(", ")[-1]
        notice = self._announce(present, situation, units, now_s, why)
        return [] if notice is None else [notice]

    def _conflict(
        self, situation: TrafficSituation, units: TextUnits, now_s: float, *, flying: bool
    ) -> Notice | None:
        """The conflict, unless it was announced lately with a manoeuvre that a pilot does not distinguish."""
        own, decision = situation.own, situation.decision
        if own is None or not decision.threats or decision.guidance is None:
            return None
        if not flying and 0.0 <= now_s - self._flown_s < _LET_GO_S:
            return None
        present = _Announced.of(decision.guidance, own, flying=flying)
        last_s, last = self._last_s.get(_subject(situation, flying=flying)), self._last.get(flying)
        if last is not None and last_s is not None and now_s - last_s < _REPEAT_S:
            if not present.differs(last):
                self.words, self.text = self._last_words[flying]
                return None
            if not self._take_text(present, now_s):
                return None
        return self._announce(present, situation, units, now_s, "")

    def _announce(
        self, present: _Announced, situation: TrafficSituation, units: TextUnits, now_s: float, why: str
    ) -> Notice | None:
        assert situation.own is not None
        maneuver = Maneuver.of(present.guidance, situation.own, situation.home_m, units)
        self._number += 1
        topic = f"manoeuvre {self._number}"
        notice: Notice | None
        if situation.decision.threats:
            notice = conflict_notice(maneuver, situation, units, flying=present.flying, topic=topic)
        else:
            notice = clear_notice(maneuver, why, topic=topic)
        if notice is not None:
            self._last[present.flying] = present
            self._flown_s = now_s if present.flying else self._flown_s
            self._last_s = {k: s for k, s in self._last_s.items() if now_s - s < _REPEAT_S}
            self._last_s[_subject(situation, flying=present.flying)] = now_s
            self.words = maneuver.text if present.flying else f"Advise {maneuver.text}"
            self.text = notice.text
            self._last_words[present.flying] = self.words, self.text
        return notice

    def _forget(self) -> None:
        """Nothing is flown any more: the next manoeuvre is a new one."""
        self.words = self.text = ""
        self._last, self._last_s = {}, {}

    def _take_text(self, present: _Announced, now_s: float) -> bool:
        """Use one of the texts that may be sent; false when there is none left."""
        elapsed_s = max(now_s - self._refilled_s, 0.0)
        self._texts_left = min(self._texts_left + elapsed_s / _INTERVAL_S, float(_BURST))
        self._refilled_s = now_s
        last = self._last.get(present.flying)
        reserve = _BURST if last is None or present.reverses(last) else 0
        if self._texts_left + reserve < 1.0:
            return False
        self._texts_left -= 1.0
        return True


def _subject(situation: TrafficSituation, *, flying: bool) -> str:
    """The layer, the most urgent threat, and whether it is flown."""
    decision = situation.decision
    threat = decision.threats[0].track_id if decision.threats else ""
    return f"{decision.layer} {'flown' if flying else 'advised'} {threat}"
