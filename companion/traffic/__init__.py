"""Traffic: from reports of other aircraft to their tracks."""

from companion.traffic.altitude_datums import Datum, HeightParams, OwnHeights
from companion.traffic.ownship_echo import OwnMotion
from companion.traffic.params import TrafficParams
from companion.traffic.target import Dropped
from companion.traffic.tracker import Tracker

__all__ = ["Datum", "Dropped", "HeightParams", "OwnHeights", "OwnMotion", "Tracker", "TrafficParams"]
