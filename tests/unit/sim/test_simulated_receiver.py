"""What a simulated receiver sends, and when: heartbeats, gathered reports, ages and altitudes."""

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import ReceiverOwnship, Traffic
from companion.model import TrafficReport, TrafficSource
from companion.sources.decoder import Heard
from companion.sources.registry import new_decoder
from sim.receiver import Carrier, Datums, SimulatedReceiver, limited
from sim.receivers import FORMATS
from sim.traffic import Intruder, ReceiverModel, TrafficReceiver

HOME = GeoPoint(47.0, 8.0, 500.0)
FRAME = LocalFrame(HOME.lat_deg, HOME.lon_deg)
START_S = 1_700_000_000.0
# 2 km north of home at 500 m, flying north at 50 m/s.
AHEAD = Intruder(0xA00001, "AHEAD", START_S, (2000.0, 0.0, -500.0), (50.0, 0.0, 0.0))
CARRIER = Carrier(HOME, (20.0, 0.0, 0.0))
DECODED = ("gdl90", "sbs", "beast", "flarm", "readsb")


def receiver(name: str, datums: Datums | None = None, **model: float) -> SimulatedReceiver:
    errors = limited(ReceiverModel(**model), name)  # type: ignore[arg-type]
    return SimulatedReceiver(name, TrafficReceiver([AHEAD], FRAME, START_S, model=errors), datums)


def heard_from(simulated: SimulatedReceiver, seconds: float, period_s: float = 0.1) -> list[Heard]:
    """What Companion's decoder of the format makes of all that is sent."""
    decoder, heard = new_decoder(simulated.name), []
    for step in range(round(seconds / period_s)):
        now_s = START_S + step * period_s
        for piece in simulated.pieces(now_s, CARRIER):
            heard += decoder.feed(piece, now_s)
    assert not decoder.counters.bad
    return heard


def traffic(heard: list[Heard]) -> list[TrafficReport]:
    """The reports of others that have a position."""
    reports = [fact.report for fact in heard if isinstance(fact, Traffic)]
    return [report for report in reports if report.source is not TrafficSource.MODE_S]


def own_reports(heard: list[Heard]) -> list[TrafficReport]:
    """What the receiver reports of the aircraft that carries it."""
    return [fact.report for fact in heard if isinstance(fact, ReceiverOwnship)]


def north_m(report: TrafficReport) -> float:
    """How far north of home the report says that the aircraft is; relative positions are so by themselves."""
    if report.relative_m is not None:
        return report.relative_m[0]
    assert report.lat_deg is not None
    assert report.lon_deg is not None
    return FRAME.to_north_east_m(report.lat_deg, report.lon_deg)[0]


@pytest.mark.parametrize("name", DECODED)
def test_every_format_says_where_the_aircraft_is_once_a_second(name: str) -> None:
    reports = traffic(heard_from(receiver(name), 10.0))
    # A position of Mode S takes two messages, and is confirmed by the next.
    assert len(reports) == pytest.approx(10, abs=3)
    for report in reports:
        assert north_m(report) == pytest.approx(2000.0 + 50.0 * (report.time_s - START_S), abs=6.0)
        assert report.ground_speed_mps == pytest.approx(50.0, abs=0.6)


@pytest.mark.parametrize("name", DECODED)
def test_nothing_is_heard_when_all_is_lost_or_too_far_away(name: str) -> None:
    assert not traffic(heard_from(receiver(name, loss=1.0), 5.0))
    assert not traffic(heard_from(receiver(name, range_m=1500.0), 5.0))


def test_a_receiver_is_never_better_than_the_radio_of_its_format() -> None:
    assert limited(ReceiverModel(), "flarm").range_m == 5_000.0
    assert limited(ReceiverModel(range_m=800.0), "remoteid").range_m == 800.0
    assert limited(ReceiverModel(), "sbs") == ReceiverModel()


@pytest.mark.parametrize(
    ("name", "behind_m"), [("gdl90", 40.0), ("sbs", 0.0), ("readsb", 0.0), ("flarm", 0.0)]
)
def test_a_delay_is_stated_or_predicted_where_the_format_can(name: str, behind_m: float) -> None:
    """A report of GDL 90 has no age: what is 0.8 s late is 40 m behind at 50 m/s."""
    *_, last = traffic(heard_from(receiver(name, delay_s=0.8), 5.0))
    assert 2000.0 + 50.0 * (last.time_s - START_S) - north_m(last) == pytest.approx(behind_m, abs=6.0)


def test_altitudes_differ_by_their_datums() -> None:
    datums = Datums(pressure_m=-60.0, ellipsoid_m=40.0)
    *_, last = traffic(heard_from(receiver("readsb", datums), 2.0))
    assert last.altitude_m == pytest.approx(440.0, abs=4.0)
    assert last.geometric_altitude_m == pytest.approx(540.0, abs=4.0)
    own = [
        fact.report
        for fact in heard_from(receiver("gdl90", datums), 2.0)
        if isinstance(fact, ReceiverOwnship)
    ]
    assert own[-1].altitude_m == pytest.approx(440.0, abs=4.0)
    assert own[-1].geometric_altitude_m == pytest.approx(540.0, abs=4.0)


def test_a_wrong_altimeter_of_the_traffic_is_not_ours() -> None:
    simulated = receiver("gdl90", altitude_offset_m=100.0)
    heard = heard_from(simulated, 2.0)
    assert traffic(heard)[-1].altitude_m == pytest.approx(600.0, abs=4.0)
    assert own_reports(heard)[-1].altitude_m == pytest.approx(500.0, abs=4.0)


@pytest.mark.parametrize(("sigma_m", "nacp"), [(0.0, 9), (12.0, 9), (15.0, 8), (50.0, 7), (5_000.0, 0)])
def test_the_stated_accuracy_is_that_of_the_errors(sigma_m: float, nacp: int) -> None:
    simulated = receiver("readsb", horizontal_sigma_m=sigma_m)
    documents = [simulated.pieces(START_S + second, CARRIER) for second in range(2)]
    assert f'"nac_p": {nacp},'.encode() in documents[-1][0]


@pytest.mark.parametrize("name", FORMATS)
def test_what_was_heard_before_the_receiver_was_switched_on_is_not_sent(name: str) -> None:
    """Of a minute, at most the reports of one second."""
    late, fresh = receiver(name), receiver(name)
    late.skip_to(START_S + 60.0, CARRIER)
    sent = late.pieces(START_S + 60.05, CARRIER)
    assert len(b"".join(sent)) <= len(b"".join(fresh.pieces(START_S, CARRIER))) + 64


def test_the_heartbeat_of_a_receiver_that_hears_nothing_goes_on() -> None:
    simulated = SimulatedReceiver("gdl90", TrafficReceiver([], FRAME, START_S))
    decoder = new_decoder("gdl90")
    for step in range(30):
        for piece in simulated.pieces(START_S + step / 10.0, CARRIER):
            decoder.feed(piece, START_S + step / 10.0)
    assert decoder.counters.messages == 3 * 4  # heartbeat, device, own position, own geometric altitude
    assert decoder.status is None


def test_the_registry_names_each_format_by_its_encoder() -> None:
    assert set(FORMATS) == {"gdl90", "sbs", "beast", "flarm", "readsb", "mavlink", "remoteid"}
    assert all(each.encoder.format == name for name, each in FORMATS.items())
