"""Which frames of traffic wait, and in what order they are processed."""

from dataclasses import dataclass

from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.facts import Fact, Traffic
from companion.mavlink.framing import Frame, FrameSplitter
from companion.traffic import Urgency
from companion.traffic_queue import TrafficQueue
from sim.traffic import ALL_VALID

NOW_US = 1_750_000_000_000_000
URGENCIES = {"A00001": Urgency.THREAT, "A00002": Urgency.NEAR_AGAIN, "A00003": Urgency.NEAR}


def made(message: Message) -> Frame:
    (frame,) = FrameSplitter().feed_datagram(Encoder().encode(message, 1, 156))
    return frame


def report(icao: int, callsign: bytes = b"T") -> Frame:
    return made(
        mavlink.MAVLink_adsb_vehicle_message(
            icao, 480_000_000, 110_000_000, 1, 500_000, 0, 5_000, 0, callsign, 1, 0, ALL_VALID, 1200
        )
    )


def urgency(fact: Fact, _now_s: float) -> Urgency | None:
    return URGENCIES.get(fact.report.key, Urgency.NEW) if isinstance(fact, Traffic) else None


@dataclass
class Bench:
    """A queue, and what was processed; each frame takes `takes_s`."""

    takes_s: float = 0.005

    def __post_init__(self) -> None:
        self.clock_s = 0.0
        self.processed: list[Frame] = []
        self.queue = TrafficQueue(urgency, lambda: self.clock_s)

    def hear(self, *frames: Frame, at_us: int = NOW_US) -> None:
        for frame in frames:
            if not self.queue.takes(frame, at_us):
                self.queue.process(frame, self._act)

    def tick(self, at_us: int = NOW_US) -> None:
        self.queue.begin(at_us)
        while (frame := self.queue.next()) is not None:
            self.queue.process(frame, self._act)

    def _act(self, frame: Frame) -> None:
        self.clock_s += self.takes_s
        self.processed.append(frame)


def test_without_a_crowd_nothing_waits() -> None:
    bench = Bench(takes_s=0.0001)
    frames = [report(number) for number in range(1, 100)]
    bench.hear(*frames)
    assert bench.processed == frames


def test_threats_and_what_is_not_traffic_do_not_wait() -> None:
    bench = Bench()
    beats = [made(mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)) for _ in range(9)]
    crowd = [report(0xB00000 + number) for number in range(20)]
    bench.hear(*crowd, *beats, report(0xA00001))
    assert bench.processed == [*crowd[:3], *beats, report(0xA00001)]
    assert bench.queue.dropped == 0


def test_the_most_urgent_of_those_that_wait_come_first() -> None:
    bench = Bench()
    crowd = [report(0xB00000 + number) for number in range(5)]
    bench.hear(*crowd[:5], report(0xA00003))
    bench.processed.clear()
    bench.tick()
    assert bench.processed == [report(0xA00003), crowd[3], crowd[4]]


def test_even_threats_wait_when_they_are_a_crowd_and_only_their_newest_counts() -> None:
    bench = Bench()
    bench.hear(*[report(0xA00001, str(number).encode()) for number in range(100)])
    assert len(bench.processed) == 5
    assert bench.queue.dropped == 94
    bench.tick()
    assert bench.processed[5:] == [report(0xA00001, b"99")]


def test_what_waits_too_long_and_what_has_no_place_is_dropped_the_least_urgent_first() -> None:
    bench = Bench()
    bench.hear(*[report(0xB00000 + number) for number in range(2000)], report(0xA00003))
    assert bench.queue.dropped == 3 + 2001 - 1000 - 6
    bench.tick(NOW_US + 2_000_000)
    assert bench.queue.next() is None
    assert bench.queue.dropped == 2001 - 3


def test_a_frame_without_a_fact_does_not_wait() -> None:
    bench = Bench()
    unplaced = made(mavlink.MAVLink_global_position_int_message(0, 0, 0, 0, 0, 0, 0, 0, 0))
    bench.hear(*[report(0xB00000 + number) for number in range(9)], unplaced)
    assert bench.processed[-1] == unplaced
