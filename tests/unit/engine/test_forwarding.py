"""Traffic of receivers that is sent on: what, where to, how often, and what of it comes back."""

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import pytest

from companion.engine import Effect, Engine, EngineConfig, EngineParams, Transmit
from companion.gcs.made_up_addresses import MadeUpAddresses, is_made_up
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    RECEIVER,
    AirData,
    Fact,
    GeoidSeparation,
    Heartbeat,
    LandedState,
    OwnPosition,
    Parameter,
    PressureAltitude,
    Sender,
    Traffic,
)
from companion.mavlink.translate import to_fact
from companion.model import AltitudeReference, Track, TrafficKind, TrafficReport, TrafficSource, adsb_key
from companion.traffic import TrafficParams

AUTOPILOT, OTHER, BESIDE = Sender(1, 1), Sender(1, 156), Sender(9, 156)
T0 = 1_700_000_000.0
FRAME = LocalFrame(-35.0, 149.0)
BAROMETRIC = AltitudeReference.BAROMETRIC
OWN_M = 884.0


class Flight:
    """Ourselves flying north at 22 m/s, 884 m above the sea, and what is sent on."""

    def __init__(self, forward: str = "autopilot") -> None:
        traffic = TrafficParams(forward=forward)  # type: ignore[arg-type]
        self.engine = Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1), traffic=traffic))
        self.now_s = T0
        self.sent: list[tuple[float, Transmit]] = []
        self.reports: Callable[[float], Sequence[Fact]] = lambda _now_s: ()
        self.echo: Callable[[Message], Message | None] = lambda _message: None
        self.echo_from = AUTOPILOT
        self.modes: list[Message] = []

    def fly(self, seconds: float) -> "Flight":
        for _ in range(round(seconds * 10)):
            self.now_s = round(self.now_s + 0.1, 3)
            since_s = self.now_s - T0
            lat_deg = -35.0 + since_s * 22.0 / 110_940.0
            facts: list[Fact] = [
                OwnPosition(AUTOPILOT, since_s, lat_deg, 149.0, OWN_M, 300.0, (22.0, 0.0, 0.0), 0.0),
                AirData(AUTOPILOT, 22.0),
            ]
            if round(since_s * 10) % 10 == 1:
                facts += [Heartbeat(AUTOPILOT, 1, 3, True, 10, 4), LandedState(AUTOPILOT, 2)]
                facts += self.reports(self.now_s)
            for fact in facts:
                self.engine.receive(fact, self.now_s)
            self._take(self.engine.tick(self.now_s))
        return self

    def _take(self, effects: Sequence[Effect]) -> None:
        for effect in effects:
            if not isinstance(effect, Transmit):
                continue
            if getattr(effect.message, "command", None) == mavlink.MAV_CMD_DO_SET_MODE:
                self.modes.append(effect.message)
            if effect.sender.component_id != mavlink.MAV_COMP_ID_ADSB:
                assert effect.to == "all"
                continue
            self.sent.append((self.now_s, effect))
            back = self.echo(effect.message)
            if back is not None:
                back.get_header().srcSystem, back.get_header().srcComponent = self.echo_from
                fact = to_fact(back, self.now_s)
                assert fact is not None
                self.engine.receive(fact, self.now_s)

    def messages(self, kind: str = "ADSB_VEHICLE") -> list[Message]:
        return [effect.message for _, effect in self.sent if effect.message.get_type() == kind]

    def keys(self) -> set[str]:
        return {track.track_id for track in self.engine.snapshot(self.now_s).tracks}


def report(
    now_s: float,
    key: str = "A00001",
    *,
    north_m: float = 20_000.0,
    east_m: float = 3_000.0,
    speed_mps: float = 60.0,
    age_s: float = 0.0,
    altitude_m: float = 1_200.0,
    source: TrafficSource = TrafficSource.ADSB,
    **values: object,
) -> TrafficReport:
    """An aircraft coming from the north, beside our course."""
    flown_m = speed_mps * (now_s - age_s - T0)
    place = FRAME.to_geo(north_m - flown_m, east_m, 0.0)
    icao = int(key, 16) if source is TrafficSource.ADSB else None
    made = TrafficReport(
        source, key, now_s - age_s, place.lat_deg, place.lon_deg, altitude_m,
        AltitudeReference.SEA_LEVEL, math.pi, speed_mps, 0.0, "TEST1", icao=icao, heard_by="gdl90:x",
    )  # fmt: skip
    return replace(made, **values)  # type: ignore[arg-type]


def heard(
    *made: Callable[[float], TrafficReport], sender: Sender = RECEIVER
) -> Callable[[float], list[Fact]]:
    return lambda now_s: [Traffic(sender, one(now_s)) for one in made]


def test_traffic_of_a_receiver_is_sent_as_an_adsb_receiver_of_our_system() -> None:
    flight = Flight()
    flight.reports = heard(lambda now_s: report(now_s, squawk=1234, kind=TrafficKind.UAV, simulated=True))
    flight.fly(12.0)
    assert {(effect.sender, effect.to) for _, effect in flight.sent} == {(Sender(1, 156), "autopilot")}
    beats = flight.messages("HEARTBEAT")
    assert 10 <= len(beats) <= 12
    assert {(beat.type, beat.autopilot) for beat in beats} == {(mavlink.MAV_TYPE_ADSB, 8)}
    newest = flight.messages()[-1]
    assert newest.ICAO_address == 0xA00001
    assert (newest.callsign, newest.squawk, newest.emitter_type) == ("TEST1", 1234, 14)
    assert (newest.heading, newest.hor_velocity, newest.ver_velocity, newest.tslc) == (18_000, 6000, 0, 0)
    assert newest.altitude / 1000 == pytest.approx(1200.0, abs=0.5)
    assert newest.flags == 1 | 2 | 4 | 8 | 16 | 32 | 64 | 128
    sent_s = next(at_s for at_s, effect in flight.sent if effect.message is newest)
    north_m, east_m = FRAME.to_north_east_m(newest.lat / 1e7, newest.lon / 1e7)
    assert north_m == pytest.approx(20_000.0 - 60.0 * (sent_s - T0), abs=5.0)
    assert east_m == pytest.approx(3_000.0, abs=2.0)


@pytest.mark.parametrize("forward", ["off", "autopilot"])
def test_off_or_without_any_receiver_nothing_is_sent(forward: str) -> None:
    flight = Flight(forward)
    flight.reports = heard(report, sender=RECEIVER if forward == "off" else OTHER)
    assert flight.fly(6.0).sent == []


def test_a_silent_but_working_receiver_has_heartbeats_only() -> None:
    flight = Flight("station")
    flight.engine.forwarding.note_sources(receiver_works=True, elsewhere=frozenset())
    flight.fly(5.0)
    assert 4 <= len(flight.messages("HEARTBEAT")) <= 6
    assert flight.messages() == []
    assert {effect.to for _, effect in flight.sent} == {"station"}


def test_the_nearest_in_time_are_sent_once_a_second_and_five_a_second_in_all() -> None:
    near = [
        lambda now_s, n=n: report(now_s, f"A0000{n}", north_m=4e3 + 300 * n, east_m=500.0) for n in range(3)
    ]
    far = [
        lambda now_s, n=n: report(now_s, f"C0{n:04X}", north_m=30_000.0 + 500 * n, speed_mps=30.0)
        for n in range(40)
    ]
    flight = Flight()
    flight.reports = heard(*near, *far)
    flight.fly(11.0)
    flight.sent.clear()
    flight.fly(10.0)
    counted = Counter(message.ICAO_address for message in flight.messages())
    assert len(flight.messages()) <= 51
    assert all(counted[0xA00000 + n] in (9, 10, 11) for n in range(3))
    assert {icao for icao in counted if icao >= 0xC00000} <= {0xC00000 + n for n in range(22)}
    assert len(counted) >= 3 + 15
    assert max(counted[0xC00000 + n] for n in range(22)) == 1
    times = [at_s for at_s, effect in flight.sent if effect.message.get_type() == "ADSB_VEHICLE"]
    assert min(after - before for before, after in pairwise(times)) > 0.19
    by_icao = defaultdict(list)
    for at_s, effect in flight.sent:
        if effect.message.get_type() == "ADSB_VEHICLE":
            by_icao[effect.message.ICAO_address].append(at_s)
    for at in by_icao.values():
        assert all(after - before > 0.99 for before, after in pairwise(at))


def test_what_the_autopilot_reports_itself_is_not_sent_to_it() -> None:
    flight = Flight()
    flight.reports = lambda now_s: [
        Traffic(RECEIVER, report(now_s)),
        Traffic(AUTOPILOT, report(now_s, heard_by="")),
    ]
    assert flight.fly(8.0).messages() == []
    flight.reports = heard(report)
    flight.fly(8.0)
    assert flight.messages() == []
    assert flight.fly(5.0).messages()


@pytest.mark.parametrize("is_elsewhere", [True, False])
def test_traffic_of_a_mavlink_receiver_is_sent_if_it_is_not_heard_there(is_elsewhere: bool) -> None:
    flight = Flight()
    flight.reports = heard(report, sender=BESIDE)
    if is_elsewhere:
        forwarding = flight.engine.forwarding
        forwarding.note_sources(receiver_works=False, elsewhere=frozenset({(9, 156)}))
    assert bool(flight.fly(6.0).messages()) is is_elsewhere


def flarm(now_s: float) -> TrafficReport:
    return report(now_s, "FLARM-DD1234", source=TrafficSource.FLARM, callsign=None)


@pytest.mark.parametrize("echo_from", [AUTOPILOT, OTHER, Sender(255, 190), Sender(7, 1)], ids=str)
@pytest.mark.parametrize("made", [report, flarm], ids=["identified", "without address"])
def test_what_comes_back_is_not_another_aircraft_and_does_not_stop_the_sending(
    made: Callable[[float], TrafficReport], echo_from: Sender
) -> None:
    alone, flight = Flight(), Flight()
    for one in (alone, flight):
        one.reports = heard(made)
    flight.echo = lambda message: message if message.get_type() == "ADSB_VEHICLE" else None
    flight.echo_from = echo_from
    alone.fly(30.0)
    flight.fly(30.0)
    assert len(flight.messages()) == len(alone.messages()) >= 25
    assert flight.keys() == alone.keys() == {made(T0).key}
    assert flight.engine.snapshot(T0).tracks == alone.engine.snapshot(T0).tracks


def test_an_echo_that_px4_has_rounded_is_recognized() -> None:
    def rounded(message: Message) -> Message | None:
        if message.get_type() != "ADSB_VEHICLE":
            return None
        message.lat, message.lon, message.altitude = message.lat - 1, message.lon + 1, message.altitude + 30
        message.heading = max(message.heading - 1, 0)
        return message

    flight = Flight()
    flight.reports = heard(report)
    flight.echo = rounded
    assert len(flight.fly(20.0).messages()) >= 17


def test_tslc_is_the_age_and_the_place_is_of_then() -> None:
    flight = Flight()
    flight.reports = heard(lambda now_s: report(now_s, age_s=3.0))
    flight.fly(10.0)
    assert {message.tslc for message in flight.messages()} == {3}
    at_s, effect = next(
        pair for pair in reversed(flight.sent) if pair[1].message.get_type() == "ADSB_VEHICLE"
    )
    north_m, _ = FRAME.to_north_east_m(effect.message.lat / 1e7, 149.0)
    assert north_m == pytest.approx(20_000.0 - 60.0 * (at_s - 3.0 - T0), abs=5.0)


def test_an_aircraft_that_is_not_heard_any_more_is_not_sent() -> None:
    flight = Flight()
    flight.reports = heard(report)
    flight.fly(8.0)
    flight.reports = lambda _now_s: ()
    flight.sent.clear()
    flight.fly(30.0)
    assert len(flight.messages()) <= 1  # the last report, if that was not sent yet
    assert all(message.tslc <= 1 for message in flight.messages())
    assert 8 <= len(flight.messages("HEARTBEAT")) <= 12


def test_one_report_is_not_sent_and_rates_that_nobody_states_are_sent_once_known() -> None:
    flight = Flight()
    flight.reports = heard(
        lambda now_s: report(now_s, course_rad=None, ground_speed_mps=None, climb_mps=None)
    )
    flight.fly(0.9)
    assert flight.messages() == []
    flight.fly(9.0)
    first, newest = flight.messages()[0], flight.messages()[-1]
    assert first.flags == 1 | 2 | 16
    assert (first.heading, first.hor_velocity, first.ver_velocity) == (0, 0, 0)
    assert newest.flags == 1 | 2 | 4 | 8 | 16 | 128
    assert newest.hor_velocity == pytest.approx(6000, abs=300)


def test_an_aircraft_without_an_altitude_is_not_sent() -> None:
    flight = Flight()
    flight.reports = heard(lambda now_s: replace(report(now_s), altitude_m=None))
    assert flight.fly(8.0).messages() == []


@pytest.mark.parametrize(
    ("reference", "altitude_type", "altitude_m", "flag"),
    [
        (BAROMETRIC, mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH, 1280.0, 256),
        (AltitudeReference.GEOMETRIC, mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC, 1181.0, 0),
    ],
)
def test_the_altitude_is_above_the_sea_and_its_type_says_what_measured_it(
    reference: AltitudeReference, altitude_type: int, altitude_m: float, flag: int
) -> None:
    """Our pressure altitude is 80 m below our altitude, and the geoid 19 m above the ellipsoid."""
    flight = Flight()
    flight.reports = lambda now_s: [
        PressureAltitude(AUTOPILOT, OWN_M - 80.0),
        GeoidSeparation(AUTOPILOT, 19.0),
        Traffic(RECEIVER, report(now_s, altitude_reference=reference)),
    ]
    newest = flight.fly(8.0).messages()[-1]
    assert newest.altitude_type == altitude_type
    assert newest.flags & 256 == flag
    assert newest.altitude / 1000 == pytest.approx(altitude_m, abs=1.0)


def test_aircraft_without_an_address_get_stable_ones_that_no_state_has() -> None:
    addresses, again = MadeUpAddresses(), MadeUpAddresses()
    tracks = [Track(f"FLARM-{n:06X}", T0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) for n in range(900)]
    made = [addresses.of(track) for track in tracks]
    assert len(set(made)) == 900
    assert [addresses.of(track) for track in tracks] == made
    assert again.of(tracks[0]) == made[0]
    assert all(0xB00000 <= address <= 0xBFFFFF and is_made_up(address) for address in made)
    known = replace(tracks[0], track_id="A00001", icao=0xA00001)
    assert addresses.of(known) == 0xA00001
    assert is_made_up(addresses.of(replace(known, track_id="A00001/2")))
    assert len({addresses.of(replace(known, track_id=f"UTM-{n}", icao=0)) for n in range(900)}) == 900


def test_two_made_up_addresses_that_coincide_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    class Constant:
        def __init__(self, *_: object, **__: object) -> None:
            pass

        def digest(self) -> bytes:
            return b"\xff" * 4

    monkeypatch.setattr("companion.gcs.made_up_addresses.blake2s", Constant)
    addresses = MadeUpAddresses()
    made = [addresses.of(Track(key, T0, (0.0,) * 3, (0.0,) * 3)) for key in ("ANON-1", "ANON-2", "ANON-1")]  # type: ignore[arg-type]
    assert made == [0xBFFFFF, 0xB00000, 0xBFFFFF]


def test_we_ourselves_are_not_sent() -> None:
    flight = Flight()
    flight.engine.receive(Parameter(AUTOPILOT, "ADSB_ICAO_ID", float(0xBEEF)), T0)

    def ours(now_s: float) -> TrafficReport:
        lat_deg = -35.0 + (now_s - T0) * 22.0 / 110_940.0
        return TrafficReport(
            TrafficSource.ADSB, adsb_key(0xBEEF), now_s, lat_deg, 149.0, OWN_M,
            AltitudeReference.SEA_LEVEL, 0.0, 22.0, 0.0, icao=0xBEEF,
        )  # fmt: skip

    flight.reports = lambda now_s: [
        Parameter(AUTOPILOT, "ADSB_ICAO_ID", float(0xBEEF)), Traffic(RECEIVER, ours(now_s)),
    ]  # fmt: skip
    assert flight.fly(12.0).messages() == []


@pytest.mark.parametrize("acts", [True, False])
def test_an_autopilot_that_avoids_by_itself_gets_traffic_and_is_not_flown(acts: bool) -> None:
    flight = Flight()
    flight.reports = lambda now_s: [
        Parameter(AUTOPILOT, "AVD_ENABLE", 1.0),
        Parameter(AUTOPILOT, "AVD_F_ACTION", 3.0 if acts else 1.0),
        Traffic(RECEIVER, report(now_s, north_m=3_500.0, east_m=0.0, altitude_m=OWN_M)),
    ]
    flight.fly(20.0)
    assert flight.messages()
    assert flight.engine.decision.threats
    assert bool(flight.modes) is not acts


def test_component_156_is_not_ours_while_traffic_is_sent_from_it() -> None:
    engine = EngineParams(component_id=156)
    with pytest.raises(ValueError, match=r"traffic\.forward"):
        EngineConfig(engine=engine)
    assert EngineConfig(engine=engine, traffic=TrafficParams(forward="off"))
