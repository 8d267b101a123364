"""Which links lead to our autopilot, and which of them the senders of traffic are heard on."""

from collections import defaultdict
from collections.abc import Callable, Sequence

from companion.links.link import Link
from companion.links.rank import Address
from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import Frame
from companion.output.effects import Place

_TRAFFIC = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE,
        mavlink.MAVLINK_MSG_ID_UTM_GLOBAL_POSITION,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_LOCATION,
        mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_MESSAGE_PACK,
    }
)


class Sides:
    """Learned from the frames of all links. A link that led to the autopilot once still does."""

    def __init__(self, links: Sequence[Link], is_own: Callable[[Frame], bool]) -> None:
        """`is_own` is whether a frame is one of ours that comes back."""
        self._links = links
        self._is_own = is_own
        self._led_to: dict[Link, Address] = {}
        self._heard_on: defaultdict[Address, set[Link]] = defaultdict(set)

    def observe(self, frames: Sequence[Frame], link: Link) -> None:
        """Note who sent frames that arrived on a link."""
        for frame in frames:
            sender = (frame.system_id, frame.component_id)
            if sender == link.ours:
                self._led_to[link] = sender
            elif frame.message_id in _TRAFFIC and not self._is_own(frame):
                self._heard_on[sender].add(link)

    def links_to(self, place: Place) -> list[Link]:
        """The links of this place that we send on."""
        if place == "all":
            return list(self._links)
        leading = {link for link in self._links if self._leads(link)}
        if not leading:
            return []  # not known yet
        wanted = place == "autopilot"
        return [link for link in self._links if (link in leading) is wanted and not link.listen_only]

    def elsewhere(self, place: Place) -> frozenset[Address]:
        """The senders of traffic that are heard on none of the links to this place."""
        there = set(self.links_to(place))
        return frozenset(sender for sender, links in self._heard_on.items() if links.isdisjoint(there))

    def _leads(self, link: Link) -> bool:
        return link.ours is not None and self._led_to.get(link) == link.ours
