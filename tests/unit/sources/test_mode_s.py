"""Mode S messages to reports: real messages, those of all services, and damaged ones."""

import math

import pytest

from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource
from companion.sources.decoder import DecoderCounters
from companion.sources.mode_s import ModeSDecoder
from sim.receivers import mode_s
from sim.receivers.encoder import Transmission
from tests.support.adsb_receivers import PLACE, aircraft, distance_m, moved

ADDRESS = 0x4840D6


class Receiver:
    """A decoder of single messages, with its counters."""

    def __init__(self) -> None:
        self.counters = DecoderCounters()
        self.decoder = ModeSDecoder(self.counters)

    def hear(self, raw: bytes, received_s: float, is_mlat: bool = False) -> list[TrafficReport]:
        return self.decoder.decode(raw, received_s, is_mlat=is_mlat)

    def fly(
        self,
        sent: Transmission,
        end_s: float = 2.0,
        begin_s: float = 0.0,
        control: int | None = None,
        imf: bool = False,
        is_mlat: bool = False,
    ) -> list[TrafficReport]:
        """Velocity and position twice a second, as DF17 or as DF18 with the control field."""
        found = []
        for step in range(round(2 * (end_s - begin_s))):
            velocity, position = mode_s.velocity(sent), mode_s.position(sent, is_odd=step % 2 == 1)
            contents = velocity | imf << 47, position | imf << (35 if sent.on_ground else 48)
            for content in contents:
                found += self.hear(message(sent.icao, content, control), begin_s + 0.5 * step, is_mlat)
        return found


def message(address: int, content: int, control: int | None = None) -> bytes:
    if control is None:
        return mode_s.squitter(address, content)
    return mode_s.other_squitter(address, content, control)


def test_recorded_positions() -> None:
    """From "The 1090 Megahertz Riddle", an odd one and an even one 4 s later, and both once more."""
    receiver, found = Receiver(), []
    odd, even = "8D40621D58C386435CC412692AD6", "8D40621D58C382D690C8AC2863A7"
    for number, raw in enumerate((odd, even, odd, even)):
        found += receiver.hear(bytes.fromhex(raw), 4.0 * number)
    (report,) = found
    assert (report.key, report.source) == ("40621D", TrafficSource.ADSB)
    assert report.lat_deg == pytest.approx(52.2572, abs=1e-4)
    assert report.lon_deg == pytest.approx(3.91937, abs=1e-4)
    assert report.altitude_m == pytest.approx(38_000 * 0.3048)
    assert report.altitude_reference is AltitudeReference.BAROMETRIC


def test_a_recorded_velocity_and_identification() -> None:
    receiver = Receiver()
    sent = aircraft(icao=0x485020)
    receiver.fly(sent)
    velocity = mode_s.squitter(0x485020, int.from_bytes(bytes.fromhex("8D485020994409940838175B284F")[4:11]))
    receiver.hear(velocity, 2.0)
    receiver.hear(mode_s.squitter(0x485020, 0x202CC371C32CE0), 2.0)
    (report,) = receiver.hear(mode_s.squitter(0x485020, mode_s.position(sent, is_odd=False)), 2.0)
    assert report.ground_speed_mps == pytest.approx(159.20 * 1852 / 3600, abs=0.01)
    assert report.course_rad == pytest.approx(math.radians(182.88), abs=1e-4)
    assert report.climb_mps == pytest.approx(-832 * 0.00508)
    assert report.geometric_altitude_m == pytest.approx((3600 + 550) * 0.3048)
    assert report.callsign == "KLM1023"


def test_an_airspeed_is_no_velocity_over_ground() -> None:
    receiver = Receiver()
    sent = aircraft(icao=0xA05F21)
    receiver.fly(sent)
    receiver.hear(bytes.fromhex("8DA05F219B06B6AF189400CBC33F"), 2.0)
    (report,) = receiver.hear(mode_s.squitter(0xA05F21, mode_s.position(sent, is_odd=False)), 2.0)
    assert (report.ground_speed_mps, report.course_rad) == (None, None)
    assert report.climb_mps == pytest.approx(-2304 * 0.00508)


def test_a_report_has_all_that_was_said() -> None:
    receiver = Receiver()
    sent = aircraft(category=14, nic=9, nacp=10, nacv=3, sil=2)
    for content in (mode_s.identification(sent), mode_s.operational_status(sent)):
        assert receiver.hear(mode_s.squitter(ADDRESS, content), 0.0) == []
    receiver.hear(mode_s.squitter(ADDRESS, 28 << 51 | 1 << 48 | 0x0808 << 32), 0.0)
    (report,) = receiver.fly(sent)
    assert distance_m(report, PLACE) < 5.1
    assert report.altitude_m == pytest.approx(1100.0, abs=4.0)
    assert report.geometric_altitude_m == pytest.approx(1234.5, abs=8.0)
    assert report.ground_speed_mps == pytest.approx(50.0, abs=0.4)
    assert report.course_rad == pytest.approx(math.atan2(-40.0, 30.0) % math.tau, abs=0.01)
    assert report.climb_mps == pytest.approx(2.0, abs=0.17)
    assert (report.callsign, report.squawk, report.kind) == ("KLM1023", 1200, TrafficKind.UAV)
    assert (report.containment_m, report.sil) == (75.0, 2)
    assert report.position_sigma_m == pytest.approx(10.0 / 2.448)
    assert report.velocity_sigma_mps == pytest.approx(1.0 / 2.448)
    assert (report.altitude_sigma_m, report.airborne, report.icao) == (None, True, ADDRESS)
    assert receiver.counters.messages == 11


def test_what_was_said_a_while_ago_is_not_joined() -> None:
    receiver = Receiver()
    sent = aircraft()
    receiver.hear(mode_s.squitter(ADDRESS, mode_s.operational_status(sent)), 0.0)
    receiver.fly(sent)
    (late,) = receiver.hear(mode_s.squitter(ADDRESS, mode_s.position(sent, is_odd=False)), 5.0)
    assert (late.ground_speed_mps, late.course_rad, late.climb_mps) == (None, None, None)
    assert late.geometric_altitude_m is not None
    (later,) = receiver.hear(mode_s.squitter(ADDRESS, mode_s.position(sent, is_odd=True)), 21.0)
    (latest,) = receiver.hear(mode_s.squitter(ADDRESS, mode_s.position(sent, is_odd=False)), 40.0)
    assert later.sil == 3
    assert (latest.geometric_altitude_m, latest.sil, latest.velocity_sigma_mps) == (None, None, None)


def test_a_geometric_position() -> None:
    """Type codes 20 to 22 have the altitude code of transponders."""
    receiver, found = Receiver(), []
    for step in range(4):
        content = mode_s.position(aircraft(), is_odd=step % 2 == 1) & (1 << 51) - 1
        found += receiver.hear(mode_s.squitter(ADDRESS, 21 << 51 | content), 0.5 * step)
    (report,) = found
    assert report.altitude_reference is AltitudeReference.GEOMETRIC
    assert report.altitude_m == pytest.approx(3600 * 0.3048)
    assert (report.geometric_altitude_m, report.containment_m) == (None, 25.0)


def test_positions_on_the_ground_are_found_near_other_aircraft() -> None:
    receiver = Receiver()
    parked = aircraft(icao=0x123456, on_ground=True, velocity_mps=(5.0, 0.0, 0.0), nic=9)
    assert receiver.fly(parked) == []
    receiver.fly(aircraft(place=moved(PLACE, 50_000.0, 80_000.0)))
    report = receiver.fly(parked, 12.0, 10.0)[-1]
    assert distance_m(report, PLACE) < 1.5
    assert (report.airborne, report.altitude_m) == (False, None)
    assert report.ground_speed_mps == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(
    ("control", "imf", "source", "key"),
    [
        (0, False, TrafficSource.ADSB, "4840D6"),
        (1, False, TrafficSource.ADSB, "~4840D6"),
        (2, False, TrafficSource.TISB, "4840D6"),
        (2, True, TrafficSource.TISB, "~4840D6"),
        (5, False, TrafficSource.TISB, "~4840D6"),
        (6, False, TrafficSource.ADSR, "4840D6"),
        (6, True, TrafficSource.ADSR, "~4840D6"),
    ],
)
def test_the_control_field_tells_the_services_apart(
    control: int, imf: bool, source: TrafficSource, key: str
) -> None:
    (report,) = Receiver().fly(aircraft(), control=control, imf=imf)
    assert (report.source, report.key) == (source, key)
    assert report.icao == (None if key.startswith("~") else ADDRESS)
    assert distance_m(report, PLACE) < 5.1
    assert report.ground_speed_mps == pytest.approx(50.0, abs=0.4)


@pytest.mark.parametrize("control", [4, 7])
def test_messages_about_the_service_are_no_traffic(control: int) -> None:
    receiver = Receiver()
    assert receiver.fly(aircraft(), control=control) == []
    assert receiver.counters.messages == 8


def test_tisb_states_no_accuracy_where_adsb_does() -> None:
    (report,) = Receiver().fly(aircraft(), control=2)
    assert (report.velocity_sigma_mps, report.geometric_altitude_m, report.containment_m) == (
        None,
        None,
        None,
    )


def test_the_services_are_not_mixed() -> None:
    """TIS-B repeats a radar's position of the same aircraft, seconds old: no pair with its own."""
    receiver = Receiver()
    radar = aircraft(place=moved(PLACE, -700.0, 300.0), velocity_mps=(10.0, 0.0, 0.0))
    found = []
    for second in range(5):
        found += receiver.fly(aircraft(), second + 1.0, second)
        found += receiver.fly(radar, second + 1.2, second + 0.2, control=2)
    for report in found:
        place = PLACE if report.source is TrafficSource.ADSB else radar.place
        assert distance_m(report, place) < 5.1
    assert {report.source for report in found} == {TrafficSource.ADSB, TrafficSource.TISB}


def test_a_coarse_position_of_tisb() -> None:
    receiver, found = Receiver(), []
    for step in range(4):
        fine = mode_s.position(aircraft(), is_odd=step % 2 == 1)
        content = (
            (fine >> 36 & 0xFFF) << 37
            | 1 << 36
            | 8 << 31  # 90 degrees
            | 5 << 25  # 112 to 144 kt
            | (fine >> 34 & 1) << 24
            | (fine >> 22 & 0xFFF) << 12
            | fine >> 5 & 0xFFF
        )
        found += receiver.hear(mode_s.other_squitter(ADDRESS, content, 3), 0.5 * step)
    (report,) = found
    assert (report.source, report.key) == (TrafficSource.TISB, "4840D6")
    assert distance_m(report, PLACE) < 120.0
    assert report.altitude_m == pytest.approx(3600 * 0.3048)
    assert report.ground_speed_mps == pytest.approx(128 * 1852 / 3600)
    assert report.course_rad == pytest.approx(math.pi / 2)


def test_positions_by_multilateration_say_so() -> None:
    (report,) = Receiver().fly(aircraft(), control=2, is_mlat=True)
    assert (report.source, report.key, report.icao) == (TrafficSource.MLAT, "4840D6", ADDRESS)


def test_aircraft_without_an_address() -> None:
    (report,) = Receiver().fly(aircraft(icao=0))
    assert (report.key, report.icao) == ("", None)


def test_an_altitude_reply_counts_if_its_address_is_known() -> None:
    receiver = Receiver()
    reply = mode_s.altitude_reply(ADDRESS, 11_450.0)
    assert receiver.hear(reply, 0.0) == []
    receiver.hear(mode_s.all_call(ADDRESS), 1.0)
    (report,) = receiver.hear(reply, 2.0)
    assert (report.source, report.key, report.icao) == (TrafficSource.MODE_S, "4840D6", ADDRESS)
    assert (report.lat_deg, report.altitude_m, report.time_s) == (None, pytest.approx(3489.96), 2.0)
    assert receiver.hear(reply, 2.9) == []
    (grounded,) = receiver.hear(mode_s.altitude_reply(ADDRESS, 0.0, status=1), 3.0)
    assert not grounded.airborne
    assert receiver.hear(reply, 200.0) == []


def test_an_altitude_beside_positions_is_not_reported() -> None:
    receiver = Receiver()
    receiver.fly(aircraft())
    assert receiver.hear(mode_s.altitude_reply(ADDRESS, 11_450.0), 3.0) == []
    assert len(receiver.hear(mode_s.altitude_reply(ADDRESS, 11_450.0), 12.0)) == 1


def test_an_all_call_for_another_interrogator_confirms_no_address() -> None:
    receiver = Receiver()
    call = mode_s.with_parity(mode_s.all_call(ADDRESS)[:4], overlay=5)
    receiver.hear(call, 0.0)
    assert receiver.hear(mode_s.altitude_reply(ADDRESS, 11_450.0), 1.0) == []
    assert (receiver.counters.messages, receiver.counters.bad) == (2, {})


def test_an_aircraft_that_lost_its_position_has_an_altitude() -> None:
    receiver = Receiver()
    (report,) = receiver.hear(mode_s.squitter(ADDRESS, mode_s.altitude_code(3600.0) << 36), 0.0)
    assert (report.source, report.altitude_m) == (TrafficSource.MODE_S, pytest.approx(1097.28))


def test_identity_replies_are_remembered() -> None:
    receiver = Receiver()
    receiver.hear(mode_s.all_call(ADDRESS), 0.0)
    receiver.hear(mode_s.with_parity((5 << 27 | 0x0808).to_bytes(4), ADDRESS), 0.0)
    (report,) = receiver.hear(mode_s.altitude_reply(ADDRESS, 3600.0), 0.0)
    assert report.squawk == 1200


def damaged(raw: bytes) -> list[bytes]:
    whole = int.from_bytes(raw)
    return [(whole ^ 1 << bit).to_bytes(len(raw)) for bit in range(8 * len(raw))]


def test_a_message_with_one_wrong_bit_is_never_believed() -> None:
    receiver = Receiver()
    receiver.fly(aircraft(), 4.0)
    receiver.hear(mode_s.squitter(ADDRESS, mode_s.identification(aircraft())), 4.0)
    aircraft_heard = receiver.decoder._aircraft
    (sender,) = aircraft_heard._established
    state = repr(aircraft_heard.known(sender, 4.0))
    sent = aircraft(place=moved(PLACE, 200.0, 0.0), velocity_mps=(99.0, 99.0, 9.0))
    contents = [mode_s.position(sent, is_odd=False), mode_s.velocity(sent), mode_s.identification(sent)]
    for content in [*contents, mode_s.operational_status(sent)]:
        for raw in damaged(mode_s.squitter(ADDRESS, content)):
            assert receiver.hear(raw, 4.5) == []
    assert len(receiver.decoder._aircraft) == 1
    assert (
        repr(receiver.decoder._aircraft.known(next(iter(receiver.decoder._aircraft._established)), 4.0))
        == state
    )


def test_a_reply_with_one_wrong_bit_is_never_believed() -> None:
    for raw in damaged(mode_s.altitude_reply(ADDRESS, 11_450.0)):
        receiver = Receiver()
        receiver.hear(mode_s.all_call(ADDRESS), 0.0)
        assert receiver.hear(raw, 1.0) == []
    for raw in damaged(mode_s.all_call(ADDRESS)):
        receiver = Receiver()
        receiver.hear(raw, 0.0)
        assert len(receiver.decoder._aircraft) == 0


def test_a_message_of_another_length_is_refused() -> None:
    receiver = Receiver()
    assert receiver.hear(mode_s.squitter(ADDRESS, 0)[:7], 0.0) == []
    assert receiver.hear(mode_s.all_call(ADDRESS) * 2, 0.0) == []
    assert receiver.counters.bad == {"length of another format": 2}


def test_one_bad_pair_places_no_aircraft_on_another_continent() -> None:
    """Between good positions comes one whose parity is right, of another aircraft with the same address."""
    receiver = Receiver()
    receiver.fly(aircraft())
    far = aircraft(place=moved(PLACE, 0.0, 0.0)._replace(lat_deg=-33.9, lon_deg=151.2))
    found = receiver.hear(mode_s.squitter(ADDRESS, mode_s.position(far, is_odd=True)), 2.1)
    found += receiver.fly(aircraft(), 6.0, 2.5)
    assert len(found) >= 7
    assert max(distance_m(report, PLACE) for report in found) < 5.1


def test_two_aircraft_with_one_address_have_no_joint_velocity() -> None:
    receiver = Receiver()
    other = aircraft(place=moved(PLACE, 9_000.0, 0.0), velocity_mps=(-60.0, 0.0, 0.0))
    for second in range(5):
        receiver.fly(aircraft(), second + 1.0, second)
        receiver.fly(other, second + 1.2, second + 0.2)
    found = receiver.fly(aircraft(), 13.0, 10.0) + receiver.fly(other, 15.0, 13.0)
    assert {report.ground_speed_mps for report in found} == {None}
    assert any(distance_m(report, other.place) < 5.1 for report in found)
    assert any(distance_m(report, PLACE) < 5.1 for report in found)


def test_invented_aircraft_take_no_memory() -> None:
    receiver = Receiver()
    content = mode_s.position(aircraft(), is_odd=False)
    for address in range(1, 5_000):
        receiver.hear(mode_s.squitter(address * 3_000, content), 0.0)
    assert len(receiver.decoder._aircraft) <= 4_096
