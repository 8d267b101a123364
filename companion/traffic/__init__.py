"""Traffic: from reports of other aircraft to their tracks."""

from companion.traffic.concerns import Concern, ConcernKind
from companion.traffic.measurement import DropReason
from companion.traffic.params import HeightParams, TrafficParams
from companion.traffic.picture import TrafficPicture
from companion.traffic.tracker import Tracker

__all__ = [
    "Concern",
    "ConcernKind",
    "DropReason",
    "HeightParams",
    "Tracker",
    "TrafficParams",
    "TrafficPicture",
]
