"""Makes the files of `tests/data` again: `python -m tests.support.make_data`.

Nothing in them comes from elsewhere: the recordings are of the fake vehicles, every other number is invented.
"""

import math
import random
import struct
from collections.abc import Iterator, Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.mavlink.dialect import Encoder
from sim.scenario import Autopilot, Scenario, build_world, load_scenario
from tests.support.paths import OWN_DATA

START_S = 1_750_000_000.0
STEP_S = 0.05
SECONDS = 150.0
FLIGHT = """description: Straight on at 250 m; one aircraft head-on, later one from the right.
duration_s: 300
home: {lat_deg: 46.5, lon_deg: 7.5, altitude_m: 560.0}
wind: {north_mps: 2.0, east_mps: -1.0}
start: {where: air, height_m: 250}
mission:
  takeoff_height_m: 60
  waypoints: [{north_m: 9000, east_m: 0, height_m: 250}]
intruders:
  - {icao: B00001, callsign: OWN1, meet_at_s: 60, from_deg: 0, speed_mps: 55}
  - {icao: B00002, callsign: OWN2, meet_at_s: 110, from_deg: 80, speed_mps: 45}
"""
# What a recording has besides what is in every datagram of a vehicle: enough for a replay.
KEPT = frozenset((0, 1, 24, 30, 33, 42, 62, 74, 147, 168, 242, 245, 246, 253))


def records_of(scenario: Scenario, autopilot: Autopilot) -> Iterator[tuple[int, bytes]]:
    """Stamps [us] and frames of a flight on which nobody avoids."""
    world, encoder = build_world(scenario, START_S, autopilot=autopilot), Encoder()
    world.vehicle.add_channel(0, stream_rate_hz=2.0)
    world.vehicle.add_channel(1, stream_rate_hz=0.0)
    ask = mavlink.MAVLink_command_long_message(1, 1, 511, 0, 246, 200_000, 0, 0, 0, 0, 0)
    world.vehicle.receive(ask, START_S, 0)  # for the traffic, which ArduPlane sends on request only
    for number in range(1, round(SECONDS / STEP_S) + 1):
        now_s = START_S + number * STEP_S
        for report in world.receiver.reports(now_s, world.vehicle.truth.position_m):
            world.vehicle.receive(report, now_s, 1)
        for outgoing in world.vehicle.step(now_s):
            if outgoing.channel == 0 and outgoing.message.get_msgId() in KEPT:
                raw = encoder.encode(outgoing.message, world.vehicle.system_id, world.vehicle.component_id)
                yield round(now_s * 1e6), raw


def tlog_of(records: Sequence[tuple[int, bytes]]) -> bytes:
    return b"".join(struct.pack(">Q", time_us) + raw for time_us, raw in records)


def damaged(records: Sequence[tuple[int, bytes]]) -> bytes:
    """What happens to logs: text at the head, a flipped bit, zero pages, time that runs back, a cut end."""
    good = [records[at : at + 120] for at in range(0, 720, 120)]
    wrong = bytearray(tlog_of(good[1]))
    wrong[8 + 6 + 4] ^= 0x10
    earlier = [(time_us - 30_000_000, raw) for time_us, raw in good[3]]
    return b"".join(
        (
            b"console text before the first frame\n",
            tlog_of(good[0]),
            bytes(wrong),
            bytes(4096),
            tlog_of(good[2]),
            struct.pack(">Q", records[0][0]) + of_another_dialect(),
            tlog_of(earlier),
            tlog_of(good[4])[:-7],
        )
    )


def of_another_dialect() -> bytes:
    """A frame of a message that ours does not have."""
    frame = bytes((0xFD, 4, 0, 0, 1, 1, 1, 0x7F, 0x5A, 0, 1, 2, 3, 4))
    checksum = mavlink.x25crc(frame[1:])
    checksum.accumulate(b"M")
    return frame + struct.pack("<H", checksum.crc)


def first_version() -> bytes:
    """A short log of MAVLink 1: on the ground, without traffic, and without a position."""
    packer = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    records = []
    for second in range(300):
        for message in (
            mavlink.MAVLink_heartbeat_message(1, 3, 81, 0, 3, 3),
            mavlink.MAVLink_vfr_hud_message(0.0, 0.0, 90, 0, 560.0, 0.0),
        ):
            packer.seq = len(records) % 256
            time_us = round((START_S + second) * 1e6)
            records.append((time_us, message.pack(packer, force_mavlink1=True)))
    return tlog_of(records)


def model(rng: random.Random) -> str:
    """A small encounter model with all kinds of dependences; its counts are invented."""
    sizes = (2, 2, 2, 3, 3, 3, 3)
    later = (*sizes, 3, 3, 3)
    parents: dict[int, tuple[int, ...]] = {1: (0,), 2: (0, 1), 3: (1, 2), 4: (3,), 5: (2, 3), 6: (3, 5)}
    after: dict[int, tuple[int, ...]] = {7: (3, 4), 8: (2, 5), 9: (5, 6)}
    sections = {
        "labels_initial": ['"G", "A", "L", "v", "\\dot v", "\\dot h", "\\dot \\psi"'],
        "G_initial": graph(7, parents),
        "r_initial": [row(sizes)],
        "N_initial": [row(n for child in range(7) for n in counts(rng, sizes, child, parents))],
        "labels_transition": ['"G", "A", "L", "v", "\\dot v", "\\dot h", "\\dot \\psi", "v1", "h1", "psi1"'],
        "G_transition": graph(10, after),
        "r_transition": [row(later)],
        "N_transition": [row(n for child in after for n in counts(rng, later, child, after))],
        "boundaries": ["*", "*", "500 1200 3000", "50 80 120 160", "-2 -0.5 0.5 2",
                       "-1000 -200 200 1000", "-3 -0.5 0.5 3"],
        "resample_rates": ["0 0 0 0 0.1 0.1 0.1"],
    }  # fmt: skip
    return "".join(f"# {name}\n" + "".join(f"{line}\n" for line in lines) for name, lines in sections.items())


def graph(size: int, parents: dict[int, tuple[int, ...]]) -> list[str]:
    return [row(int(parent in parents.get(child, ())) for child in range(size)) for parent in range(size)]


def counts(
    rng: random.Random, sizes: Sequence[int], child: int, parents: dict[int, tuple[int, ...]]
) -> Iterator[int]:
    """For each combination of the parents; the middle, level and straight on, is the most frequent."""
    for _ in range(math.prod(sizes[parent] for parent in parents.get(child, ()))):
        for value in range(sizes[child]):
            middle = sizes[child] == 3 and value == 1
            yield rng.randint(600, 900) if middle else rng.randint(5, 120)


def row(values: "Iterator[int] | Sequence[int]") -> str:
    return " ".join(map(str, values))


def daa() -> str:
    """In the format of DAIDALUS: 100 kn northward at 4000 ft, and 150 kn from the east across, 120 s long."""
    lines = ["NAME lat lon alt trk gs vs time", "[none] [deg] [deg] [ft] [deg] [knot] [fpm] [s]"]
    for second in range(0, 121, 2):
        north_nmi, east_nmi = 100.0 * (second - 90) / 3600.0, 150.0 * (90 - second) / 3600.0
        aside_deg = (east_nmi + 0.3) / 60.0 / math.cos(math.radians(46.5))
        lines += [
            f"Ownship, {46.5 + north_nmi / 60.0:.7f}, 7.5, 4000.0, 0.0, 100.0, 0.0, {second}.0",
            f"Intruder, 46.5, {7.5 + aside_deg:.7f}, 4000.0, 270.0, 150.0, 0.0, {second}.0",
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write all of it."""
    tlogs = OWN_DATA / "tlogs"
    (OWN_DATA / "two-intruders.yaml").write_text(FLIGHT)
    scenario = load_scenario(OWN_DATA / "two-intruders.yaml")
    flown = {autopilot: list(records_of(scenario, autopilot)) for autopilot in ("ardupilot", "px4")}
    (tlogs / "arduplane_fake_two_intruders.tlog").write_bytes(tlog_of(flown["ardupilot"]))
    (tlogs / "px4_fake_two_intruders.tlog").write_bytes(tlog_of(flown["px4"]))
    quiet = [(time_us, raw) for time_us, raw in flown["ardupilot"] if raw[7] != 246]
    (tlogs / "damaged.tlog").write_bytes(damaged(quiet))
    (tlogs / "first_version.tlog").write_bytes(first_version())
    (OWN_DATA / "encounter-models" / "invented.txt").write_text(model(random.Random(1)))
    (OWN_DATA / "daa-scenarios" / "crossing.daa").write_text(daa())


if __name__ == "__main__":
    main()
