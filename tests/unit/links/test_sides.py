"""Which links lead to the autopilot, and what is heard where."""

from companion.links import Link, memory_pair
from companion.links.sides import Sides
from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import Frame, FrameSplitter, make_frame

ADSB, BEAT = mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, mavlink.MAVLINK_MSG_ID_HEARTBEAT
RECEIVER, AUTOPILOT = (1, 156), (1, 1)


def frame(message_id: int, sender: tuple[int, int], sequence: int = 0) -> Frame:
    (made,) = FrameSplitter().feed_datagram(make_frame(message_id, b"\1" * 38, sequence, *sender))
    return made


def links(count: int) -> list[Link]:
    made: list[Link] = [memory_pair()[0] for _ in range(count)]
    for link in made:
        link.ours = AUTOPILOT
    return made


def test_links_are_divided_by_where_the_autopilot_is_heard() -> None:
    first, second = both = links(2)
    sides = Sides(both, lambda _frame: False)
    assert sides.links_to("autopilot") == sides.links_to("station") == []
    sides.observe([frame(BEAT, AUTOPILOT)], first)
    sides.observe([frame(BEAT, (255, 190))], second)
    assert sides.links_to("autopilot") == [first]
    assert sides.links_to("station") == [second]
    assert sides.links_to("all") == both
    for link in both:
        link.ours = (2, 1)  # another autopilot is flown
    assert sides.links_to("autopilot") == []


def test_a_link_that_only_listens_is_no_place_to_send_to() -> None:
    first, second = both = links(2)
    second.listen_only = True
    sides = Sides(both, lambda _frame: False)
    sides.observe([frame(BEAT, AUTOPILOT)], first)
    sides.observe([frame(ADSB, RECEIVER)], second)
    assert sides.links_to("station") == []
    assert sides.elsewhere("station") == {RECEIVER}


def test_traffic_is_elsewhere_if_it_is_heard_on_no_link_to_the_place() -> None:
    first, second, third = three = links(3)
    sides = Sides(three, lambda _frame: False)
    sides.observe([frame(BEAT, AUTOPILOT), frame(ADSB, (1, 100))], first)
    sides.observe([frame(ADSB, RECEIVER)], second)
    assert sides.elsewhere("autopilot") == {RECEIVER}
    assert sides.elsewhere("station") == {(1, 100)}
    sides.observe([frame(ADSB, RECEIVER)], first)  # and by a router
    assert sides.elsewhere("autopilot") == frozenset()
    assert sides.links_to("station") == [second, third]


def test_our_own_frames_that_come_back_are_nobodys() -> None:
    first, second = both = links(2)
    echo = frame(ADSB, RECEIVER, 7)
    sides = Sides(both, lambda one: one.raw == echo.raw)
    sides.observe([frame(BEAT, AUTOPILOT), echo], first)
    sides.observe([frame(ADSB, RECEIVER, 8)], second)
    assert sides.elsewhere("autopilot") == {RECEIVER}
