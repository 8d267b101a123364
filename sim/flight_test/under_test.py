"""Companion beside the vehicle: a process of its own, inside on the simulation's clock, or already there."""

import asyncio
import contextlib
import os
import signal
import sys
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

import yaml

from companion.config import load_config
from companion.engine import Engine, EngineConfig
from companion.errors import ConfigError
from companion.links import open_link
from companion.runtime import Runtime
from sim.clock import ScaledClock

_ENDS_WITHIN_S = 30.0


class CompanionUnderTest(ABC):
    """Companion during a flight test; it reaches the vehicle at a port on loopback."""

    name = "companion"
    can_stall = False
    on_our_link = True  # whether its messages pass through the hub

    @property
    def ended(self) -> bool:
        """Whether it ended by itself."""
        return False

    @abstractmethod
    async def start(self, port: int) -> None:
        """Start it."""

    @abstractmethod
    async def stop(self) -> str | None:
        """End it in order, so that it gives the aircraft back; returns a problem in words."""

    def stall(self, *, stalled: bool) -> None:
        """Stop it from running, or let it go on; nothing where that cannot be done."""
        del stalled


class External(CompanionUnderTest):
    """Already there, on a link of its own."""

    name = "external"
    on_our_link = False

    async def start(self, port: int) -> None:
        """Nothing is to be started."""

    async def stop(self) -> str | None:
        """Nothing is to be ended."""
        return None


class Process(CompanionUnderTest):
    """`companion run` with a configuration, whose links are replaced by the port."""

    can_stall = True

    def __init__(self, config: Path | None, folder: Path) -> None:
        """`folder` is for its log, its recording and its state."""
        if config is not None:
            load_config(config)  # refused before anything is started
        self._config, self._folder = config, folder
        self._process: asyncio.subprocess.Process | None = None
        self.name = "process" if config is None else f"process, {config}"

    async def start(self, port: int) -> None:
        """Start it; it logs into the folder."""
        path = self._folder / "companion.yaml"
        path.write_text(yaml.safe_dump(self._settings(port)), encoding="utf-8")
        with (self._folder / "companion.log").open("wb") as log:
            self._process = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "companion", "run", "--no-web", str(path),
                stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip

    @property
    def ended(self) -> bool:
        """Whether the process ended."""
        return self._process is not None and self._process.returncode is not None

    def _settings(self, port: int) -> dict[str, Any]:
        content: Any = {} if self._config is None else yaml.safe_load(self._config.read_text("utf-8"))
        settings = {name: value for name, value in (content or {}).items() if name != "web"}
        if self._config is not None and "obstacle_files" in settings:
            beside = self._config.resolve().parent
            settings["obstacle_files"] = [str(beside / name) for name in settings["obstacle_files"]]
        settings["links"] = [f"udpout:127.0.0.1:{port}"]
        recording = dict(settings.get("recording") or {})
        settings["recording"] = recording | {"directory": str(self._folder / "recording")}
        settings["state_file"] = str(self._folder / "companion.state")
        settings["settings_file"] = str(self._folder / "companion.settings")
        return settings

    def stall(self, *, stalled: bool) -> None:
        """Stop the process, or let it go on."""
        if self._process is None or self._process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._process.pid, signal.SIGSTOP if stalled else signal.SIGCONT)

    async def stop(self) -> str | None:
        """Send SIGTERM and wait."""
        process = self._process
        if process is None:
            return None
        if process.returncode is not None:
            return f"companion ended during the flight with {process.returncode}"
        self.stall(stalled=False)
        with contextlib.suppress(ProcessLookupError):
            process.send_signal(signal.SIGTERM)
        try:
            code = await asyncio.wait_for(process.wait(), _ENDS_WITHIN_S)
        except TimeoutError:
            process.kill()
            await process.wait()
            return "companion did not end"
        return None if code == 0 else f"companion ended with {code}"


class Inside(CompanionUnderTest):
    """In this process, on the clock of a simulation that is faster or slower than real time."""

    name = "inside"

    def __init__(self, config: Path | None, clock: ScaledClock) -> None:
        self._engine = EngineConfig() if config is None else load_config(config).for_engine(())
        self._clock = clock
        self._runtime: Runtime | None = None
        self._running: asyncio.Task[None] | None = None

    async def start(self, port: int) -> None:
        """Start its task."""
        link = open_link(f"udpout:127.0.0.1:{port}")
        self._runtime = Runtime(Engine(self._engine), [link], clock=self._clock)
        self._running = asyncio.create_task(self._runtime.run(), name="companion")

    @property
    def ended(self) -> bool:
        """Whether its task ended."""
        return self._running is not None and self._running.done()

    async def stop(self) -> str | None:
        """End it, and wait until the aircraft is given back."""
        if self._runtime is None or self._running is None:
            return None
        self._runtime.stop()
        try:
            await asyncio.wait_for(self._running, _ENDS_WITHIN_S)
        except Exception as error:  # noqa: BLE001 - whatever it is, the flight test must end in order
            return f"companion: {error or type(error).__name__}"
        return None


def companion_under_test(
    companion: str | None, folder: Path, clock: ScaledClock | None
) -> CompanionUnderTest:
    """What `--companion` says: a configuration, `external`, or nothing; with a `clock`, inside on it."""
    if companion == "external":
        if clock is not None:
            raise ConfigError("--companion external and --speedup: only a companion inside can be sped up")
        return External()
    config = None if companion is None else Path(companion)
    return Process(config, folder) if clock is None else Inside(config, clock)
