"""dump1090 on simulated radio: what it makes of our squitters, and what our decoders make of that.

`make receiver-tools` installs it; without it these tests are skipped.
"""

import json
import shutil
import socket
import subprocess
import time
from collections import Counter
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from companion.model import TrafficReport, TrafficSource
from companion.sources.beast import BeastDecoder, BeastFramer
from companion.sources.decoder import Decoder
from companion.sources.readsb import ReadsbDecoder
from companion.sources.sbs import SbsDecoder
from sim.receivers.beast import BeastEncoder
from sim.receivers.encoder import Reception, Transmission
from tests.support.adsb_receivers import PLACE, aircraft, distance_m, moved, reports
from tests.support.mode_s_samples import samples

DUMP1090 = shutil.which("dump1090-mutability")
pytestmark = [
    pytest.mark.wire,
    pytest.mark.skipif(DUMP1090 is None, reason="no dump1090 is installed: make receiver-tools"),
]

AIRCRAFT = {
    0x4840D6: aircraft(),
    0x3C6666: aircraft(
        place=moved(PLACE._replace(altitude_m=9_300.0), -20_000.0, 15_000.0),
        icao=0x3C6666,
        pressure_altitude_m=9_144.0,
        velocity_mps=(-150.0, 150.0, 0.0),
    ),
}
MOMENTS = 16
PATIENCE_S, SILENCE_S = 20.0, 0.4
ATTEMPTS, SOME_BYTES = 20, 1_000
SERVED = ("sbs", "beast", "avr")


def radio() -> bytes:
    """Half a second of radio with squitters of both aircraft."""
    encoder, framer = BeastEncoder(), BeastFramer(Counter())
    messages = []
    for moment in range(MOMENTS):
        stream = b"".join(encoder.encode(Reception(0.5 * moment, list(AIRCRAFT.values()))))
        frames = framer.feed(stream)
        messages += [(0.01 + 0.02 * moment + 0.001 * at, each.message) for at, each in enumerate(frames)]
    return samples(messages, 0.5)


def free_ports(count: int) -> list[int]:
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [int(each.getsockname()[1]) for each in sockets]


def connected(port: int) -> socket.socket:
    begin_s = time.monotonic()
    while True:
        try:
            return socket.create_connection(("127.0.0.1", port), SILENCE_S)
        except OSError:
            assert time.monotonic() - begin_s < PATIENCE_S
            time.sleep(0.02)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What dump1090 serves of the radio: SBS, Beast and AVR streams, and aircraft.json."""
    folder = tmp_path_factory.mktemp("dump1090")
    ports = free_ports(len(SERVED))
    options = {
        **dict(zip(("--net-sbs-port", "--net-bo-port", "--net-ro-port"), map(str, ports), strict=True)),
        **{"--net-ri-port": "0", "--net-bi-port": "0", "--net-bind-address": "127.0.0.1"},
        **{"--ifile": "-", "--write-json": str(folder), "--write-json-every": "0.2"},
    }
    command = [str(DUMP1090), "--net", "--quiet", *(word for option in options.items() for word in option)]
    with (
        subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL) as process,
        ExitStack() as stack,
    ):
        streams = [stack.enter_context(connected(port)) for port in ports]
        assert process.stdin is not None
        found = dict.fromkeys(SERVED, b"")
        for _ in range(ATTEMPTS):  # what was on the air before it accepted a connection is not sent there
            process.stdin.write(radio())
            process.stdin.flush()
            found = {name: found[name] + read(each) for name, each in zip(SERVED, streams, strict=True)}
            if all(len(data) > SOME_BYTES for data in found.values()):
                break
        found["readsb"] = document(folder / "aircraft.json")
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
    return found


def read(stream: socket.socket) -> bytes:
    """All that arrives, until nothing does for a while."""
    data = b""
    with suppress(TimeoutError):
        while piece := stream.recv(65_536):
            data += piece
    return data


def document(path: Path) -> bytes:
    """aircraft.json as soon as it has both aircraft."""
    begin_s = time.monotonic()
    while time.monotonic() - begin_s < PATIENCE_S:
        raw = path.read_bytes() if path.exists() else b"{}"
        if sum("lat" in entry for entry in json.loads(raw).get("aircraft", [])) == len(AIRCRAFT):
            return raw
        time.sleep(0.05)
    raise AssertionError("aircraft.json does not have the aircraft")


def newest(decoder: Decoder, stream: bytes) -> list[tuple[TrafficReport, Transmission]]:
    """The last report of each aircraft, with what it sent."""
    found = {report.icao: report for report in reports(decoder, [stream])}
    assert decoder.counters.bad == {}
    assert set(found) == set(AIRCRAFT)
    return [(found[icao], sent) for icao, sent in AIRCRAFT.items()]


def assert_position(report: TrafficReport, sent: Transmission) -> None:
    assert distance_m(report, sent.place) < 5.2
    assert report.altitude_m == pytest.approx(sent.pressure_altitude_m, abs=4.0)
    assert (report.callsign, report.airborne, report.source) == (sent.callsign, True, TrafficSource.ADSB)
    north_mps, east_mps, _ = sent.velocity_mps
    assert report.ground_speed_mps == pytest.approx((north_mps**2 + east_mps**2) ** 0.5, abs=0.8)


def test_its_sbs_lines(served: dict[str, bytes]) -> None:
    for report, sent in newest(SbsDecoder(), served["sbs"]):
        assert_position(report, sent)


@pytest.mark.parametrize("name", ["beast", "avr"])
def test_its_mode_s_messages(served: dict[str, bytes], name: str) -> None:
    for report, sent in newest(BeastDecoder(), served[name]):
        assert_position(report, sent)
        assert report.geometric_altitude_m == pytest.approx(sent.place.altitude_m, abs=8.0)
        assert report.position_sigma_m == pytest.approx(30.0 / 2.448)


def test_its_document(served: dict[str, bytes]) -> None:
    for report, sent in newest(ReadsbDecoder(), served["readsb"]):
        assert_position(report, sent)
