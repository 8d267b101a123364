"""Whose turn it is to be asked, and how many wait for an answer at a time."""

from companion.mavlink.dialect import Message, mavlink
from companion.ownship.parameter_reader import ParameterReader


def request(name: str) -> Message:
    return mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1)


class Asking:
    def __init__(self, *questions: tuple[str, ...]) -> None:
        self.reader = ParameterReader(questions)
        self.now_s = 100.0

    def next(self, after_s: float = 0.0) -> str | None:
        self.now_s += after_s
        message = self.reader.tick(request, self.now_s)
        return None if message is None else str(message.param_id)


def test_all_are_asked_in_order_three_at_a_time() -> None:
    asking = Asking(("A",), ("B",), ("C",), ("D",))
    assert [asking.next(0.1) for _ in range(4)] == ["A", "B", "C", None]
    asking.reader.observe("B", 1.0, asking.now_s)
    assert asking.next() == "D", "an answer makes room for the next"


def test_who_is_due_first_is_asked_first() -> None:
    asking = Asking(("B",), ("A", "FORMERLY_A"))
    assert [asking.next(0.1) for _ in range(2)] == ["B", "A"]
    # Each name is tried once before the patience grows: A is due again before B, which was asked sooner.
    assert [asking.next(0.5) for _ in range(6)] == [None, "B", "FORMERLY_A", None, "A", "B"]


def test_what_is_answered_or_given_up_is_not_asked_again_before_a_restart() -> None:
    asking = Asking(("A",), ("B",))
    asking.reader.observe("A", 1.0, asking.now_s)
    asked = [asking.next(20.0) for _ in range(12)]
    assert asked.count("B") == 8
    assert asking.reader.settled(["A", "B"])
    asking.reader.restart()
    assert [asking.next(0.1) for _ in range(2)] == ["A", "B"]
    assert asking.reader.values == {"A": 1.0}, "kept until newer ones come"
