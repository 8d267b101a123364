"""Links that fail and recover: what is logged, and which links are affected."""

import asyncio
import logging

import pytest

from companion.errors import LinkDownError, LinkError
from companion.links import Link, LinkState, OnFrames, Reconnect, memory_pair, open_all, reconnect
from companion.mavlink.framing import Frame
from tests.support.inbox import Inbox, frame, until


class Troubled(Link):
    """Cannot be opened the first few times; after that it is open until closed."""

    def __init__(self, failures: int, error: LinkError) -> None:
        super().__init__("troubled")
        self.tries = 0
        self.closed = asyncio.Event()
        self._failures = failures
        self._error = error

    async def open(self) -> None:
        self.tries += 1
        if self.tries <= self._failures:
            raise self._error

    async def run(self, on_frames: OnFrames) -> None:  # noqa: ARG002 - it receives nothing
        await self.closed.wait()

    def close(self) -> None:
        self.closed.set()

    def _send(self, data: bytes) -> None:
        raise NotImplementedError


async def test_one_warning_when_it_fails_and_one_line_when_it_works_again(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.DEBUG, "companion")
    monkeypatch.setattr(reconnect, "STEADY_S", 0.0)  # of the timer; the clock below counts as working
    now_s = 0.0

    def ten_seconds_later() -> float:
        nonlocal now_s
        now_s += 10.0
        return now_s

    link = Troubled(3, LinkDownError("troubled: no such device"))
    reconnect_link = Reconnect(link, ten_seconds_later)
    running = asyncio.create_task(reconnect_link.run(Inbox()))
    await until(lambda: reconnect_link.state is LinkState.UP)
    link.close()
    await running
    logged = [(one.levelname, one.message) for one in caplog.records]
    failing = "troubled: no such device; trying again until it works"
    assert logged == [
        ("WARNING", failing),
        ("DEBUG", failing),
        ("DEBUG", failing),
        ("INFO", "troubled: works again"),
    ]
    assert link.tries == 4


async def test_one_link_down_does_not_disturb_another() -> None:
    near, far = memory_pair()
    heard, never = Inbox(), Inbox()
    down = Reconnect(Troubled(99, LinkDownError("troubled: gone")))
    tasks = [asyncio.create_task(down.run(never)), asyncio.create_task(Reconnect(near).run(heard))]
    for count in range(1, 6):
        far.send(frame())
        await heard.until(count)
    assert down.state is LinkState.WAITING
    near.close()
    await tasks[1]
    tasks[0].cancel()
    await asyncio.wait(tasks)


async def test_a_bug_is_not_treated_as_a_bad_link() -> None:
    near, far = memory_pair()

    def buggy(_frames: list[Frame], _link: Link) -> None:
        raise ZeroDivisionError

    far.send(frame())
    with pytest.raises(ZeroDivisionError):
        await Reconnect(near).run(buggy)


async def test_only_a_permanent_error_ends_the_start() -> None:
    working, down = Troubled(0, LinkError("")), Troubled(9, LinkDownError("troubled: not yet"))
    await open_all([working, down])
    assert (working.tries, down.tries) == (1, 1)
    assert not working.closed.is_set()
    with pytest.raises(LinkError, match="in use"):
        await open_all([working, Troubled(9, LinkError("troubled: address in use"))])
    assert working.closed.is_set(), "closed with the others"


class Slow(Troubled):
    """Waits for a slow name server."""

    def __init__(self) -> None:
        super().__init__(0, LinkError(""))
        self.answered = asyncio.Event()

    async def open(self) -> None:
        await self.answered.wait()
        await super().open()


async def test_a_slow_name_lookup_does_not_delay_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reconnect, "_LONGEST_WAIT_AT_START_S", 0.02)
    slow = Slow()
    async with asyncio.timeout(10.0):
        await open_all([slow])
        assert slow.tries == 0
        slow.answered.set()
        await until(lambda: slow.tries == 1)
