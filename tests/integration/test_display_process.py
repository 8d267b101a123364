"""The display's process beside a flight: it may be killed or fail, and the flight goes on."""

import asyncio
import contextlib
import json
import os
import signal
import socket
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from companion.errors import PORT_IN_USE
from companion.web import Display
from companion.web.settings import Settings
from sim.demo import DemoOptions, DemoState, fly_demo
from tests.support.forked import Forked, fork
from tests.support.short_scenario import shorter
from tests.support.web_bench import TOKEN, Answer, Site

pytestmark = pytest.mark.wire

SPEEDUP = 8.0
PATIENCE_S = 40.0


def free_tcp_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


@contextlib.asynccontextmanager
async def flight(
    settings: Settings, speedup: float = SPEEDUP
) -> AsyncIterator[tuple[DemoState, asyncio.Task[DemoState]]]:
    """Fly the head-on scenario with a display."""
    begun: asyncio.Future[DemoState] = asyncio.get_running_loop().create_future()
    options = DemoOptions(shorter("head-on"), speedup=speedup, display=settings)
    flying = asyncio.create_task(fly_demo(options, begun.set_result))
    try:
        yield await begun, flying
    finally:
        flying.cancel()
        await asyncio.gather(flying, return_exceptions=True)


async def until(at: Site, path: str, condition: Callable[[Answer], bool]) -> Answer:
    """Ask until an answer meets the condition; a refused connection is no answer."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            with contextlib.suppress(OSError):
                answer = await at.ask(path)
                if condition(answer):
                    return answer
            await asyncio.sleep(0.05)


async def test_a_killed_display_is_restarted_in_flight() -> None:
    port = free_tcp_port()
    at = Site(port, [])
    async with flight(Settings(port=port, token=TOKEN)) as (state, flying):
        await until(at, "/healthz", lambda a: a.status == 200)
        await until(at, "/api/state", lambda a: a.status == 200 and a.json["companion"]["flying"])
        assert state.runtime is not None
        display = state.runtime._display
        assert display is not None
        assert display.process_id is not None
        os.kill(display.process_id, signal.SIGKILL)
        await until(at, "/api/state", lambda a: a.status == 200 and a.json["own"] is not None)
        metrics = await until(at, "/metrics", lambda a: a.status == 200)
        assert b"companion_engagements_total 1.0" in metrics.body
        assert b"companion_tick_seconds_count" in metrics.body
        order = await at.ask(
            "/api/role",
            method="POST",
            headers={"Authorization": f"Bearer {TOKEN}"},
            body=b'{"role": "advise"}',
        )
        assert (order.status, order.body) == (200, b'{"role":"advise"}')
        assert state.runtime.engine.operator.role.name == "ADVISE"
        process_id = display.process_id
        assert process_id is not None
        flying.cancel()
        await asyncio.gather(flying, return_exceptions=True)
    with pytest.raises(ProcessLookupError):
        os.kill(process_id, 0)


def displayed(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What was logged of the display."""
    return [r.getMessage() for r in caplog.records if r.getMessage().startswith("display:")]


async def test_a_port_in_use_is_logged_once_and_the_flight_goes_on(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        async with flight(Settings(port=port), 25.0) as (state, flying):
            async with asyncio.timeout(PATIENCE_S):
                while not (state.engaged and displayed(caplog)):  # noqa: ASYNC110 - a flight sets no events
                    await asyncio.sleep(0.05)
            await asyncio.sleep(0.3)  # in flight, seconds
            assert not flying.done()
    logged = displayed(caplog)
    assert logged[0] == (
        f"display: cannot listen on 127.0.0.1:{port}: {PORT_IN_USE}; flying on without it, trying again"
    )
    assert [r for r in caplog.records if r.levelname == "WARNING" and "display" in r.getMessage()] == [
        r for r in caplog.records if r.getMessage() == logged[0]
    ][:1]


async def test_the_display_ends_when_the_companion_is_killed(tmp_path: Path) -> None:
    port, link = free_tcp_port(), free_tcp_port()
    config = tmp_path / "companion.yaml"
    config.write_text(
        f"links: [udpin:127.0.0.1:{link}]\nrecording: {{enabled: false}}\n"
        f"state_file: {tmp_path / 'state'}\nweb: {{listen: '127.0.0.1:{port}'}}\n"
    )
    companion = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "companion", "run", str(config), stderr=asyncio.subprocess.PIPE
    )
    at = Site(port, [])
    await until(at, "/healthz", lambda a: a.status == 200)
    assert (await at.ask("/api/state")).json["own"] is None
    companion.kill()
    await companion.communicate()
    async with asyncio.timeout(PATIENCE_S):
        with contextlib.suppress(OSError):
            while True:
                await at.ask("/healthz")
                await asyncio.sleep(0.05)


@pytest.mark.parametrize(
    ("token", "said"),
    [(None, "cannot be read"), ("short\n", "at least 12 characters")],
    ids=["none", "short"],
)
async def test_a_bad_token_fails_the_check_but_not_the_flight(
    token: str | None, said: str, tmp_path: Path
) -> None:
    """A restart in flight must not fail because of a file of the display."""
    config, secret = tmp_path / "companion.yaml", tmp_path / "token"
    if token is not None:
        secret.write_text(token)
    port, link = free_tcp_port(), free_tcp_port()
    config.write_text(
        f"links: [udpin:127.0.0.1:{link}]\nrecording: {{enabled: false}}\n"
        f"state_file: {tmp_path / 'state'}\nsettings_file: {tmp_path / 'settings'}\n"
        f"web: {{token_file: {json.dumps(str(secret))}, listen: '127.0.0.1:{port}'}}\n"
    )
    checking = await started("check", config)
    _, errors = await checking.communicate()
    assert checking.returncode == 2
    (line,) = errors.decode().splitlines()
    assert said in line
    companion = await started("run", config)
    answer = await until(Site(port, []), "/api/info", lambda a: a.status == 200)
    assert answer.json["may_command"] is False
    companion.terminate()
    _, errors = await companion.communicate()
    assert companion.returncode == 0
    assert "the display is read-only" in errors.decode()


async def started(command: str, config: Path) -> Forked:
    return await fork(command, str(config))


async def test_a_display_that_cannot_be_started_is_tried_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def no_memory(*_: object, **__: object) -> None:
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr(asyncio, "create_subprocess_exec", no_memory)
    running = asyncio.create_task(Display(Settings()).run())
    await asyncio.sleep(0.8)
    assert not running.done()
    running.cancel()
    (logged,) = [r.getMessage() for r in caplog.records if r.levelname == "WARNING"]
    assert logged.startswith("display: cannot be started: [Errno 12] Cannot allocate memory; flying on")


async def test_cancelling_while_the_old_process_ends_starts_no_new_one() -> None:
    display = Display(Settings(port=free_tcp_port()))
    running = asyncio.create_task(display.run())
    async with asyncio.timeout(PATIENCE_S):
        while display._pipe is None:  # noqa: ASYNC110 - a process sets no events
            await asyncio.sleep(0.02)
    display._pipe.close()
    await asyncio.sleep(0.01)
    running.cancel()
    async with asyncio.timeout(10.0):
        await asyncio.gather(running, return_exceptions=True)
    assert running.cancelled()


async def test_a_failed_recording_is_shown_in_metrics_and_log(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    config, port, link = tmp_path / "companion.yaml", free_tcp_port(), free_tcp_port()
    config.write_text(
        f"links: [udpin:127.0.0.1:{link}]\nrecording: {{directory: {tmp_path / 'file'}}}\n"
        f"state_file: {tmp_path / 'state'}\nsettings_file: {tmp_path / 'settings'}\n"
        f"web: {{listen: '127.0.0.1:{port}'}}\n"
    )
    companion, at = await started("run", config), Site(port, [])
    await until(at, "/metrics", lambda a: b"companion_recording_failed 1.0" in a.body)
    companion.terminate()
    _, errors = await companion.communicate()
    assert "Not recorded: " in errors.decode()
