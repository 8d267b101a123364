"""The page in a real browser: drawing, reconnecting, keys, roles, replay, and hostile names."""

import asyncio
import contextlib
import re
import shutil
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page, async_playwright

from companion.gcs.traffic_conditions import traffic_conditions
from companion.model import Layer, Track, TrackState
from companion.output.notice import Condition
from companion.traffic import Concern, ConcernKind
from companion.web.health import ReceiverCount
from companion.web.live_snapshot import LiveSnapshot
from companion.web.replay_server import RecordedSource
from companion.web.rolling_stats import RollingStats
from companion.web.settings import Settings
from companion.web.source import LiveSource
from companion.web.state import state_of
from tests.support.web_bench import TOKEN, Site, health, live, site, usual

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ALONE = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
LAPTOP, PHONE = (1366, 768), (390, 844)

pytestmark = [
    pytest.mark.wire,
    pytest.mark.asyncio(loop_scope="module"),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed: make browser"),
]

TRACKS = ("A00001", "GLIDER", "NEW")


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser() -> AsyncIterator[Browser]:
    """One browser for all tests; each of them opens a page in a session of its own."""
    async with async_playwright() as playwright:
        started = await playwright.chromium.launch(executable_path=CHROMIUM, args=[*ALONE])
        yield started
        await started.close()


@contextlib.asynccontextmanager
async def page(browser: Browser, at: Site, size: tuple[int, int] = LAPTOP) -> AsyncIterator[Page]:
    """The page, opened; fails if the browser logs an error."""
    errors: list[str] = []
    opened = await browser.new_page(viewport={"width": size[0], "height": size[1]})
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
    opened.set_default_timeout(15_000)
    try:
        await opened.goto(f"http://127.0.0.1:{at.port}/")
        await opened.wait_for_selector("html[data-ready=true]")
        yield opened
    finally:
        await opened.close()
    assert [words for words in errors if "WebSocket" not in words] == []


@contextlib.asynccontextmanager
async def shown(source: LiveSource, snapshot: LiveSnapshot | None = None) -> AsyncIterator[None]:
    """Show the snapshot ten times a second until the block ends."""

    async def show() -> None:
        while True:
            source.show(snapshot or usual())
            await asyncio.sleep(0.1)

    showing = asyncio.create_task(show())
    try:
        yield
    finally:
        showing.cancel()


async def seen(opened: Page, what: str) -> Any:
    return await opened.evaluate(f"window.companionDisplay.{what}")


async def until_true(opened: Page, expression: str) -> None:
    """Wait until an expression is true. Polls, since the page's policy forbids evaluating text."""
    async with asyncio.timeout(15.0):
        while not await opened.evaluate(expression):  # noqa: ASYNC110
            await asyncio.sleep(0.05)


async def test_the_page_draws_the_decision_and_keeps_drawing(browser: Browser) -> None:
    source = live()
    async with shown(source), site(source) as at, page(browser, at) as opened:
        assert await opened.inner_text("#layer-word") == "OUTER"
        assert await opened.inner_text("#because") == "CLIMB to 397 m: HEAD1", "as announced"
        assert await opened.inner_text("#mode") == "GUIDED"
        assert await opened.locator("#traffic tr").count() == 1
        assert "HEAD1" in await opened.inner_text("#traffic")
        assert await seen(opened, "tracksDrawn") == 1
        drawn = await seen(opened, "statesDrawn")
        await until_true(opened, f"window.companionDisplay.statesDrawn > {drawn + 5}")
        assert await colours(opened) > 20
        assert await opened.is_hidden("#roles"), "read-only"


async def test_members_are_chosen_in_a_row_and_shown_one_at_a_time(browser: Browser) -> None:
    second = replace(usual(), system_id=12, snapshot=replace(usual().snapshot, mode="OFFBOARD"))
    sources = {"U1": live(), "U2": live(), "U3": live()}
    async with (
        shown(sources["U1"]),
        shown(sources["U2"], second),
        site(sources) as at,
        page(browser, at) as opened,
    ):
        links = opened.locator("#members a")
        assert await links.count() == 3
        await until_true(opened, "document.querySelectorAll('#members a[data-layer=outer]').length === 2")
        assert [await links.nth(n).inner_text() for n in range(3)] == [
            "U1\nGUIDED · outer", "U2\nOFFBOARD · outer", "U3\nno data"
        ]  # fmt: skip
        assert await opened.locator("#members a[aria-current=page]").inner_text() == "U1\nGUIDED · outer"
        assert await opened.inner_text("#mode") == "GUIDED"
        await links.nth(1).click()
        await opened.wait_for_url("**/?member=U2")
        await opened.wait_for_selector("html[data-ready=true]")
        assert await opened.inner_text("#mode") == "OFFBOARD"
        assert "U2" in await opened.locator("#members a[aria-current=page]").inner_text()


async def test_one_aircraft_has_no_selector(browser: Browser) -> None:
    source = live()
    async with shown(source), site(source) as at, page(browser, at) as opened:
        assert await opened.is_hidden("#members")


async def colours(opened: Page) -> int:
    """Number of different colours on the map; an empty canvas has one."""
    count: int = await opened.evaluate(
        """() => {
            const canvas = document.getElementById("canvas");
            const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            const seen = new Set();
            for (let i = 0; i < data.length; i += 4) {
                seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
            }
            return seen.size;
        }"""
    )
    return count


async def test_the_page_reconnects_to_a_restarted_server(browser: Browser) -> None:
    source = live()
    async with shown(source):
        async with site(source) as at:
            port = at.port
            opening = page(browser, at)
            opened = await opening.__aenter__()
            assert await opened.is_hidden("#no-data")
        await opened.wait_for_selector("#no-data", state="visible")
        before = await seen(opened, "statesDrawn")
        async with site(source, port=port):
            await until_true(opened, f"window.companionDisplay.statesDrawn > {before + 5}")
            await opened.wait_for_selector("#no-data", state="hidden")
            with contextlib.suppress(AssertionError):  # the browser logs the failed connections
                await opening.__aexit__(None, None, None)


async def test_names_of_traffic_are_plain_text(browser: Browser) -> None:
    hostile = '<img src=x onerror="window.fooled=1">'
    tracks = [replace(track, callsign=hostile) for track in usual().snapshot.tracks]
    snapshot = replace(usual(), snapshot=replace(usual().snapshot, tracks=tracks, last_text=hostile))
    source = live()
    async with shown(source, snapshot), site(source) as at, page(browser, at) as opened:
        assert hostile[:12] in await opened.inner_text("#traffic"), "cut to the length of a callsign"
        assert hostile in await opened.inner_text("#last-text")
        assert await opened.evaluate("window.fooled") is None
        assert await opened.locator("img").count() == 0


async def test_the_keys_work(browser: Browser) -> None:
    source = live()
    async with shown(source), site(source) as at, page(browser, at) as opened:
        heights = await opened.inner_text("#height-unit")
        await opened.keyboard.press("u")
        assert await opened.inner_text("#height-unit") != heights
        up = await opened.inner_text("#orientation")
        await opened.keyboard.press("t")
        assert await opened.inner_text("#orientation") != up
        await opened.keyboard.press("j")
        assert "HEAD1" in await opened.inner_text("#details-title")
        await opened.keyboard.press("o")
        assert "Own" in await opened.inner_text("#details-title")
        await opened.keyboard.press("?")
        assert await opened.is_visible("#help-dialog")
        await opened.keyboard.press("Escape")
        assert await opened.is_hidden("#help-dialog")
        await asyncio.sleep(1.5)
        await opened.keyboard.press("ArrowLeft")
        await opened.wait_for_selector("#past", state="visible")
        past_s = await seen(opened, "shownTime")
        await opened.keyboard.press("l")
        await opened.wait_for_selector("#past", state="hidden")
        assert await seen(opened, "shownTime") >= past_s


async def test_a_change_of_role_needs_the_token_and_a_confirmation(browser: Browser) -> None:
    source = live()
    advising, with_token = replace(usual(), role="advise"), Settings(token=TOKEN)
    async with shown(source, advising), site(source, with_token) as at, page(browser, at) as opened:
        await opened.click("#roles button[data-role=advise]")
        await opened.fill("#token", TOKEN)
        assert at.roles == []
        await opened.click("#role-confirm")
        await opened.wait_for_selector("#role-dialog", state="hidden")
        assert at.roles == ["advise"]


async def test_a_phone_shows_everything_without_scrolling_sideways(browser: Browser) -> None:
    source = live()
    async with shown(source), site(source) as at, page(browser, at, PHONE) as opened:
        assert await opened.evaluate("document.documentElement.scrollWidth") <= PHONE[0]
        for wanted in ("#layer-word", "#canvas", "#orientation", "#zoom-in"):
            assert await opened.is_visible(wanted)
        smallest = await opened.evaluate(
            """() => Math.min(...[...document.querySelectorAll(".scope button")]
                .filter((button) => button.offsetParent !== null)
                .map((button) => Math.min(button.offsetWidth, button.offsetHeight)))"""
        )
        assert smallest >= 40, "fingers are large"


CUT = """() => [...document.querySelectorAll("body *")]
    .filter((one) => one.offsetParent !== null && one.tagName !== "CANVAS" && one.id !== "announcer")
    .filter((one) => one.textContent.trim() && one.scrollWidth > one.clientWidth + 1)
    .filter((one) => getComputedStyle(one).display !== "inline" && one.clientWidth > 0)
    .map((one) => `${one.tagName} ${one.id} ${one.className} ${one.textContent.slice(0, 60)}`)"""


@pytest.mark.parametrize("size", [PHONE, (1280, 800)])
async def test_each_manoeuvre_is_listed_as_announced_and_no_words_are_cut(
    browser: Browser, size: tuple[int, int]
) -> None:
    condition = Condition(
        "low", 4, "Avoidance off: it is 20 m above home, below 30 m, for a long time and more"
    )
    source = live(replace(usual(), conditions=(condition,)))
    async with site(source) as at, page(browser, at, size) as opened:
        for words in ("CLIMB to 397 m, RIGHT 045, SLOWER 14 m/s", "DESCEND to 250 m, LEFT 270", "HOLD"):
            text = f"{words}: HEAD1 12 o'clock 5.7 km 100 m below"
            shown_now = replace(usual().snapshot, maneuver=words, maneuver_text=text, last_text=text)
            source.show(replace(usual(), snapshot=shown_now, conditions=(condition,)))
            await until_true(opened, f"document.getElementById('because').textContent === '{words}: HEAD1'")
        await until_true(opened, "document.querySelectorAll('#decisions li:not([hidden])').length >= 4")
        listed = await opened.inner_text("#decisions")
        for words in ("CLIMB to 397 m, RIGHT 045, SLOWER 14 m/s", "DESCEND to 250 m, LEFT 270", "HOLD"):
            assert f"OUTER {words}: HEAD1 12 o'clock 5.7 km 100 m below" in listed
        assert condition.text in await opened.inner_text("#conditions")
        assert await opened.evaluate(CUT) == []
        await opened.keyboard.press("j")
        assert "Above home" in await opened.inner_text("#details")
        assert "Altitude" not in await opened.inner_text("main")
        await asyncio.sleep(0.6)
        assert await opened.evaluate(CUT) == []


async def test_one_countdown_for_an_aircraft_which_ends_as_passed(browser: Browser) -> None:
    (threat,) = usual().snapshot.decision.threats
    source = live()
    for time_s, text in ((5.9, "0:05"), (-1.0, "passed")):
        decision = replace(usual().snapshot.decision, threats=(replace(threat, time_to_closest_s=time_s),))
        snapshot = replace(usual(), snapshot=replace(usual().snapshot, decision=decision))
        async with shown(source, snapshot), site(source) as at, page(browser, at) as opened:
            await opened.keyboard.press("j")
            await asyncio.sleep(0.8)
            assert await opened.inner_text("#closest-time") == text
            assert (await opened.inner_text("#traffic tr td:last-child")) == text
            assert re.search(rf"Closest in\s+{text}", await opened.inner_text("#details"))
            assert "A00001" not in await opened.inner_text(".bar")


async def test_a_hundred_aircraft_and_an_emergency_are_drawn(browser: Browser) -> None:
    own = usual().snapshot.ownship
    assert own is not None
    around = [
        Track(
            f"A{number:05X}",
            own.time_s,
            (
                own.position_m[0] + 60.0 * number,
                own.position_m[1] - 2500.0 + 50.0 * number,
                own.position_m[2],
            ),
            (30.0, 10.0, 0.0),
            age_s=float(number % 9),
        )
        for number in range(99)
    ]
    (threat,) = usual().snapshot.decision.threats
    decision = replace(
        usual().snapshot.decision, layer=Layer.INNER, threats=(replace(threat, layer=Layer.INNER),)
    )
    snapshot = replace(
        usual(),
        snapshot=replace(usual().snapshot, decision=decision, tracks=(*usual().snapshot.tracks, *around)),
    )
    source = live()
    async with shown(source, snapshot), site(source) as at, page(browser, at) as opened:
        assert await opened.inner_text("#layer-word") == "INNER"
        await until_true(opened, "window.companionDisplay.tracksDrawn == 100")
        assert "100" in await opened.inner_text("#traffic-count")
        drawn = await seen(opened, "statesDrawn")
        await until_true(opened, f"window.companionDisplay.statesDrawn > {drawn + 10}")
        first = await opened.inner_text("#traffic tr:first-child")
        assert "HEAD1" in first, "the most urgent is on top"


def of_several_sources() -> LiveSnapshot:
    """One confirmed, one tentative, one coasted aircraft, two receivers, and traffic that is not avoided."""
    (head,) = usual().snapshot.tracks
    north_m, east_m, down_m = head.position_m

    def beside(name: str, off_m: float, **changes: Any) -> Track:
        place_m = (north_m, east_m + off_m, down_m)
        return replace(head, track_id=name, callsign=name, icao=None, position_m=place_m, **changes)

    tracks = (
        replace(
            head,
            age_s=12.3,
            state=TrackState.COASTED,
            sources=(),
            position_sigma_m=300.0,
        ),
        beside("GLIDER", 1500.0, sources=("flarm:udpin:0.0.0.0:1", "ADS-B"), position_sigma_m=10.0),
        beside("NEW", -1500.0, state=TrackState.TENTATIVE, sources=("sbs:tcp:a:1", "sbs:tcp:b:1")),
    )
    concerns = (
        Concern(ConcernKind.HEIGHT_UNKNOWN, "HB2291", 1840.0, 0.5, 0.4),
        Concern(ConcernKind.NOT_HEARD, "HEAD1", 5100.0, 0.0, 12.3),
        Concern(ConcernKind.LEFT_OUT, "912"),
    )
    receivers = (
        ReceiverCount("sbs:tcp:a:1", "SBS-1", "accuracy", 0, 0, (("truncated", 2),), 3, 4, 0.2, None),
        ReceiverCount("flarm:udpin:0.0.0.0:1", "FLARM", "", 0, 0, (), 0, 0, 33.0, "silent for 10 s"),
    )
    conditions = (
        *traffic_conditions(concerns, usual().snapshot.ownship),
        Condition("low", 4, "Avoidance off: low"),
    )
    shown_now = replace(usual().snapshot, tracks=tracks)
    around = health(receivers=receivers)
    return replace(usual(), snapshot=shown_now, concerns=concerns, conditions=conditions, health=around)


@pytest.mark.parametrize("size", [PHONE, LAPTOP])
async def test_sources_states_receivers_and_what_is_not_avoided_are_shown(
    browser: Browser, size: tuple[int, int]
) -> None:
    source = live()
    async with shown(source, of_several_sources()), site(source) as at, page(browser, at, size) as opened:
        assert await opened.evaluate(CUT) == []
        head, glider, new = [await opened.inner_text(f"[data-track={name}]") for name in TRACKS]
        assert "not heard 12 s · ±734 m" in head
        assert "flarm, ADS-B · ±24 m" in glider
        assert "tentative · 2 sbs" in new
        states = [await opened.get_attribute(f"[data-track={name}]", "data-state") for name in TRACKS]
        assert states == ["coasted", "confirmed", "tentative"]
        concerns = await opened.inner_text("#concerns")
        assert re.search(r"HB2291\s+1 o'clock, 1.84 km\s+Not avoided: height unknown", concerns)
        assert re.search(r"HEAD1\s+12 o'clock, 5.10 km\s+Avoided: not heard for 12 s", concerns)
        assert "912 aircraft left out" in concerns
        assert (await opened.inner_text("#conditions")).split("\n") == ["Avoidance off: low"], "not twice"
        receivers = await opened.inner_text("#receivers")
        for text in ("SBS-1", "4 aircraft", "2 not understood, 3 dropped", "Lacks: accuracy"):
            assert text in receivers
        assert "silent for 10 s" in await opened.inner_text("#receivers [data-health=lost]")
        assert await seen(opened, "tracksDrawn") == 3
        await opened.keyboard.press("j")
        await until_true(opened, "document.getElementById('details').innerText.includes('Sources')")
        details = await opened.inner_text("#details")
        assert re.search(r"State\s+not heard 12 s", details)
        assert re.search(r"Position\s+±734 m", details)
        assert await opened.evaluate(CUT) == []
        assert await opened.evaluate("document.documentElement.scrollWidth") <= size[0]


async def test_a_moment_before_has_the_states_of_its_tracks(browser: Browser) -> None:
    source, snapshot = live(), of_several_sources()
    confirmed = [replace(track, state=TrackState.CONFIRMED) for track in snapshot.snapshot.tracks]
    async with site(source) as at:
        source.show(snapshot)
        async with page(browser, at) as opened:
            async with shown(source, snapshot):
                await until_true(opened, "window.companionDisplay.statesDrawn > 15")
            async with shown(
                source, replace(snapshot, snapshot=replace(snapshot.snapshot, tracks=tuple(confirmed)))
            ):
                await until_true(opened, "document.querySelector('#traffic [data-state=coasted]') === null")
                await opened.keyboard.press("Home")
                await opened.wait_for_selector("#past", state="visible")
                await until_true(opened, "document.querySelector('#traffic [data-state=coasted]') !== null")
                assert await opened.inner_text("[data-track=A00001] .evidence") == "not heard 12 s · ±734 m"
                assert await opened.get_attribute("[data-track=NEW]", "data-state") == "tentative"


async def test_a_replay_plays_pauses_and_seeks(browser: Browser) -> None:
    source, stats = RecordedSource(), RollingStats()
    for tick in range(300):
        source.add(tick / 10.0, state_of(replace(usual(), health=health()), tick + 1, stats))
    async with site(source) as at, page(browser, at) as opened:
        assert await opened.is_visible("#replay-controls")
        await until_true(opened, "window.companionDisplay.newestSequence > 3")
        await opened.keyboard.press(" ")
        await opened.wait_for_selector("#play[aria-label=Play]")
        stopped = await seen(opened, "newestSequence")
        await opened.keyboard.press("Shift+ArrowRight")
        await until_true(opened, f"window.companionDisplay.newestSequence >= {stopped + 90}")
        await opened.keyboard.press("Home")
        await until_true(opened, "window.companionDisplay.newestSequence <= 2")
