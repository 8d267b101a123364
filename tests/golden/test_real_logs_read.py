"""Real logs with real damage: the reader loses no good frame, and their content stays the same."""

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from companion.mavlink.facts import OwnPosition, Traffic
from companion.mavlink.framing import decode
from companion.mavlink.tlog import read_tlog
from companion.mavlink.translate import WANTED, frame_to_fact, to_fact
from companion.model import AltitudeReference
from tests.support.paths import TLOGS as LOGS

pytestmark = pytest.mark.skipif(
    not LOGS.is_dir(), reason=f"the recorded logs are not beside the checkout ({LOGS})"
)

# frames, bad bytes, wrong checksums, unknown messages
COUNTS = {
    "arduplane_sitl_adsb_two_intruders": (19374, 0, 0, 0),
    "px4_sih_fixed_wing_adsb_two_intruders": (37059, 0, 0, 339),
    "plane_real_2012_v1_apm": (47872, 0, 0, 0),
    "plane_real_2016_v2_cuav_tests": (32078, 0, 0, 0),
    "plane_real_2018_v2_cuav": (19205, 0, 0, 0),
    "copter_2021_v2_zero_pages": (27520, 4731, 0, 0),
    "copter_2021_v2_cut": (3590, 14, 0, 0),
    "copter_real_2015_v1_badcrc": (75477, 27613, 1321, 0),
    "rover_sim_2025_v2_text_head": (96646, 2565, 0, 0),
}


def log_path(name: str) -> Path:
    path = LOGS / f"{name}.tlog"
    if not path.exists():
        pytest.skip(f"{path} is missing")
    return path


def every_good_frame(data: bytes) -> Iterator[bytes]:
    """Tries pymavlink's checksum at every byte that could begin a frame: slow, but needs no records."""
    at = 0
    while at < len(data):
        size = good_frame_size(data, at) if data[at] in (0xFD, 0xFE) else 0
        if size:
            yield data[at : at + size]
        at += size or 1


def good_frame_size(data: bytes, at: int) -> int:
    header_size = 10 if data[at] == 0xFD else 6
    header = data[at : at + header_size]
    if len(header) < header_size:
        return 0
    signed = header_size == 10 and header[2] & 1
    message_id = int.from_bytes(header[7:10], "little") if header_size == 10 else header[5]
    kind = ardupilotmega.mavlink_map.get(message_id)
    end = at + header_size + header[1]
    if kind is None or (header_size == 10 and header[2] & ~1) or end + 2 + 13 * signed > len(data):
        return 0
    checksum = ardupilotmega.x25crc(data[at + 1 : end])
    checksum.accumulate(bytes((kind.crc_extra,)))
    return end + 2 + 13 * signed - at if data[end : end + 2] == checksum.crc.to_bytes(2, "little") else 0


@pytest.mark.parametrize("name", COUNTS)
def test_no_good_frame_is_lost_and_damage_is_counted(name: str) -> None:
    path = log_path(name)
    reader = read_tlog(path)
    assert [frame.raw for _, frame in reader] == list(every_good_frame(path.read_bytes()))
    counters = reader.counters
    assert (counters.frames, counters.bad_bytes, counters.bad_crc, counters.unknown) == COUNTS[name]


@pytest.mark.parametrize("name", COUNTS)
def test_reading_only_wanted_messages_changes_no_counter(name: str) -> None:
    everything = read_tlog(log_path(name))
    wanted = read_tlog(log_path(name), only=WANTED)
    assert list(wanted) == [record for record in everything if record[1].message_id in WANTED]
    assert wanted.counters == everything.counters


@pytest.mark.parametrize("name", ["arduplane_sitl_adsb_two_intruders", "plane_real_2012_v1_apm"])
def test_every_frame_decodes_and_gives_the_same_fact_in_both_ways(name: str) -> None:
    for time_us, frame in read_tlog(log_path(name), only=WANTED):
        message = decode(frame)
        assert message is not None
        assert frame_to_fact(frame, time_us / 1e6) == to_fact(message, time_us / 1e6)


def test_the_arduplane_log_has_two_intruders_without_vertical_speed() -> None:
    reports = [
        fact.report
        for time_us, frame in read_tlog(log_path("arduplane_sitl_adsb_two_intruders"), only=WANTED)
        if isinstance(fact := frame_to_fact(frame, time_us / 1e6), Traffic)
    ]
    assert len(reports) == 237
    assert {report.climb_mps for report in reports} == {None}
    assert all(report.lat_deg is not None and report.course_rad is not None for report in reports)
    speeds_mps = Counter(round(report.ground_speed_mps or 0.0) for report in reports)
    assert set(speeds_mps) == {55, 60}
    assert len({report.icao for report in reports}) == 2
    assert {report.altitude_reference for report in reports} <= set(AltitudeReference)


def test_an_intact_log_is_read_byte_for_byte() -> None:
    reader = read_tlog(log_path("plane_real_2016_v2_cuav_tests"))
    records = b"".join(time_us.to_bytes(8, "big") + frame.raw for time_us, frame in reader)
    assert records == reader.path.read_bytes()


def test_stamps_that_run_backwards_are_returned_as_written() -> None:
    stamps_us = [time_us for time_us, _ in read_tlog(log_path("copter_2021_v2_zero_pages"))]
    assert sum(later < earlier for earlier, later in pairwise(stamps_us)) == 2


def test_a_flight_has_plausible_positions() -> None:
    positions = [
        fact
        for time_us, frame in read_tlog(log_path("plane_real_2018_v2_cuav"), only={33})
        if isinstance(fact := frame_to_fact(frame, time_us / 1e6), OwnPosition)
    ]
    assert len(positions) > 600
    assert all(abs(value) < 100.0 for fact in positions for value in fact.velocity_mps)
    assert {fact.sender.component_id for fact in positions} == {1}
