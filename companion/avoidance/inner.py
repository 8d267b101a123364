"""Inner layer: the emergency (paper §3.2.3). The whole table is flown ahead; the cheapest row wins."""

from companion.avoidance.cost import Priced, Situation, price
from companion.avoidance.strategies import StrategyTable
from companion.avoidance.trajectory import Tracks
from companion.model import Guidance


def emergency(situation: Situation, table: StrategyTable, tracks: Tracks, held: Guidance | None) -> Priced:
    """The table priced against the tracks, the guidance being flown as its first row if there is one."""
    return price(situation, table.commands(situation), tracks, held)
