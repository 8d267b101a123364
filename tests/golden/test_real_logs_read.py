"""Damaged and real logs: the reader loses no good frame, and their content stays the same."""

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from companion.mavlink.facts import OwnPosition, Traffic
from companion.mavlink.framing import decode
from companion.mavlink.tlog import read_tlog
from companion.mavlink.translate import WANTED, frame_to_fact, to_fact
from companion.model import AltitudeReference
from tests.support.paths import TLOGS

# frames, bad bytes, wrong checksums, unknown messages
COUNTS = {
    "arduplane_fake_two_intruders": (3152, 0, 0, 0),
    "px4_fake_two_intruders": (3152, 0, 0, 0),
    "damaged": (598, 4212, 1, 1),
    "first_version": (600, 0, 0, 0),
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
HERE = [name for name in COUNTS if name in TLOGS]


def those_here(*names: str) -> pytest.MarkDecorator:
    """Runs a test with each of these logs that is here; the first is our own."""
    return pytest.mark.parametrize("name", [name for name in names if name in TLOGS])


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


@pytest.mark.parametrize("name", HERE)
def test_no_good_frame_is_lost_and_damage_is_counted(name: str) -> None:
    path = TLOGS[name]
    reader = read_tlog(path)
    assert [frame.raw for _, frame in reader] == list(every_good_frame(path.read_bytes()))
    counters = reader.counters
    assert (counters.frames, counters.bad_bytes, counters.bad_crc, counters.unknown) == COUNTS[name]


@pytest.mark.parametrize("name", HERE)
def test_reading_only_wanted_messages_changes_no_counter(name: str) -> None:
    everything = read_tlog(TLOGS[name])
    wanted = read_tlog(TLOGS[name], only=WANTED)
    assert list(wanted) == [record for record in everything if record[1].message_id in WANTED]
    assert wanted.counters == everything.counters


@those_here("arduplane_fake_two_intruders", "arduplane_sitl_adsb_two_intruders", "plane_real_2012_v1_apm")
def test_every_frame_decodes_and_gives_the_same_fact_in_both_ways(name: str) -> None:
    for time_us, frame in read_tlog(TLOGS[name], only=WANTED):
        message = decode(frame)
        assert message is not None
        assert frame_to_fact(frame, time_us / 1e6) == to_fact(message, time_us / 1e6)


# Reports of two intruders, their speeds and vertical speeds [m/s]; the recorded ones have no vertical speed.
REPORTS = {
    "arduplane_fake_two_intruders": (302, {45, 55}, {0.0}),
    "arduplane_sitl_adsb_two_intruders": (237, {55, 60}, {None}),
}


@those_here(*REPORTS)
def test_the_arduplane_log_has_two_intruders(name: str) -> None:
    reports = [
        fact.report
        for time_us, frame in read_tlog(TLOGS[name], only=WANTED)
        if isinstance(fact := frame_to_fact(frame, time_us / 1e6), Traffic)
    ]
    count, expected_mps, climbs_mps = REPORTS[name]
    assert len(reports) == count
    assert {report.climb_mps for report in reports} == climbs_mps
    assert all(report.lat_deg is not None and report.course_rad is not None for report in reports)
    speeds_mps = Counter(round(report.ground_speed_mps or 0.0) for report in reports)
    assert set(speeds_mps) == expected_mps
    assert len({report.icao for report in reports}) == 2
    assert {report.altitude_reference for report in reports} <= set(AltitudeReference)


@those_here("px4_fake_two_intruders", "plane_real_2016_v2_cuav_tests")
def test_an_intact_log_is_read_byte_for_byte(name: str) -> None:
    reader = read_tlog(TLOGS[name])
    records = b"".join(time_us.to_bytes(8, "big") + frame.raw for time_us, frame in reader)
    assert records == reader.path.read_bytes()


@pytest.mark.parametrize(
    ("name", "backwards"),
    [(name, n) for name, n in (("damaged", 1), ("copter_2021_v2_zero_pages", 2)) if name in TLOGS],
)
def test_stamps_that_run_backwards_are_returned_as_written(name: str, backwards: int) -> None:
    stamps_us = [time_us for time_us, _ in read_tlog(TLOGS[name])]
    assert sum(later < earlier for earlier, later in pairwise(stamps_us)) == backwards


@those_here("px4_fake_two_intruders", "plane_real_2018_v2_cuav")
def test_a_flight_has_plausible_positions(name: str) -> None:
    positions = [
        fact
        for time_us, frame in read_tlog(TLOGS[name], only={33})
        if isinstance(fact := frame_to_fact(frame, time_us / 1e6), OwnPosition)
    ]
    assert len(positions) >= 300
    assert all(abs(value) < 100.0 for fact in positions for value in fact.velocity_mps)
    assert {fact.sender.component_id for fact in positions} == {1}
