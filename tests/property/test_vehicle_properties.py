"""The fake vehicles neither raise nor send a message that cannot be packed, on any input."""

import math
import random
from typing import Any

import pytest

from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import FrameSplitter, decode
from tests.support import arduplane_bench, px4_bench
from tests.support.vehicle_bench import Bench

KINDS = [
    kind
    for kind in mavlink.mavlink_map.values()
    if kind.msgname.startswith(("COMMAND_", "SET_MODE", "SET_POSITION_TARGET_", "PARAM_", "MISSION_"))
    or kind.msgname in ("REQUEST_DATA_STREAM", "TIMESYNC", "PING", "ADSB_VEHICLE")
]
COMMANDS = [16, 17, 20, 21, 22, 176, 178, 192, 224, 300, 400, 511, 512, 5001, 5003, 43000, 43001, 43002]
FLOATS = [0.0, 1.0, -1.0, 4.0, 6.0, 100.0, 1e38, -1e38, math.nan, math.inf, -math.inf]
BITS = {f"{sign}int{bits}_t": (sign, bits) for sign in ("u", "") for bits in (8, 16, 32, 64)}
MESSAGES = 4000


def value(name: str, kind: str, names: list[str], chance: random.Random) -> Any:
    if kind == "char":
        return chance.choice(names).encode() if name == "param_id" else b"X"
    if kind in ("float", "double"):
        return chance.choice(FLOATS)
    if name in ("target_system", "target_component"):
        return 1
    if name == "command":
        return chance.choice(COMMANDS)
    sign, bits = BITS[kind]
    lowest, highest = (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return chance.choice([lowest, highest, 0, 1, 5, min(3520, highest), chance.randint(lowest, highest)])


def over_the_wire(message: Message, encoder: Encoder, splitter: FrameSplitter) -> Message | None:
    (frame,) = splitter.feed_datagram(encoder.encode(message, 255, 190))
    return decode(frame)


@pytest.mark.parametrize("airborne", [arduplane_bench.airborne, px4_bench.airborne])
@pytest.mark.parametrize("seed", [1, 2])
def test_hostile_messages_do_not_raise(airborne: Any, seed: int) -> None:
    chance, encoder, splitter = random.Random(seed), Encoder(), FrameSplitter()
    bench: Bench = airborne()
    names = [parameter.name for parameter in bench.vehicle.parameters]
    for _ in range(MESSAGES):
        kind = chance.choice(KINDS)
        values = [
            value(name, of, names, chance) for name, of in zip(kind.fieldnames, kind.fieldtypes, strict=True)
        ]
        message = over_the_wire(kind(*values), encoder, splitter)
        if message is not None:
            bench.vehicle.receive(message, bench.vehicle.time_s)
        for outgoing in bench.vehicle.step(bench.vehicle.time_s + 0.05):
            encoder.encode(outgoing.message, 1, 1)
    assert all(math.isfinite(number) for number in bench.vehicle.truth.position_m)
