"""Traffic: from reports of other aircraft to their tracks."""

from companion.traffic.params import TrafficParams
from companion.traffic.target import Dropped
from companion.traffic.tracker import Tracker

__all__ = ["Dropped", "Tracker", "TrafficParams"]
