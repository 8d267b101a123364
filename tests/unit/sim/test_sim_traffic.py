"""Scripted intruders and the receiver that reports them."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Message
from sim.receivers.mavlink import ADSB_RECEIVER, ALL_VALID
from sim.traffic import AdsbReceiver, Intruder, Maneuver, ReceiverModel

START_S = 1_800_000_000.0
FRAME = LocalFrame(-35.0, 149.0)
STRAIGHT = Intruder(0xA00001, "STRAIGHT", START_S, (1000.0, 200.0, -500.0), (-60.0, 10.0, -2.0))


def place_of(report: Message) -> tuple[float, float, float]:
    return FRAME.to_ned_m(GeoPoint(report.lat / 1e7, report.lon / 1e7, report.altitude / 1000.0))


def collect(receiver: AdsbReceiver, seconds: float, period_s: float = 0.05) -> list[tuple[float, Message]]:
    return [
        (k * period_s, report)
        for k in range(round(seconds / period_s) + 1)
        for report in receiver.reports(START_S + k * period_s)
    ]


@settings(derandomize=True, deadline=None)
@given(st.floats(-300.0, 300.0))
def test_without_maneuvers_it_flies_straight_before_and_after(seconds: float) -> None:
    position_m, velocity_mps = STRAIGHT.state_at(START_S + seconds)
    assert position_m == pytest.approx(
        (1000.0 - 60.0 * seconds, 200.0 + 10.0 * seconds, -500.0 - 2.0 * seconds), abs=1e-3
    )
    assert velocity_mps == (-60.0, 10.0, -2.0)


@settings(derandomize=True, deadline=None)
@given(at=st.floats(1.0, 59.0), rate=st.floats(-0.2, 0.2), climb_mps=st.floats(-10.0, 10.0))
def test_the_path_fits_the_velocity_through_maneuvers(at: float, rate: float, climb_mps: float) -> None:
    intruder = Intruder(
        1,
        "TURN",
        START_S,
        (0.0, 0.0, -300.0),
        (50.0, 0.0, 0.0),
        maneuvers=(Maneuver(START_S + 10.0, 0.05), Maneuver(START_S + 30.0, rate, climb_mps)),
    )
    step_s = 1e-3
    before_m, _ = intruder.state_at(START_S + at - step_s)
    after_m, _ = intruder.state_at(START_S + at + step_s)
    _, velocity_mps = intruder.state_at(START_S + at)
    measured = [(b - a) / (2.0 * step_s) for a, b in zip(before_m, after_m, strict=True)]
    # Within a step of the moment at which a climb begins, the mean lies between the two rates.
    if min(abs(at - 10.0), abs(at - 30.0)) > 2.0 * step_s:
        assert measured == pytest.approx(velocity_mps, abs=0.02)
    assert math.hypot(velocity_mps[0], velocity_mps[1]) == pytest.approx(50.0)


def test_a_turn_is_to_the_right_and_comes_round() -> None:
    rate_rps = math.radians(3.0)
    intruder = Intruder(
        1, "TURN", START_S, (0.0, 0.0, 0.0), (50.0, 0.0, 0.0), maneuvers=(Maneuver(START_S, rate_rps),)
    )
    position_m, velocity_mps = intruder.state_at(START_S + 30.0)
    assert velocity_mps[1] == pytest.approx(50.0)
    assert position_m[:2] == pytest.approx((50.0 / rate_rps, 50.0 / rate_rps))
    assert intruder.state_at(START_S + 120.0)[0] == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_reports_carry_the_wire_units() -> None:
    (_, report), *_ = collect(AdsbReceiver([STRAIGHT], FRAME, START_S), 0.0)
    assert report.ICAO_address == 0xA00001
    assert report.callsign == "STRAIGHT"
    assert (report.get_srcSystem(), report.get_srcComponent()) == ADSB_RECEIVER
    assert place_of(report) == pytest.approx((1000.0, 200.0, -500.0), abs=0.02)
    assert report.altitude_type == 1
    assert report.heading == round((360.0 - math.degrees(math.atan2(10.0, 60.0)) - 180.0) * 100.0)
    assert report.hor_velocity == round(math.hypot(60.0, 10.0) * 100.0)
    assert report.ver_velocity == 200  # up is positive
    assert report.flags == ALL_VALID
    assert report.tslc == 0


def test_one_report_a_second_at_any_polling_rate() -> None:
    often = collect(AdsbReceiver([STRAIGHT], FRAME, START_S), 20.0)
    seldom = collect(AdsbReceiver([STRAIGHT], FRAME, START_S), 20.0, period_s=2.5)
    assert [t for t, _ in often] == pytest.approx([float(k) for k in range(21)])
    assert [r.lat for _, r in often] == [r.lat for _, r in seldom]


def test_an_intruder_is_received_only_while_it_transmits() -> None:
    intruder = Intruder(
        1, "SHORT", START_S, (0.0, 0.0, 0.0), (50.0, 0.0, 0.0), (), START_S + 5.0, START_S + 8.5
    )
    times = [t for t, _ in collect(AdsbReceiver([intruder], FRAME, START_S), 20.0)]
    assert times == pytest.approx([5.0, 6.0, 7.0, 8.0])


def test_an_intruder_out_of_range_is_not_received() -> None:
    receiver = AdsbReceiver([STRAIGHT], FRAME, START_S, model=ReceiverModel(range_m=900.0))
    assert receiver.reports(START_S, (0.0, 0.0, 0.0)) == []
    assert len(receiver.reports(START_S + 5.0, (0.0, 0.0, 0.0))) == 3  # those of 3, 4 and 5 s


def test_delay_brings_old_positions() -> None:
    receiver = AdsbReceiver([STRAIGHT], FRAME, START_S, model=ReceiverModel(delay_s=1.5))
    assert receiver.reports(START_S + 1.4) == []
    (report,) = receiver.reports(START_S + 1.5)
    assert place_of(report)[0] == pytest.approx(1000.0, abs=0.02)
    assert report.tslc == 1


def test_loss_noise_and_seed() -> None:
    model = ReceiverModel(
        horizontal_sigma_m=15.0, vertical_sigma_m=8.0, speed_sigma_mps=1.5, climb_sigma_mps=0.8, loss=0.3
    )

    def heard(seed: int) -> list[tuple[float, Message]]:
        return collect(AdsbReceiver([STRAIGHT], FRAME, START_S, model=model, seed=seed), 1000.0, 1.0)

    first = heard(1)
    assert [str(r) for _, r in first] == [str(r) for _, r in heard(1)]
    assert [str(r) for _, r in first] != [str(r) for _, r in heard(2)]
    assert len(first) / 1001 == pytest.approx(0.7, abs=0.05)
    errors_m = [
        a - b
        for t, report in first
        for a, b in zip(place_of(report)[:2], STRAIGHT.state_at(START_S + t)[0][:2], strict=True)
    ]
    assert math.sqrt(sum(e * e for e in errors_m) / len(errors_m)) == pytest.approx(15.0, rel=0.1)
    assert sum(errors_m) / len(errors_m) == pytest.approx(0.0, abs=2.0)


def test_another_aircraft_does_not_change_the_reports_of_the_first() -> None:
    model = ReceiverModel(horizontal_sigma_m=15.0, loss=0.3)
    other = Intruder(0xB00001, "OTHER", START_S, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    alone = collect(AdsbReceiver([STRAIGHT], FRAME, START_S, model=model), 60.0)
    both = collect(AdsbReceiver([STRAIGHT, other], FRAME, START_S, model=model), 60.0)
    assert [str(r) for _, r in both if r.ICAO_address == STRAIGHT.icao] == [str(r) for _, r in alone]


def test_pressure_altitude_is_marked_and_offset() -> None:
    model = ReceiverModel(barometric=True, altitude_offset_m=120.0)
    (report,) = AdsbReceiver([STRAIGHT], FRAME, START_S, model=model).reports(START_S)
    assert report.altitude_type == 0
    assert report.altitude == 620_000
