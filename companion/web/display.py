"""The flying process' end of the display: starts it, feeds it, and never waits for it.

The display is a process of its own: however many browsers ask, and whatever goes wrong there, the flying loop
shares neither its interpreter nor its file descriptors. A moment that finds the pipe still full is left out.
"""

import asyncio
import contextlib
import json
import logging
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from companion.links.backoff import Backoff
from companion.web.live_snapshot import LiveSnapshot
from companion.web.pipe import packed
from companion.web.settings import Settings

_log = logging.getLogger("companion")

_SHORTEST_INTERVAL_S = 0.08  # a clock that runs faster than the wall's makes more ticks than anybody can see
_LONGEST_LINE_BYTES = 4096
_PRIORITY = 10  # of nice(1): after everybody else
_FIRST_TO_GO = "500"
# A port that is taken stays so, most likely, and every start costs a second of a small computer.
_LONGEST_WAIT_S = 60.0
_PATIENCE_AT_END_S = 1.0


class Display:
    """Shows what it is given; `on_role` hears the role that a browser with the token asks for."""

    def __init__(self, settings: Settings, on_role: Callable[[str], None] = lambda _: None) -> None:
        self.settings = settings
        self.on_role = on_role
        self.dropped = 0  # moments that found the pipe full
        self.process_id: int | None = None  # while it runs
        self._pipe: asyncio.StreamWriter | None = None
        self._shown_s = -1.0
        self._backoff = Backoff(_LONGEST_WAIT_S)

    def is_ready(self) -> bool:
        """Whether there is room for a moment now, and the last is long enough ago to see a difference."""
        pipe, wall_s = self._pipe, time.monotonic()
        if pipe is None or wall_s - self._shown_s < _SHORTEST_INTERVAL_S:
            return False
        self._shown_s = wall_s
        full = pipe.transport.get_write_buffer_size() > 0
        self.dropped += full
        return not full

    def show(self, moment: LiveSnapshot) -> None:
        """Hand a moment over; to be asked first whether it `is_ready`."""
        if self._pipe is not None:
            self._pipe.write(packed(moment))

    async def run(self) -> None:
        """Keep the display's process alive until cancelled; a failure is told once, and tried again."""
        while True:
            self._backoff.opening()
            self._backoff.opened(time.monotonic())
            try:
                problem = await self._run_once()
            except (OSError, RuntimeError, ValueError) as error:
                problem = f"cannot be started: {error}"  # no memory, no descriptors, no interpreter any more
            level = self._backoff.failed(time.monotonic())
            _log.log(level, "display: %s; flying on without it, trying again", problem)
            await asyncio.sleep(self._backoff.wait_s(time.monotonic()))

    async def _run_once(self) -> str:
        """Until it ends; why it did."""
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-P",  # what it imports is what we import, wherever we were started
            "-m",
            "companion.web",
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=_LONGEST_LINE_BYTES,
            start_new_session=True,  # a Ctrl-C is for us: it ends when we do
        )
        assert process.stdin is not None
        assert process.stdout is not None
        self.process_id, problem = process.pid, "it ended"
        try:
            _make_way(process.pid)
            process.stdin.write(packed(self.settings))
            self._pipe = process.stdin
            while line := await process.stdout.readline():
                problem = self._hear(line) or problem
        except (OSError, ValueError) as error:
            problem = str(error)
        finally:
            self._pipe = self.process_id = None
            process.stdin.close()
            await _ended(process)
        return problem

    def _hear(self, line: bytes) -> str | None:
        """Do what a line from the display says; its problem, if it is one."""
        try:
            said = json.loads(line)
        except (ValueError, RecursionError):
            return None
        match said:
            case {"serving": str(url)}:
                _log.info("display: %s", url)
            case {"role": str(role)}:
                self.on_role(role)
            case {"problem": str(problem)}:
                return problem
            case _:
                pass
        return None


def _make_way(process_id: int) -> None:
    """When processor or memory are short, the flying loop keeps them."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process_id, _PRIORITY)
        Path(f"/proc/{process_id}/oom_score_adj").write_text(_FIRST_TO_GO, encoding="ascii")


async def _ended(process: asyncio.subprocess.Process) -> None:
    """Its pipe is closed, so it ends by itself; else it is ended."""
    try:
        async with asyncio.timeout(_PATIENCE_AT_END_S):
            await process.wait()
    except TimeoutError:
        process.kill()
        await process.wait()
    except asyncio.CancelledError:
        if process.returncode is None:
            process.kill()
        await process.wait()
        raise
