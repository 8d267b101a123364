"""Commands that run on, forked from a process that has imported everything: a start takes no second."""

import asyncio
import atexit
import importlib
import multiprocessing
import os
import sys
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import DupFd
from pathlib import Path
from typing import Any

CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(
    [
        "companion.cli", "companion.preflight", "companion.replay", "companion.runtime",
        "companion.report.page", "sim.cli", "sim.campaign.command", "sim.demo",
        "sim.paper.command", "matplotlib.pyplot",
    ]
)  # fmt: skip
_STDOUT, _STDERR = 1, 2


class Forked:
    """A process with the interface of `asyncio.subprocess.Process`, as far as tests need it."""

    def __init__(self, process: BaseProcess) -> None:
        self._process = process
        self._pipes: dict[int, tuple[asyncio.StreamReader, asyncio.BaseTransport]] = {}

    async def read(self, number: int, end: int) -> None:
        """Read from our end of the pipe to its descriptor `number`."""
        reader = asyncio.StreamReader()
        transport, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(end, "rb")
        )
        self._pipes[number] = reader, transport

    @property
    def pid(self) -> int:
        """Its process id."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Its exit code, the negative number of the signal that killed it, or none while it runs."""
        return self._process.exitcode

    @property
    def stdout(self) -> asyncio.StreamReader:
        """What it writes there."""
        return self._pipes[_STDOUT][0]

    @property
    def stderr(self) -> asyncio.StreamReader:
        """What it writes there."""
        return self._pipes[_STDERR][0]

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.returncode is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()

    def terminate(self) -> None:
        """Ask it to end."""
        self._process.terminate()

    async def wait(self) -> int:
        """Wait for its end; returns its exit code."""
        loop, ended = asyncio.get_running_loop(), asyncio.Event()
        if self.returncode is None:
            loop.add_reader(self._process.sentinel, ended.set)
            try:
                await ended.wait()
            finally:
                loop.remove_reader(self._process.sentinel)
            self._process.join()
        assert self.returncode is not None
        return self.returncode

    async def communicate(self) -> tuple[bytes, bytes]:
        """Wait for its end; returns what it still writes to stdout and stderr."""
        out, errors = await asyncio.gather(self._rest(_STDOUT), self._rest(_STDERR))
        await self.wait()
        return out, errors

    async def _rest(self, number: int) -> bytes:
        return await self._pipes[number][0].read() if number in self._pipes else b""

    def close_pipes(self) -> None:
        """Close our ends of its stdout and stderr, as a closed terminal or an ended `| tee` does."""
        for _, transport in self._pipes.values():
            transport.close()


class _Written:
    """Descriptors that the new process writes to, for its stdout and stderr."""

    def __init__(self, *ends: Any) -> None:
        self.ends = ends

    def __reduce__(self) -> tuple[type["_Written"], tuple[Any, ...]]:
        return _Written, tuple(DupFd(end) for end in self.ends)

    def use(self) -> None:
        """In the new process: write there."""
        for number, end in zip((_STDOUT, _STDERR), self.ends, strict=True):
            os.dup2(end.detach(), number)


async def fork(
    *arguments: str,
    module: str = "companion",
    folder: Path | None = None,
    into: int | None = None,
    **environment: str,
) -> Forked:
    """Start `companion`, or with the module `sim` `companion-sim`; it writes to pipes, or all `into` one."""
    pipes = [os.pipe() for _ in (_STDOUT, _STDERR)] if into is None else []
    written = _Written(*(end for _, end in pipes)) if into is None else _Written(into, into)
    process = CONTEXT.Process(target=_run, args=(module, arguments, folder, environment, written))
    process.daemon = True
    process.start()
    forked = Forked(process)
    for number, (ours, theirs) in zip((_STDOUT, _STDERR), pipes, strict=False):
        os.close(theirs)
        await forked.read(number, ours)
    return forked


def _run(
    module: str,
    arguments: tuple[str, ...],
    folder: Path | None,
    environment: dict[str, str],
    written: _Written,
) -> None:
    written.use()
    run_command(module, arguments, folder, environment)


def run_command(
    module: str, arguments: tuple[str, ...], folder: Path | None, environment: dict[str, str]
) -> None:
    """Run a command in this process, as its entry point does."""
    os.environ |= environment
    os.chdir(folder or Path.cwd())
    sys.argv = ["-c", *arguments]
    try:
        importlib.import_module(f"{module}.cli").main()
    finally:
        atexit._run_exitfuncs()  # a process of `multiprocessing` ends without
