"""Inner layer: the emergency (paper §3.2). The whole strategy table is flown ahead; the cheapest row wins."""

from companion.avoidance.prediction import Tracks
from companion.avoidance.strategies import Priced, Situation, price, table_commands
from companion.model import Guidance


def emergency(situation: Situation, tracks: Tracks, held: Guidance | None) -> Priced:
    """The table priced against the tracks, the guidance being flown as its first row if there is one."""
    return price(situation, table_commands(situation), tracks, held)
