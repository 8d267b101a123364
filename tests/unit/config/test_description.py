"""The effective configuration described, and the addresses that it may have."""

import dataclasses
import json
import math
import re
from pathlib import Path

import pytest

from companion.address import NetworkAddress, NetworkKind, SerialAddress, parse_address
from companion.airspace.fences import FenceZone
from companion.config import Config, RecordingParams, describe
from companion.engine import AircraftLimits
from companion.errors import ConfigError, LinkError
from companion.links import open_link
from tests.unit.config.loading import LINKS, load, refusal

# --- the effective configuration ---------------------------------------------------------------------


def test_a_description_has_degrees_and_loads_to_the_same(tmp_path: Path) -> None:
    written = (
        "links: ['udpin:0.0.0.0:14550', 'udpout:[::1]:14551']\n"
        "recording: {directory: 'a folder: \"mine\"'}\n"
        "traffic: {own_icao: [0x4B1234, 10], stale_s: 33.3}\n"
        "avoidance: {delta_beta_deg: 7.3, envelope: {max_bank_deg: 41.7, max_altitude_m: 512.5}}\n"
    )
    config = load(tmp_path, written)
    text = describe(config)
    assert "\n  own_icao: [0x00000A, 0x4B1234]\n" in text
    assert "\n  delta_beta_deg: 7.3\n" in text
    assert "\n    max_bank_deg: 41.7\n" in text
    assert "\n    min_altitude_m: null\n" in text
    assert "\n  enabled: true\n" in text
    assert not re.search(r"_rad(ps)?:", text)
    assert load(tmp_path, text) == config


FENCES = """aircraft: {max_bank_deg: 35, max_climb_mps: 2.5, loiter_radius_m: -80}
fences:
  - inclusion: true
    vertices_deg: [[47, 8], [47, 8.1], [47.1, 8.05]]
  - {inclusion: false, centre_deg: [47.05, 8.05], radius_m: 300, min_height_m: 0, max_height_m: 150}
"""


def test_limits_and_fences_are_read_and_described(tmp_path: Path) -> None:
    config = load(tmp_path, LINKS + FENCES)
    assert config.aircraft == AircraftLimits(
        max_bank_rad=math.radians(35), max_climb_mps=2.5, loiter_radius_m=-80.0
    )
    assert config.fences == (
        FenceZone(True, vertices_deg=((47.0, 8.0), (47.0, 8.1), (47.1, 8.05))),
        FenceZone(False, centre_deg=(47.05, 8.05), radius_m=300.0, min_height_m=0.0, max_height_m=150.0),
    )
    assert load(tmp_path, describe(config)) == config
    engine = config.for_engine()
    assert (engine.aircraft, engine.fences) == (config.aircraft, config.fences)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("aircraft: {max_bank_deg: 85}", "2: aircraft.max_bank_deg: must be less than 80 (got 85)"),
        (
            "aircraft: {min_airspeed_mps: 20, max_airspeed_mps: 10}",
            "2: aircraft: min_airspeed_mps must not exceed max_airspeed_mps",
        ),
        (
            "fences:\n  - inclusion: true\n    radius_m: 20",
            "3: fences[0]: must have either vertices_deg, or centre_deg and radius_m",
        ),
        ("fences:\n  - radius_m: 20", "3: fences[0].inclusion: is required"),
        (
            "fences: [{inclusion: true, centre: 3}]",
            "2: fences[0].centre: is unknown, did you mean centre_deg?",
        ),
    ],
)
def test_the_errors_of_wrong_limits_and_fences(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        load(tmp_path, LINKS + text)
    assert str(error.value).endswith(message)


def test_a_description_has_every_field() -> None:
    config = Config(links=("udpin:0.0.0.0:14550",))
    keys = re.findall(r"^ *(\w+):", describe(config), flags=re.MULTILINE)

    def count(section: object) -> int:
        assert dataclasses.is_dataclass(section)
        values = [getattr(section, field.name) for field in dataclasses.fields(section)]
        return len(values) + sum(count(value) for value in values if dataclasses.is_dataclass(value))

    assert len(keys) == count(config)


@pytest.mark.parametrize("text", ["true", "Null", "no", "a b", "1", "", "-", "x: y", "#", 'q"', "é", "a\nb"])
def test_any_text_can_be_described_and_loaded(tmp_path: Path, text: str) -> None:
    config = Config(links=("udpin:h:1",), recording=RecordingParams(directory=Path(text)))
    assert load(tmp_path, describe(config)) == config
    json.dumps(describe(config))


# --- addresses ---------------------------------------------------------------------------------------


def test_addresses_are_parsed() -> None:
    udp_in, tcp_out = NetworkKind.UDP_IN, NetworkKind.TCP_OUT
    assert parse_address("udpin:0.0.0.0:14550") == NetworkAddress(udp_in, "0.0.0.0", 14550)
    assert parse_address("udpout:plane.local:1") == NetworkAddress(NetworkKind.UDP_OUT, "plane.local", 1)
    assert parse_address("udpin:[::1]:0?listen") == NetworkAddress(udp_in, "::1", 0, listen_only=True)
    assert parse_address("tcpout:plane.local:5760") == NetworkAddress(tcp_out, "plane.local", 5760)
    assert parse_address("serial:/dev/ttyACM0") == SerialAddress("/dev/ttyACM0", 57_600)
    assert parse_address("serial:/dev/ttyUSB0:921600?listen") == SerialAddress(
        "/dev/ttyUSB0", 921_600, listen_only=True
    )
    by_path = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0"
    assert parse_address(f"serial:{by_path}") == SerialAddress(by_path, 57_600)
    assert parse_address(f"serial:{by_path}:115200") == SerialAddress(by_path, 115_200)


@pytest.mark.parametrize(
    "links",
    [
        "[udpin:h:1, 'udpin:h:1?listen']",
        "[serial:/dev/ttyACM0, serial:/dev/ttyACM0:115200]",
    ],
)
def test_two_links_cannot_have_the_same_address(tmp_path: Path, links: str) -> None:
    assert refusal(tmp_path, f"links: {links}\n") == "c.yaml:1: links: the same address is given twice"


ADDRESSES = [
    "udpin:0.0.0.0:14550",
    "udpin:[fe80::1%eth0]:14550",
    "udpin:h:0",
    "udpout:h:0",
    "udpout:h:65535",
    "udpout:h:65536",
    "udpout:h:123456",
    "udpout:h:-1",
    "udpout::1",
    "udpout:h",
    "udpout:::1:5",
    "UDPIN:h:1",
    "udpin:h:1 ",
    "tcp:h:1",
    "tcpin:h:0",
    "tcpout:h:0",
    "udpin:h:1?listen",
    "udpout:h:1?listen",
    "udpin:h:1?listen?listen",
    "udpin:h:1?talk",
    "serial:/dev/ttyACM0",
    "serial:/dev/ttyACM0:9600?listen",
    "serial:ttyACM0",
    "serial:/dev/ttyACM0:300",
    "serial:/dev/tty ACM0",
    "",
]


@pytest.mark.parametrize("text", ADDRESSES)
def test_configuration_and_links_accept_the_same_addresses(text: str) -> None:
    def refused_by(what: object) -> bool:
        assert callable(what)
        try:
            what(text)
        except LinkError:
            return True
        return False

    assert refused_by(parse_address) == refused_by(open_link)
