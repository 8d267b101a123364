"""The flying process's side of the display: starts the display's process and sends it snapshots.

The display is a process of its own. Many browsers, or a failure there, cannot disturb the flying loop, which
shares neither interpreter nor file descriptors with it, and never waits for it: while the pipe is full,
snapshots are left out.

Objects go down the pipe as a length in four bytes and a pickle; only the parent can write to it. Lines of
JSON come back.
"""

import asyncio
import contextlib
import json
import logging
import os
import pickle
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from companion.links.backoff import Backoff
from companion.web.live_snapshot import LiveSnapshot
from companion.web.settings import Settings

_log = logging.getLogger("companion")

_LENGTH_BYTES = 4
_LONGEST_OBJECT_BYTES = 16_000_000
_LONGEST_LINE_BYTES = 4096
_SHORTEST_INTERVAL_S = 0.08  # a simulation faster than real time makes more ticks than the eye can see
# Snapshots with thousands of aircraft take at most this share of the flying loop's time.
_LARGEST_SHARE, _LONGEST_INTERVAL_S = 0.05, 0.5
_NICENESS = 10  # after all other processes
_OOM_SCORE = "500"  # the kernel ends the display first when memory is short
# A port in use most likely stays in use, and each start costs a small computer a second of CPU.
_LONGEST_WAIT_S = 60.0
_PATIENCE_AT_END_S = 1.0


def pack(item: Any) -> bytes:
    """Bytes that carry an object through the pipe."""
    body = pickle.dumps(item, protocol=pickle.HIGHEST_PROTOCOL)
    return len(body).to_bytes(_LENGTH_BYTES, "big") + body


async def unpack(reader: asyncio.StreamReader) -> Any:
    """The next object from the pipe; `EOFError` when the other end is closed."""
    try:
        length = int.from_bytes(await reader.readexactly(_LENGTH_BYTES), "big")
        if length > _LONGEST_OBJECT_BYTES:
            raise EOFError
        return pickle.loads(await reader.readexactly(length))
    except asyncio.IncompleteReadError as end:
        raise EOFError from end


class Display:
    """Shows snapshots in browsers. Calls `on_role` with each role that an authorised browser asks for."""

    def __init__(self, settings: Settings, on_role: Callable[[str], None] = lambda _: None) -> None:
        self.settings = settings
        self.on_role = on_role
        self.dropped = 0  # snapshots left out because the pipe was full
        self.process_id: int | None = None  # while it runs
        self._pipe: asyncio.StreamWriter | None = None
        self._shown_s = -1.0
        self._interval_s = _SHORTEST_INTERVAL_S
        self._backoff = Backoff(_LONGEST_WAIT_S)

    def is_ready(self) -> bool:
        """True when a snapshot is due and the pipe is empty. Starts the next interval; counts a full pipe."""
        pipe, wall_s = self.pipe, time.monotonic()
        if pipe is None or wall_s - self._shown_s < self._interval_s:
            return False
        self._shown_s = wall_s
        full = pipe.transport.get_write_buffer_size() > 0
        self.dropped += full
        return not full

    def show(self, snapshot: LiveSnapshot) -> None:
        """Send a snapshot; call only when `is_ready`."""
        begun_s = time.perf_counter()
        self._write(snapshot)
        took_s = time.perf_counter() - begun_s
        self._interval_s = max(_SHORTEST_INTERVAL_S, min(took_s / _LARGEST_SHARE, _LONGEST_INTERVAL_S))

    @property
    def pipe(self) -> asyncio.StreamWriter | None:
        """The pipe to the display's process, while that runs."""
        return self._pipe

    def _write(self, item: object) -> None:
        if self.pipe is not None:
            self.pipe.write(pack(item))

    async def run(self) -> None:
        """Run the display's process, and restart it whenever it ends, until cancelled."""
        while True:
            self._backoff.opening()
            try:
                problem = await self._run_once()
            except (OSError, RuntimeError, ValueError) as error:
                problem = f"cannot be started: {error}"  # no memory, descriptors or interpreter
            level = self._backoff.failed(time.monotonic())
            _log.log(level, "display: %s; flying on without it, trying again", problem)
            await asyncio.sleep(self._backoff.wait_s(time.monotonic()))

    async def _run_once(self) -> str:
        """Run the process until it ends; returns the reason."""
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-P",  # import the same packages as we do, whatever the working directory
            "-m",
            "companion.web",
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=_LONGEST_LINE_BYTES,
            start_new_session=True,  # Ctrl-C reaches only us; the display ends when we do
        )
        assert process.stdin is not None
        assert process.stdout is not None
        self.process_id, problem = process.pid, "it ended"
        try:
            _lower_priority(process.pid)
            process.stdin.write(pack(self.settings))
            self._pipe = process.stdin
            while line := await process.stdout.readline():
                problem = self._take_line(line) or problem
        except (OSError, ValueError) as error:
            problem = str(error)
        finally:
            self._pipe = self.process_id = None
            process.stdin.close()
            await _end(process)
        return problem

    def _take_line(self, line: bytes) -> str | None:
        """Handle a line from the display; returns the problem if it reports one."""
        try:
            message = json.loads(line)
        except (ValueError, RecursionError):
            return None
        match message:
            case {"serving": str(url)}:
                self._backoff.opened(time.monotonic())
                _log.info("display: %s", url)
            case {"role": str(role)}:
                self.on_role(role)
            case {"problem": str(problem)}:
                return problem
            case _:
                pass
        return None


class MemberDisplay(Display):
    """One aircraft's part of a display that shows several, which is run by itself: here `run` only waits."""

    def __init__(self, shared: Display, member: str) -> None:
        """`member` is one of the names in the settings of `shared`."""
        super().__init__(shared.settings)
        self._shared = shared
        self._member = member

    @property
    def pipe(self) -> asyncio.StreamWriter | None:
        """The pipe to the process of the display that is shared."""
        return self._shared.pipe

    def show(self, snapshot: LiveSnapshot) -> None:
        """Send a snapshot with the aircraft's name."""
        self._write((self._member, snapshot))

    async def run(self) -> None:
        """Wait until cancelled."""
        await asyncio.Event().wait()


def _lower_priority(process_id: int) -> None:
    """When CPU or memory is short, the flying loop keeps it."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process_id, _NICENESS)
        Path(f"/proc/{process_id}/oom_score_adj").write_text(_OOM_SCORE, encoding="ascii")


async def _end(process: asyncio.subprocess.Process) -> None:
    """Wait for a process whose pipe is closed, and kill it if it does not end by itself."""
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
