"""Conditions that hold now: each is announced when it begins, repeated while it matters, and when it ends."""

from collections.abc import Iterable
from dataclasses import dataclass

from companion.mavlink.dialect import mavlink
from companion.output.notice import Condition, Notice

_REPEAT_S = 30.0
# A condition that is absent for less than this has not ended: it flickers.
_ENDED_AFTER_S = 3.0
# Many conditions at once must not flood the link: a burst of texts, then one each interval.
_BURST = 5
_INTERVAL_S = 2.0


@dataclass(slots=True)
class _Spell:
    """A condition from its beginning to its end; `announced_s` is the time of its newest text."""

    condition: Condition
    since_s: float
    seen_s: float
    announced_s: float | None = None


class Conditions:
    """Keeps the conditions that hold, and makes the notices about them."""

    def __init__(self) -> None:
        self._spells: dict[str, _Spell] = {}
        self._ended: dict[str, str] = {}  # the text of an end that is not announced yet, by key
        self._announced_s: dict[str, float] = {}  # by key, also of spells before
        self._texts_left = float(_BURST)
        self._ticked_s: float | None = None

    @property
    def holding(self) -> tuple[Condition, ...]:
        """The conditions that hold, the most severe first; without those that have not lasted yet."""
        lasting = [spell for spell in self._spells.values() if _has_lasted(spell)]
        return tuple(spell.condition for spell in sorted(lasting, key=_rank))

    def tick(self, present: Iterable[Condition], now_s: float) -> list[Notice]:
        """The notices that are due, given the conditions that are present at `now_s`."""
        for condition in present:
            self._see(condition, now_s)
        self._end_spells(now_s)
        self._refill(now_s)
        due = [spell for spell in self._spells.values() if self._is_due(spell, now_s)]
        due.sort(key=lambda spell: (spell.announced_s is not None, *_rank(spell)))
        return self._begin_or_repeat(due, now_s) + self._endings()

    def _see(self, condition: Condition, now_s: float) -> None:
        spell = self._spells.get(condition.key)
        if spell is None:
            # The spell before goes on if its end has not been announced.
            goes_on = self._ended.pop(condition.key, None) is not None
            announced_s = self._announced_s.get(condition.key, now_s) if goes_on else None
            self._spells[condition.key] = _Spell(condition, now_s, now_s, announced_s)
            return
        spell.condition, spell.seen_s = condition, now_s

    def _end_spells(self, now_s: float) -> None:
        ended = [spell for spell in self._spells.values() if now_s - spell.seen_s >= _ENDED_AFTER_S]
        for spell in ended:
            key = spell.condition.key
            del self._spells[key]
            if spell.announced_s is not None and spell.condition.ended is not None:
                self._ended[key] = spell.condition.ended

    def _is_due(self, spell: _Spell, now_s: float) -> bool:
        """Whether it is to be announced now: for the first time in this spell, or again."""
        if spell.seen_s != now_s or not _has_lasted(spell):
            return False
        if spell.announced_s is not None and not spell.condition.matters:
            return False
        announced_s = self._announced_s.get(spell.condition.key)
        return announced_s is None or now_s - announced_s >= _REPEAT_S

    def _begin_or_repeat(self, due: list[_Spell], now_s: float) -> list[Notice]:
        notices = []
        for spell in due:
            if not self._take_text():
                break
            condition = spell.condition
            spell.announced_s = self._announced_s[condition.key] = now_s
            notices.append(Notice(condition.severity, condition.text))
        return notices

    def _endings(self) -> list[Notice]:
        holding = {spell.condition.ended for spell in self._spells.values()}
        notices = []
        over = dict.fromkeys(text for text in self._ended.values() if text not in holding)
        for text in over:  # once for all that end together
            if not self._take_text():
                break
            self._ended = {key: one for key, one in self._ended.items() if one != text}
            notices.append(Notice(mavlink.MAV_SEVERITY_NOTICE, text))
        return notices

    def _refill(self, now_s: float) -> None:
        elapsed_s = 0.0 if self._ticked_s is None else max(now_s - self._ticked_s, 0.0)
        self._texts_left = min(self._texts_left + elapsed_s / _INTERVAL_S, float(_BURST))
        self._ticked_s = now_s
        self._announced_s = {k: s for k, s in self._announced_s.items() if now_s - s < _REPEAT_S}

    def _take_text(self) -> bool:
        """Use one of the texts that may be sent; false when there is none left."""
        if self._texts_left < 1.0:
            return False
        self._texts_left -= 1.0
        return True


def _has_lasted(spell: _Spell) -> bool:
    return spell.seen_s - spell.since_s >= spell.condition.after_s


def _rank(spell: _Spell) -> tuple[int, float]:
    return spell.condition.severity, spell.since_s
