"""Addresses of receivers that do not speak MAVLink, in the list of links."""

from pathlib import Path

import pytest

from companion.address import (
    DocumentAddress,
    LinkAddress,
    NetworkAddress,
    NetworkKind,
    ReceiverAddress,
    SerialAddress,
    is_of_receiver,
    parse_address,
    parse_any_address,
    parse_receiver_address,
)
from companion.config import load_config
from companion.errors import ConfigError, LinkError
from companion.links import open_link, open_links
from companion.sources.registry import FORMATS, Format
from tests.support.line_decoder import line_formats


@pytest.mark.parametrize(
    ("text", "name", "at"),
    [
        ("sbs:tcp:127.0.0.1:30003", "sbs", NetworkAddress(NetworkKind.TCP_OUT, "127.0.0.1", 30003)),
        ("sbs:tcpout:radar:30003", "sbs", NetworkAddress(NetworkKind.TCP_OUT, "radar", 30003)),
        ("beast:tcp:[::1]:30005", "beast", NetworkAddress(NetworkKind.TCP_OUT, "::1", 30005)),
        ("beast:tcpin:0.0.0.0:30004", "beast", NetworkAddress(NetworkKind.TCP_IN, "0.0.0.0", 30004)),
        ("gdl90:udpin:0.0.0.0:4000", "gdl90", NetworkAddress(NetworkKind.UDP_IN, "0.0.0.0", 4000)),
        ("flarm:serial:/dev/ttyUSB0:57600", "flarm", SerialAddress("/dev/ttyUSB0", 57_600)),
        ("flarm:serial:/dev/ttyUSB0", "flarm", SerialAddress("/dev/ttyUSB0")),
        ("flarm:tcp:HOST:4353", "flarm", NetworkAddress(NetworkKind.TCP_OUT, "HOST", 4353)),
        (
            "readsb:http://127.0.0.1/tar1090/data/aircraft.json", "readsb",
            DocumentAddress("http://127.0.0.1/tar1090/data/aircraft.json", None),
        ),
        ("readsb:https://[::1]:8443/a?b=c", "readsb", DocumentAddress("https://[::1]:8443/a?b=c", None)),
        ("readsb:file:/run/readsb/a.json", "readsb", DocumentAddress(None, "/run/readsb/a.json")),
    ],
)  # fmt: skip
def test_addresses(text: str, name: str, at: LinkAddress | DocumentAddress) -> None:
    address = parse_any_address(text)
    assert address == parse_receiver_address(text) == ReceiverAddress(name, at)
    assert address.place == at.place
    assert is_of_receiver(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gdl9:udpin:0.0.0.0:4000", "'gdl9' is not a format of receivers, did you mean gdl90?"),
        ("GDL90:udpin:0.0.0.0:4000", "did you mean gdl90?"),
        ("sbs1:tcp:a:30003", "did you mean sbs?"),
        ("readsp:http://a/b", "did you mean readsb?"),
        ("asterix:udpin:0.0.0.0:8600", "there are sbs, readsb, beast, gdl90, flarm"),
        (":udpin:0.0.0.0:8600", "'' is not a format of receivers"),
        ("gdl90:udpout:10.0.0.1:4000", "only listened to: use gdl90:udpin:HOST:PORT, a port of ours"),
        ("gdl90:udpin:0.0.0.0:4000?listen", "only listened to: leave out ?listen"),
        ("sbs:127.0.0.1:30003", "sbs does not arrive like this: use sbs:tcp:HOST:PORT"),
        ("sbs:http://127.0.0.1/", "sbs does not arrive like this: use sbs:tcp:HOST:PORT"),
        ("beast:file:/tmp/x", "beast does not arrive like this: use beast:tcp:HOST:PORT"),
        ("sbs", "use sbs:tcp:HOST:PORT"),
        ("sbs:tcp:host", "is not a link address: use sbs:tcp:HOST:PORT"),
        ("sbs:tcp:host:70000", "sbs:tcp:host:70000: port must be at most 65535"),
        ("sbs:tcp:host:0", "port 0 cannot be sent to"),
        ("flarm:serial:/dev/x:12", "flarm:serial:/dev/x:12: baud rate must be"),
        ("readsb:tcp:a:30003", "readsb is a document: use readsb:http://HOST/PATH or readsb:file:/PATH"),
        ("readsb:ftp://a/b", "readsb is a document"),
        ("readsb:http://user:secret@host/a", "readsb is a document"),
        ("readsb:http://host:0/a", "readsb is a document"),
        ("readsb:http://host/a b", "readsb is a document"),
        ("readsb:file:aircraft.json", "readsb is a document"),
        ("readsb:udpin:0.0.0.0:1", "readsb is a document"),
    ],
)  # fmt: skip
def test_wrong_ones_are_refused_in_one_line_with_what_to_do(text: str, words: str) -> None:
    with pytest.raises(LinkError) as caught:
        parse_any_address(text)
    assert words in str(caught.value)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["gdl90:udpin:0.0.0.0:4000", "gdl9:tcp:a:1", "readsb:file:/x"])
def test_a_receiver_is_no_mavlink_link(text: str) -> None:
    for refuse in (parse_address, open_link):
        with pytest.raises(LinkError, match="a MAVLink link is needed here"):
            refuse(text)


@pytest.mark.parametrize("text", ["udpin:0.0.0.0:14550", "serial:/dev/by-path/a:b:tcp:57600", "udpi:a:1"])
def test_mavlink_links_are_none_of_receivers(text: str) -> None:
    assert not is_of_receiver(text)


def config(folder: Path, links: str) -> Path:
    path = folder / "c.yaml"
    path.write_text(f"autopilot: px4\nlinks:\n{links}\n")
    return path


def test_they_stand_beside_the_mavlink_links(tmp_path: Path) -> None:
    with line_formats():
        texts = "- udpin:0.0.0.0:0\n- gdl90:udpin:0.0.0.0:4000\n- readsb:file:/a"
        links, receivers = open_links(load_config(config(tmp_path, texts)).links)
    assert [link.address for link in links] == ["udpin:0.0.0.0:0"]
    assert [one.receiver.address for one in receivers] == ["gdl90:udpin:0.0.0.0:4000", "readsb:file:/a"]
    assert [one.receiver.title for one in receivers] == ["GDL 90", "readsb"]
    assert all(one.link.listen_only for one in receivers)


@pytest.mark.parametrize(
    ("links", "words"),
    [
        ("- gdl90:udpin:0.0.0.0:4000", "links: one of them must be a MAVLink link"),
        (
            "- udpin:a:1\n- gdl9:udpin:0.0.0.0:4000",
            "c.yaml:4: links[1]: gdl9:udpin:0.0.0.0:4000: 'gdl9' is",
        ),
        ("- udpin:0.0.0.0:4000\n- gdl90:udpin:0.0.0.0:4000", "links: the same address is given twice"),
        ("- udpin:a:1\n- gdl90:tcp:a:2\n- gdl90:tcpout:a:2", "links: the same address is given twice"),
        ("- udpin:a:1\n- broken:tcp:a:2", "links[1]: broken: the Python package no_such_package is missing"),
    ],
)
def test_a_configuration_is_refused_with_line_and_key(
    links: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(FORMATS, "broken", Format("no_such_package:Broken"))
    with line_formats(), pytest.raises(ConfigError) as caught:
        load_config(config(tmp_path, links))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
