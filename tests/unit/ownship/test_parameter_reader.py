"""The order of parameter requests, and how many wait for an answer at a time."""

from companion.mavlink.dialect import Message, mavlink
from companion.ownship.parameter_reader import ParameterReader


def request(name: str) -> Message:
    return mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1)


class Requests:
    def __init__(self, *questions: tuple[str, ...]) -> None:
        self.reader = ParameterReader(questions)
        self.now_s = 100.0

    def next(self, after_s: float = 0.0) -> str | None:
        self.now_s += after_s
        message = self.reader.tick(request, self.now_s)
        return None if message is None else str(message.param_id)


def test_parameters_are_requested_in_order_three_at_a_time() -> None:
    requests = Requests(("A",), ("B",), ("C",), ("D",))
    assert [requests.next(0.1) for _ in range(4)] == ["A", "B", "C", None]
    requests.reader.observe("B", 1.0, requests.now_s)
    assert requests.next() == "D", "an answer makes room for the next"


def test_the_parameter_that_is_due_first_is_requested_first() -> None:
    requests = Requests(("B",), ("A", "FORMERLY_A"))
    assert [requests.next(0.1) for _ in range(2)] == ["B", "A"]
    # The interval grows after each name was tried once: A is due again before B, which was requested first.
    assert [requests.next(0.5) for _ in range(6)] == [None, "B", "FORMERLY_A", None, "A", "B"]


def test_answered_and_given_up_parameters_are_requested_again_after_a_restart() -> None:
    requests = Requests(("A",), ("B",))
    requests.reader.observe("A", 1.0, requests.now_s)
    names = [requests.next(20.0) for _ in range(12)]
    assert names.count("B") == 12
    assert requests.reader.settled(["A", "B"])
    requests.reader.restart()
    assert [requests.next(0.1) for _ in range(2)] == ["A", "B"]
    assert requests.reader.values == {"A": 1.0}, "kept until newer ones come"
