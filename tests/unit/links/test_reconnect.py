"""Links that fail and come back: what is said, and who notices."""

import asyncio
import logging

import pytest

from companion.errors import LinkDownError, LinkError
from companion.links import Link, LinkState, OnFrames, Reconnect, memory_pair, open_at_start, reconnect
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

    async def run(self, on_frames: OnFrames) -> None:  # noqa: ARG002 - it says nothing
        await self.closed.wait()

    def close(self) -> None:
        self.closed.set()

    def _send(self, data: bytes) -> None:
        raise NotImplementedError


async def test_it_is_said_once_that_it_fails_and_once_that_it_works(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.DEBUG, "companion")
    monkeypatch.setattr(reconnect, "STEADY_S", 0.0)  # of the timer; what the clock says counts besides
    now_s = 0.0

    def in_seconds_that_fly() -> float:
        nonlocal now_s
        now_s += 10.0
        return now_s

    link = Troubled(3, LinkDownError("troubled: no such device"))
    kept = Reconnect(link, in_seconds_that_fly)
    running = asyncio.create_task(kept.run(Inbox()))
    await until(lambda: kept.state is LinkState.UP)
    link.close()
    await running
    said = [(one.levelname, one.message) for one in caplog.records]
    again = "troubled: no such device; trying again until it works"
    assert said == [("WARNING", again), ("DEBUG", again), ("DEBUG", again), ("INFO", "troubled: works again")]
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


async def test_a_bug_is_not_taken_for_a_bad_link() -> None:
    near, far = memory_pair()

    def buggy(_frames: list[Frame], _link: Link) -> None:
        raise ZeroDivisionError

    far.send(frame())
    with pytest.raises(ZeroDivisionError):
        await Reconnect(near).run(buggy)


async def test_only_what_can_never_work_ends_the_start() -> None:
    well, down = Troubled(0, LinkError("")), Troubled(9, LinkDownError("troubled: not yet"))
    await open_at_start([well, down])
    assert (well.tries, down.tries) == (1, 1)
    assert not well.closed.is_set()
    with pytest.raises(LinkError, match="in use"):
        await open_at_start([well, Troubled(9, LinkError("troubled: address in use"))])
    assert well.closed.is_set(), "nobody else would close it"


class Slow(Troubled):
    """Asks a name server that takes its time."""

    def __init__(self) -> None:
        super().__init__(0, LinkError(""))
        self.answered = asyncio.Event()

    async def open(self) -> None:
        await self.answered.wait()
        await super().open()


async def test_a_name_that_takes_long_does_not_hold_up_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reconnect, "_PATIENCE_AT_START_S", 0.02)
    slow = Slow()
    async with asyncio.timeout(10.0):
        await open_at_start([slow])
        assert slow.tries == 0
        slow.answered.set()
        await until(lambda: slow.tries == 1)
