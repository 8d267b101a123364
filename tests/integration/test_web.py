"""The display's server from outside: what it serves and refuses; viewers do not disturb each other."""

import asyncio
import contextlib
import json
import re
import socket
from dataclasses import replace

import pytest
import websockets
import yaml
from prometheus_client.parser import text_string_to_metric_families

from companion.load import OVERLOADED
from companion.model import TrackState, TrafficKind
from companion.output.notice import Condition
from companion.traffic import Concern, ConcernKind
from companion.web import serving
from companion.web.app import MOST_VIEWERS, STATIC
from companion.web.health import LinkCount, ReceiverCount
from companion.web.live_snapshot import LiveSnapshot
from companion.web.settings import Settings
from companion.web.source import LiveSource
from tests.support.paths import CONFIGS
from tests.support.web_bench import TOKEN, Answer, health, live, site, usual

pytestmark = pytest.mark.wire

ALERTS = CONFIGS / "prometheus" / "alerts.yaml"
WITH_TOKEN = Settings(token=TOKEN)


async def show_on(source: LiveSource, interval_s: float = 0.02, snapshot: LiveSnapshot | None = None) -> None:
    while True:
        source.show(snapshot or usual())
        await asyncio.sleep(interval_s)


async def test_the_state_is_served_after_the_first_snapshot() -> None:
    source = live()
    async with site(source) as at:
        assert (await at.ask("/api/state")).status == 503
        assert (await at.ask("/healthz")).status == 503
        condition = Condition("low", 4, "Avoidance off: low")
        source.show(replace(usual(), conditions=(condition,)))
        answer = await at.ask("/api/state")
        assert answer.status == 200
        assert answer.json["decision"]["layer"] == "outer"
        assert answer.json["companion"]["conditions"] == [{"severity": 4, "text": "Avoidance off: low"}]
        assert (await at.ask("/healthz")).json == {
            "status": "ok",
            "kind": "live",
            "autopilot_known": True,
            "conditions": ["Avoidance off: low"],
        }
        silent = Condition("unanswered", 3, "Avoidance: autopilot answers no request")
        source.show(replace(usual(), conditions=(condition, silent)))
        answer = await at.ask("/healthz")
        assert answer.status == 503
        assert answer.json["status"] == silent.text
        source.show(replace(usual(), conditions=(condition,)))
        assert b'companion_conditions{severity="4"} 1.0' in (await at.ask("/metrics")).body
        info = (await at.ask("/api/info")).json
        assert info == {
            "kind": "live",
            "title": "Companion",
            "duration_s": None,
            "height_unit": "m",
            "may_command": False,
        }


async def test_every_answer_has_security_headers() -> None:
    async with site(live(usual())) as at:
        for path in ("/", "/api/state", "/nothing", "/metrics", "/static/index.html"):
            headers = (await at.ask(path)).headers
            assert "default-src 'self'" in headers["content-security-policy"], path
            assert headers["x-content-type-options"] == "nosniff"
            assert headers["cache-control"] == "no-cache"


async def test_every_file_of_the_page_is_served_with_its_type() -> None:
    """Browsers run no module and apply no style sheet whose content type is wrong."""
    types = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".html": "text/html"}
    files = [file for file in STATIC.rglob("*") if file.is_file()]
    assert {file.parent.name for file in files} == {"static", "core", "map", "panels", "replay"}
    async with site(live(usual())) as at:
        for file in files:
            answer = await at.ask(f"/static/{file.relative_to(STATIC)}")
            assert (answer.status, answer.body) == (200, file.read_bytes()), file
            assert answer.headers["content-type"].split(";")[0] == types[file.suffix], file
            assert "default-src 'self'" in answer.headers["content-security-policy"], file


@pytest.mark.parametrize(
    "path",
    [
        "/app.py",
        "/static/../app.py",
        "/static/%2e%2e/app.py",
        "/static/core/../../app.py",
        "/static/core/%2e%2e/%2e%2e/app.py",
        "/static/map/..%2f..%2fapp.py",
        "/static//etc/passwd",
        "/static/core",
        "/static/core/",
    ],
)
async def test_no_file_outside_the_static_folder_is_served(path: str) -> None:
    async with site(live(usual())) as at:
        assert (await at.ask(path)).status == 404


async def test_metrics_are_in_the_format_of_prometheus() -> None:
    snapshot = replace(
        usual(),
        health=health(
            ticks_below=(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11),
            ticks_total_s=0.5,
            unusable=3,
            past=4,
            of_others=5,
            repeated=2,
            unsent=6,
        ),
    )
    async with site(live(snapshot)) as at:
        text = (await at.ask("/metrics")).body.decode()
    families = {family.name: family for family in text_string_to_metric_families(text)}
    ticks = families["companion_tick_seconds"]
    assert ticks.type == "histogram"
    assert [s.value for s in ticks.samples if s.name.endswith("_bucket")] == [float(n) for n in range(1, 12)]
    layers = {sample.labels["layer"]: sample.value for sample in families["companion_layer"].samples}
    assert layers == {"clear": 0.0, "outer": 1.0, "inner": 0.0}
    assert families["companion_messages_unusable"].samples[0].value == 3.0
    assert families["companion_messages_late"].samples[0].value == 4.0
    assert families["companion_messages_of_others"].samples[0].value == 5.0
    assert families["companion_requests_repeated"].samples[0].value == 2.0
    assert families["companion_messages_unsent"].samples[0].value == 6.0
    assert families["companion_engagements"].samples[0].value == 1.0
    assert families["companion_up"].samples[0].value == 1.0


async def test_an_overload_is_said_in_the_metrics_the_state_and_the_health() -> None:
    held = Condition(OVERLOADED, 4, "Overloaded: 300/s dropped")
    link = LinkCount("udpin:0.0.0.0:14550", 100, 0, 0, 5, 0, dropped=7)
    counted = health(
        late_ticks=11, skipped_ticks=2, dropped_reports=300, forwarded=12, links=(link,),
        mavlink_sources=(("ADS-B 1/156", 40),),
    )  # fmt: skip
    async with site(live(replace(usual(), health=counted, conditions=(held,)))) as at:
        lines = (await at.ask("/metrics")).body.decode().splitlines()
        state = (await at.ask("/api/state")).json
        answer = await at.ask("/healthz")
    assert {
        "companion_overloaded 1.0",
        "companion_ticks_late_total 11.0",
        "companion_ticks_skipped_total 2.0",
        "companion_reports_dropped_total 300.0",
        "companion_reports_forwarded_total 12.0",
        'companion_link_dropped_total{link="udpin:0.0.0.0:14550"} 7.0',
        'companion_reports_total{source="ADS-B 1/156"} 40.0',
    } <= set(lines)
    service = state["service"]
    assert (service["late_ticks"], service["dropped_reports"], service["forwarded_reports"]) == (13, 300, 12)
    assert [one["dropped"] for one in state["links"]] == [7]
    assert (answer.status, answer.json["status"]) == (200, held.text)


async def test_metrics_of_receivers_have_their_addresses() -> None:
    bad = (("truncated", 2), ("wrong checksum", 5))
    one = ReceiverCount("gdl90:udpin:0.0.0.0:4000", "GDL 90", "", 70, 60, bad, 3, 4, 0.5, "no GPS fix")
    async with site(live(replace(usual(), health=health(receivers=(one,))))) as at:
        text = (await at.ask("/metrics")).body.decode()
    where = 'receiver="gdl90:udpin:0.0.0.0:4000"'
    assert {line for line in text.splitlines() if line.startswith("companion_receiver")} == {
        f"companion_receiver_messages_total{{{where}}} 70.0",
        f"companion_receiver_reports_total{{{where}}} 60.0",
        f"companion_receiver_dropped_total{{{where}}} 3.0",
        f"companion_receiver_aircraft{{{where}}} 4.0",
        f"companion_receiver_silent_seconds{{{where}}} 0.5",
        f'companion_receiver_bad_total{{reason="truncated",{where}}} 2.0',
        f'companion_receiver_bad_total{{reason="wrong checksum",{where}}} 5.0',
        f"companion_receiver_failed{{{where}}} 1.0",
    }


async def test_metrics_count_aircraft_by_state_and_source() -> None:
    (known,) = usual().snapshot.tracks
    coasted = replace(known, state=TrackState.COASTED, sources=())
    both = replace(known, sources=("ADS-B", "sbs:tcp:a:1"))
    mast = replace(known, kind=TrafficKind.OBSTACLE)
    shown = replace(usual().snapshot, tracks=(known, coasted, both, mast))
    concern = Concern(ConcernKind.HEIGHT_UNKNOWN, "N2", 1840.0, 0.5, 0.4)
    async with site(live(replace(usual(), snapshot=shown, concerns=(concern,)))) as at:
        lines = (await at.ask("/metrics")).body.decode().splitlines()
    assert {
        'companion_aircraft{state="tentative"} 0.0',
        'companion_aircraft{state="confirmed"} 2.0',
        'companion_aircraft{state="coasted"} 1.0',
        'companion_aircraft_by_source{source="ADS-B"} 2.0',
        'companion_aircraft_by_source{source="sbs:tcp:a:1"} 1.0',
        'companion_traffic_concerns{kind="height unknown"} 1.0',
        'companion_traffic_concerns{kind="lost"} 0.0',
    } <= set(lines)


async def test_the_example_alerts_use_existing_metrics() -> None:
    rules = yaml.safe_load(ALERTS.read_text())["groups"][0]["rules"]
    async with site(live(usual())) as at:
        text = (await at.ask("/metrics")).body.decode()
    there = {line.split("{")[0].split(" ")[0] for line in text.splitlines() if not line.startswith("#")}
    # Per link or receiver; this snapshot has none.
    there |= {"companion_frames_total", "companion_frames_lost_total", "companion_receiver_failed"}
    for rule in rules:
        names = set(re.findall(r"companion_\w+", rule["expr"]))
        assert names, rule["alert"]
        assert names <= there, rule["alert"]


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:8080", 200),
        ("localhost", 200),
        ("[::1]:8080", 200),
        ("evil.example", 403),
        ("evil.example:8080", 403),
        ("", 403),
        ("127.0.0.1@evil.example", 403),
        ("localhost.evil.example", 403),
        ("[", 403),
    ],
)
async def test_unknown_host_names_are_refused(host: str, status: int) -> None:
    """Otherwise a page of another server could point its own name at us and read along."""
    async with site(live(usual())) as at:
        assert (await at.ask("/api/state", headers={"Host": host})).status == status


@pytest.mark.parametrize(
    ("origin", "allowed"),
    [
        (None, True),
        ("ours", True),
        ("https://ground.example", True),
        ("http://evil.example", False),
        ("null", False),
    ],
)
async def test_the_stream_is_only_for_our_own_page(origin: str | None, allowed: bool) -> None:
    settings = Settings(origins=("https://ground.example",))
    async with site(live(usual()), settings) as at:
        if origin == "ours":
            origin = f"http://127.0.0.1:{at.port}"
        if not allowed:
            with pytest.raises(websockets.InvalidStatus, match="403"):
                await websockets.connect(at.stream, origin=origin)  # type: ignore[arg-type]
            return
        async with websockets.connect(at.stream, origin=origin) as stream:  # type: ignore[arg-type]
            assert json.loads(await stream.recv())["version"] == 1


async def test_only_the_token_allows_a_change_of_role() -> None:
    source = live()
    showing = asyncio.create_task(show_on(source, snapshot=replace(usual(), role="advise")))
    body = b'{"role": "advise"}'
    async with site(source, WITH_TOKEN) as at:

        async def ask_role(token: str | None, body: bytes = body, **headers: str) -> Answer:
            if token is not None:
                headers["Authorization"] = f"Bearer {token}"
            return await at.ask("/api/role", method="POST", headers=headers, body=body)

        await asyncio.sleep(0.1)
        refused = await ask_role(None)
        assert (refused.status, refused.headers["www-authenticate"]) == (401, "Bearer")
        assert (await ask_role("a-token-of-others")).status == 401
        assert (await ask_role(TOKEN, Origin="http://evil.example")).status == 403
        assert at.roles == []
        assert (await ask_role(TOKEN)).status == 200
        assert (await ask_role(TOKEN, b'{"role": "ADVISE"}')).json == {"role": "advise"}
        assert at.roles == ["advise", "advise"]
        for junk in (b"", b"{", b"[]", b'{"role": 2}', b'{"role": "pilot"}', b"[" * 1000, b"x" * 5000):
            assert (await ask_role(TOKEN, junk)).status == 400, junk
        assert len(at.roles) == 2
        assert (await ask_role(TOKEN, b'{"role": "fly"}')).status == 409, "no snapshot shows the role"
        showing.cancel()
        await asyncio.sleep(2.2)
        assert (await ask_role(TOKEN)).status == 503, "old snapshots do not count"
        assert len(at.roles) == 3


async def test_without_a_token_the_display_is_read_only() -> None:
    async with site(live(usual())) as at:
        answer = await at.ask(
            "/api/role",
            method="POST",
            headers={"Authorization": f"Bearer {TOKEN}"},
            body=b'{"role": "advise"}',
        )
        assert answer.status == 403
        assert "no token is configured" in answer.json["error"]
        wrong = await at.ask("/api/role")
        assert (wrong.status, wrong.headers["allow"]) == (405, "POST")


async def test_idle_connections_are_closed_and_streams_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serving, "_REQUEST_TIMEOUT_S", 0.3)
    async with site(live(usual())) as at:
        for part in (b"", b"GET /api/state HTTP/1.1\r\nHost: localhost\r\n\r\nG"):
            reader, writer = await asyncio.open_connection("127.0.0.1", at.port)
            writer.write(part)
            async with asyncio.timeout(5.0):
                with contextlib.suppress(ConnectionResetError):
                    while await reader.read(65_536):
                        pass
            writer.close()
        async with websockets.connect(at.stream) as stream:
            await asyncio.sleep(0.6)
            assert stream.state is websockets.State.OPEN, "streams stay open"


@pytest.mark.parametrize(
    "request_line",
    [
        b"GET /api/state?" + b"x" * 40_000,
        b"\x00\xff\xfe",
        b"GET\r\n\r\n",
        b"BREW / HTTP/1.1\r\n\r\n",
        b"\r\n" * 100,
    ],
    ids=["too long", "bytes", "half a line", "no such method", "empty lines"],
)
async def test_broken_requests_are_refused_and_others_are_served(request_line: bytes) -> None:
    async with site(live(usual())) as at:
        reader, writer = await asyncio.open_connection("127.0.0.1", at.port)
        writer.write(request_line + b" HTTP/1.1\r\nHost: localhost\r\n\r\n")
        async with asyncio.timeout(10.0):
            answer = await reader.read(100)
        writer.close()
        assert answer == b"" or answer.split()[1][:1] == b"4", answer
        assert (await at.ask("/api/state")).status == 200


@pytest.mark.parametrize(
    "message", ["x" * 100_000, "x" * 1000, b"\x00" * 100, "not JSON", "[[[[", "{}"], ids=lambda m: str(m[:8])
)
async def test_messages_of_one_viewer_do_not_disturb_another(message: str | bytes) -> None:
    source = live(usual())
    showing = asyncio.create_task(show_on(source))
    async with site(source) as at, websockets.connect(at.stream, close_timeout=0.2) as other:
        async with websockets.connect(at.stream) as stream:
            await stream.recv()
            await stream.send(message)
            closed = isinstance(message, bytes) or len(message) > 256
            try:
                async with asyncio.timeout(5.0):
                    for _ in range(20):
                        await stream.recv()
                assert not closed
            except websockets.ConnectionClosed:
                assert closed
        first = json.loads(await other.recv())["sequence"]
        assert json.loads(await other.recv())["sequence"] > first
    showing.cancel()


async def test_a_viewer_that_does_not_read_delays_no_other() -> None:
    source = live(usual())
    async with site(source) as at:
        sleeper = socket.create_connection(("127.0.0.1", at.port))
        sleeper.sendall(
            b"GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        showing = asyncio.create_task(show_on(source, 0.0005))
        async with websockets.connect(at.stream) as stream:
            seen = []
            while len(seen) < 2000:
                seen.append(json.loads(await stream.recv())["sequence"])
            assert seen == sorted(set(seen))
        showing.cancel()
        sleeper.close()


async def test_the_number_of_viewers_is_bounded() -> None:
    async with site(live(usual())) as at:
        viewers = [await websockets.connect(at.stream) for _ in range(MOST_VIEWERS)]
        with pytest.raises(websockets.InvalidStatus):
            await websockets.connect(at.stream)
        await viewers.pop().close()
        async with asyncio.timeout(5.0):
            while True:
                try:
                    viewers.append(await websockets.connect(at.stream))
                    break
                except websockets.InvalidStatus:
                    await asyncio.sleep(0.05)
        assert (await at.ask("/api/state")).status == 200
        await asyncio.gather(*(viewer.close() for viewer in viewers))


async def test_the_number_of_connections_is_bounded() -> None:
    async with site(live(usual())) as at, websockets.connect(at.stream) as viewer:
        crowd = []
        for _ in range(1000):
            one = socket.socket()
            one.setblocking(False)
            one.connect_ex(("127.0.0.1", at.port))
            crowd.append(one)
            await asyncio.sleep(0)
        await asyncio.sleep(0.5)
        open_ones = sum(still_open(one) for one in crowd)
        assert open_ones <= 200, "the bound, and connections not yet accepted"
        assert json.loads(await viewer.recv())["version"] == 1
        for one in crowd:
            one.close()
        async with asyncio.timeout(10.0):
            while (await at.ask("/api/state")).status != 200:  # noqa: ASYNC110 - a server sets no events here
                await asyncio.sleep(0.1)


def still_open(one: socket.socket) -> bool:
    try:
        return one.recv(1) != b""
    except BlockingIOError:
        return True
    except OSError:
        return False
