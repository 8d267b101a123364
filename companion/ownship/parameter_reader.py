"""Parameters of the autopilot: requested by name, a few at a time, until answered or given up."""

import math
from bisect import insort
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from operator import attrgetter

from companion.mavlink.dialect import Message

_AT_A_TIME = 3
_ANSWER_S = 1.0
_LONGEST_WAIT_S = 16.0
# For each name. With 30 % of the datagrams lost in each direction, one value in three thousand is given up.
_TRIES = 12
# Interval at which one known value after the other is requested again, to find changes whose report was lost.
_REFRESH_S = 10.0


@dataclass(slots=True)
class _Question:
    """One parameter, by its names in several versions, the newest first."""

    names: tuple[str, ...]
    tries: int = 0
    sent_s: float = -math.inf
    due_s: float = -math.inf
    answered_s: float | None = None

    @property
    def open(self) -> bool:
        return self.answered_s is None and self.tries < _TRIES * len(self.names)


class ParameterReader:
    """Requests parameters and stores their values.

    A value that arrives without a request, as after a ground station changed it, is stored too. A parameter
    that is not answered under any of its names is requested at growing intervals, and given up in the end.
    `restart` requests all of them again; the values stay until newer ones arrive.
    """

    def __init__(self, questions: tuple[tuple[str, ...], ...]) -> None:
        self.values: dict[str, float] = {}
        self._questions = [_Question(names) for names in questions]
        self._by_name = {name: question for question in self._questions for name in question.names}
        self._open = [*self._questions]  # neither answered nor given up, in the order of their `due_s`
        self._waiting: list[_Question] = []  # requested within `_ANSWER_S`
        self._refreshed_s = -math.inf

    def settled(self, names: Iterable[str]) -> bool:
        """Whether these parameters are answered or given up."""
        return not any(self._by_name[name].open for name in names if name in self._by_name)

    def restart(self) -> None:
        """Request everything again, because the autopilot restarted or was out of contact."""
        for question in self._questions:
            question.tries, question.answered_s = 0, None
            question.sent_s = question.due_s = -math.inf
        self._open = [*self._questions]

    def observe(self, name: str, value: float, now_s: float) -> bool:
        """Store a value; returns whether it belongs to a question and has changed."""
        question = self._by_name.get(name)
        if question is None:
            return False
        if question.answered_s is None:
            question.answered_s = now_s
            self._open = [one for one in self._open if one.open]
        question.answered_s = now_s
        changed = self.values.get(name) != value
        self.values[name] = value
        return changed

    def tick(self, request: Callable[[str], Message], now_s: float) -> Message | None:
        """The request to send now, if any; `request` makes one from a name."""
        name = self._due(now_s) or self._stale(now_s)
        return None if name is None else request(name)

    def _due(self, now_s: float) -> str | None:
        if not self._open or now_s < self._open[0].due_s:
            return None
        self._waiting = [one for one in self._waiting if one.open and now_s - one.sent_s < _ANSWER_S]
        if len(self._waiting) == _AT_A_TIME:
            return None
        question = self._open.pop(0)
        name = question.names[question.tries % len(question.names)]
        rounds = question.tries // len(question.names)
        question.tries += 1
        question.sent_s = now_s
        question.due_s = now_s + min(_ANSWER_S * 2.0**rounds, _LONGEST_WAIT_S)
        if question.open:
            self._waiting.append(question)
            insort(self._open, question, key=attrgetter("due_s"))
        return name

    def _stale(self, now_s: float) -> str | None:
        if now_s - self._refreshed_s < _REFRESH_S:
            return None
        answered = [(q.answered_s, q) for q in self._questions if q.answered_s is not None]
        if not answered:
            return None
        _, oldest = min(answered, key=lambda pair: pair[0])
        self._refreshed_s = now_s
        # The next call takes another parameter, whether this answer arrives or not.
        oldest.answered_s = now_s
        return next((name for name in oldest.names if name in self.values), oldest.names[0])
