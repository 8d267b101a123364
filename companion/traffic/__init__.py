"""Traffic: from reports of other aircraft to their tracks."""

from companion.traffic.altitude_datums import HeightParams
from companion.traffic.params import TrafficParams
from companion.traffic.picture import Tracker, TrafficPicture
from companion.traffic.target import DropReason

__all__ = ["DropReason", "HeightParams", "Tracker", "TrafficParams", "TrafficPicture"]
