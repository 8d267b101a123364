"""Simulated receivers of traffic: what an aircraft transmits, in the formats that receivers send."""

import math
from dataclasses import dataclass
from typing import Literal

from sim.receivers.beast import BeastEncoder
from sim.receivers.encoder import ReceiverEncoder, Reception, Transmission
from sim.receivers.flarm import FlarmEncoder
from sim.receivers.gdl90 import Gdl90Encoder
from sim.receivers.mavlink import MavlinkEncoder, RemoteIdEncoder
from sim.receivers.readsb import ReadsbEncoder
from sim.receivers.sbs import SbsEncoder

__all__ = ["FORMATS", "Format", "ReceiverEncoder", "Reception", "Transmission"]

# A receiver of FLARM needs 5 km to warn of an aircraft that comes head-on at 250 kt, and reaches 10 km under
# the best conditions: FTD-078, "Fusion user manual", 6.6. Bluetooth and Wi-Fi of Remote ID end at about 1 km.
_FLARM_RANGE_M, _REMOTE_ID_RANGE_M = 5_000.0, 1_000.0


@dataclass(frozen=True, slots=True)
class Format:
    """How a receiver of this format behaves.

    `sent_as` is what its link carries: datagrams, the pieces of a stream, a whole document to be read, or
    frames of MAVLink. With `gathers` it sends once a second what it heard in that second, otherwise each
    report at once. With `predicts` it extrapolates positions to the time of sending. `range_m` is the usual
    range of its radio.
    """

    encoder: type[ReceiverEncoder]
    sent_as: Literal["datagrams", "stream", "document", "mavlink"]
    gathers: bool = False
    predicts: bool = False
    range_m: float = math.inf


FORMATS: dict[str, Format] = {
    each.encoder.format: each
    for each in (
        Format(Gdl90Encoder, "datagrams"),
        Format(SbsEncoder, "stream"),
        Format(BeastEncoder, "stream"),
        Format(FlarmEncoder, "stream", gathers=True, predicts=True, range_m=_FLARM_RANGE_M),
        Format(ReadsbEncoder, "document", gathers=True),
        Format(MavlinkEncoder, "mavlink"),
        Format(RemoteIdEncoder, "mavlink", range_m=_REMOTE_ID_RANGE_M),
    )
}
