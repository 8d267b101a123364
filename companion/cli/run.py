"""`companion run`: flies."""

import asyncio
import gc
import logging
import os
import time
from typing import Annotated

import typer

from companion import __version__
from companion.airspace.obstacles import Obstacle
from companion.cli.common import ConfigFile, note_if_slow
from companion.cli.display import display_settings_in_flight
from companion.cli.logs import log_without_waiting
from companion.config import Config, describe_saved, load_config, load_obstacles, load_saved
from companion.engine import Engine
from companion.errors import LogError
from companion.links import open_all, open_links
from companion.recording.recorder import MB, Recorder
from companion.recording.state_file import DurableStateFile, StateFile
from companion.runtime import Runtime
from companion.signals import exit_on_ending
from companion.watchdog import Watchdog
from companion.web import Display

_log = logging.getLogger("companion")


def run(
    config_file: ConfigFile,
    no_web: Annotated[bool, typer.Option("--no-web", help="No live display in the browser.")] = False,
) -> None:
    """Fly: listen to the autopilot, avoid traffic, give the aircraft back. Ends on Ctrl-C or SIGTERM.

    The links of CONFIG are udpin:HOST:PORT, udpout:HOST:PORT, tcpin:HOST:PORT, tcpout:HOST:PORT or
    serial:DEVICE:BAUD. Nothing is sent on a link that ends in ?listen. A link that fails is opened again.
    Receivers of traffic have their format before the address, as in gdl90:udpin:0.0.0.0:4000.
    """
    exit_on_ending()
    config = load_config(config_file)
    log_without_waiting()
    display = None if no_web or not config.web.enabled else Display(display_settings_in_flight(config))
    note_if_slow()
    asyncio.run(_run(config, load_obstacles(config), display))


async def _run(config: Config, obstacles: tuple[Obstacle, ...], display: Display | None) -> None:
    links, receivers = open_links(config.links)
    await open_all([*links, *(one.link for one in receivers)])
    _log.info("companion %s on %s", __version__, ", ".join(config.links))
    recorder, not_recorded = _recorder(config)
    saved, settings = load_saved(config), DurableStateFile(config.settings_file)
    if saved.problem is not None:
        _log.warning(saved.problem)
    if saved.damaged:
        settings.set_aside("damaged")
    for line in describe_saved(config, saved):
        _log.info("%s: %s", config.settings_file, line)
    engine = Engine(config.for_engine(obstacles), saved=saved.values)
    runtime = Runtime(
        engine,
        links,
        receivers=receivers,
        recorder=recorder,
        not_recorded=not_recorded,
        watchdog=Watchdog(os.environ),
        state_file=StateFile(config.state_file),
        settings=settings,
        display=display,
    )
    # Everything that is loaded stays: a full collection of it would delay a tick by a tenth of a second.
    gc.freeze()
    await runtime.run(on_signals=True)


def _recorder(config: Config) -> tuple[Recorder | None, str | None]:
    """The recorder, or the reason why there is none; a full or broken card must not stop the flight."""
    recording = config.recording
    if not recording.enabled:
        return None, None
    try:
        recorder = Recorder(
            recording.directory,
            time.time(),
            max_file_bytes=recording.max_file_mb * MB,
            max_total_bytes=recording.max_total_mb * MB,
        )
    except LogError as error:
        _log.error("%s; flying without a recording", error)
        return None, str(error)
    _log.info("recording %s", recorder.tlog_path)
    return recorder, None
