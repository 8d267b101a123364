"""Measures the budgets: time of a decision, latency from datagram to setpoint, and replay speed.

The figures are percentiles of one run on one machine; they are not checked against limits.
"""

import asyncio
import contextlib
import math
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from companion.avoidance import AvoidanceParams, Avoider
from companion.engine import Engine, EngineConfig, EngineParams
from companion.links import memory_pair
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.facts import Sender
from companion.mavlink.tlog import TlogWriter, read_tlog
from companion.mavlink.translate import WANTED, frame_to_fact
from companion.model import Goal, Ownship, Track
from companion.replay import replay
from companion.runtime import Runtime
from sim.closed_loop import ClosedLoop
from sim.formation.crossing import crossing
from sim.formation.engines import COMPANION
from sim.formation.flight import Conditions, fly
from sim.formation.radio import RadioQuality
from sim.scenario import load_scenario

TRACK_COUNTS = (1, 10, 50, 100, 1000)
_OTHERS_PER_S = 500
_MEMBERS = 10
# Until the members turn for each other; the whole flight takes a minute.
_FORMATION_S = 30.0
# Length of the log that is replayed [steps of 0.05 s], and how often it is.
_LOG_STEPS, _REPLAYS = 2400, 3
_AUTOPILOT = Sender(1, 1)
_HOME_LAT_DEG, _HOME_LON_DEG = -35.36, 149.16
_M_PER_DEG = 111_000.0


def run(on_progress: Callable[[str], None] = lambda _: None) -> dict[str, Any]:
    """All measurements, by the keys of the report."""
    decide_ms = {}
    for count in TRACK_COUNTS:
        on_progress(f"decisions among {count}")
        decide_ms[str(count)] = _percentiles(_decide_ms(count))
    on_progress("datagram in to setpoint out")
    wire_ms = _percentiles(asyncio.run(_wire_latency_ms()))
    on_progress("a formation")
    formation_ms = {str(_MEMBERS): _percentiles(_formation_ms())}
    on_progress("replay")
    return {
        "decide_ms": decide_ms,
        "formation_ms": formation_ms,
        "wire_latency_ms": wire_ms,
        **_replay_rates(),
    }


def _percentiles(values_ms: Sequence[float]) -> dict[str, float]:
    p50, p99 = np.percentile(values_ms, [50, 99])
    return {"p50": round(float(p50), 3), "p99": round(float(p99), 3)}


def _decide_ms(count: int, decisions: int = 300) -> list[float]:
    """Decision times [ms] with all aircraft on collision courses, from all sides, at different times."""
    avoider = Avoider(AvoidanceParams())
    goal = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
    times_ms = []
    for tick in range(decisions):
        now_s = tick / 10
        own = Ownship(now_s, (22.0 * now_s, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
        tracks = [_collider(number, now_s) for number in range(count)]
        started_s = time.perf_counter()
        avoider.decide(now_s, own, tracks, goal)
        times_ms.append(1e3 * (time.perf_counter() - started_s))
    return times_ms


def _formation_ms() -> list[float]:
    """Times [ms] of the ticks of all members of a formation that will meet; its radio has loss and delay."""
    meeting = crossing(_MEMBERS, seed=1, number=0, separation_m=50.0)
    conditions = Conditions(RadioQuality(loss=0.3, delay_s=0.3), ends_s=_FORMATION_S)
    return fly(meeting, COMPANION, conditions).decision_ms


def _collider(number: int, now_s: float) -> Track:
    # The golden angle spreads the directions evenly for any count.
    course_rad, speed_mps, meet_s = 2.399_963 * number, 20.0 + number * 7 % 70, 40.0 + number * 11 % 35
    velocity = (-speed_mps * math.cos(course_rad), -speed_mps * math.sin(course_rad), 0.0)
    left_s = now_s - meet_s
    position = (22.0 * meet_s + velocity[0] * left_s, velocity[1] * left_s, -300.0)
    return Track(f"{number:06X}", now_s, position, velocity)


async def _wire_latency_ms(seconds: float = 12.0) -> list[float]:
    """Latencies [ms] of the service avoiding one intruder, with 500 other messages a second."""
    near, far = memory_pair()
    engine = Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1)))
    runtime = Runtime(engine, [near])
    running = asyncio.create_task(runtime.run())
    encoder, started_s = Encoder(), time.monotonic()
    north_m, next_report_s = 0.0, 0.0
    with contextlib.closing(far):
        while (elapsed_s := time.monotonic() - started_s) < seconds:
            north_m = 22.0 * elapsed_s
            guided = engine.supervisor.state in ("engaging", "outer", "inner")
            far.send(_packed(encoder, _position(north_m, elapsed_s)))
            far.send(_packed(encoder, _heartbeat(15 if guided else 10)))
            for _ in range(_OTHERS_PER_S // 50 - 2):
                far.send(_packed(encoder, mavlink.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0)))
            if elapsed_s >= next_report_s:
                next_report_s += 0.2
                far.send(_packed(encoder, _report(60.0 * (30.0 - elapsed_s) + 22.0 * 30.0)))
            await asyncio.sleep(0.02)
        runtime.stop()
        for _ in range(100):
            far.send(_packed(encoder, _heartbeat(10)))
            if running.done():
                break
            await asyncio.sleep(0.05)
    await running
    return [1e3 * latency_s for latency_s in runtime.latencies_s] or [math.nan]


def _packed(encoder: Encoder, message: Any) -> bytes:
    return encoder.encode(message, _AUTOPILOT.system_id, _AUTOPILOT.component_id)


def _heartbeat(mode: int) -> Any:
    return mavlink.MAVLink_heartbeat_message(1, 3, 217, mode, 4, 3)


def _position(north_m: float, elapsed_s: float) -> Any:
    lat = round((_HOME_LAT_DEG + north_m / _M_PER_DEG) * 1e7)
    boot_ms = round(elapsed_s * 1e3)
    return mavlink.MAVLink_global_position_int_message(
        boot_ms, lat, round(_HOME_LON_DEG * 1e7), 884_000, 300_000, 2200, 0, 0, 0
    )


def _report(north_m: float) -> Any:
    lat = round((_HOME_LAT_DEG + north_m / _M_PER_DEG) * 1e7)
    lon = round(_HOME_LON_DEG * 1e7)
    return mavlink.MAVLink_adsb_vehicle_message(
        0xA00001, lat, lon, 1, 884_000, 18_000, 6_000, 0, b"BENCH", 1, 0, 0b1000_1111, 1200
    )


def _replay_rates() -> dict[str, Any]:
    """Messages a second of one log: the engine, our reader and pymavlink's reader."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "bench.tlog"
        _write_log(log)
        ours = max(replay(log, Engine()).messages_per_s for _ in range(_REPLAYS))
        reading = max(_reading_rate(log) for _ in range(_REPLAYS))
        theirs = max(_pymavlink_rate(log) for _ in range(_REPLAYS))
    return {
        "read_messages_per_s": round(reading),
        "replay_messages_per_s": round(ours),
        "pymavlink_messages_per_s": round(theirs),
        "replay_ratio": round(ours / theirs, 1),
        "read_ratio": round(reading / theirs, 1),
    }


def _write_log(log: Path) -> None:
    """Write a flight without conflict, with the messages of a busy link."""
    loop, writer, encoder = ClosedLoop(load_scenario("clear"), None), TlogWriter(log), Encoder()
    vehicle = loop.world.vehicle
    for message_id in (30, 33, 74, 62, 1, 24, 116, 147):
        vehicle.receive(
            mavlink.MAVLink_command_long_message(1, 1, 511, 0, message_id, 10_000, 0, 0, 0, 0, 0),
            loop.start_us / 1e6,
            0,
        )
    for tick in range(1, _LOG_STEPS):
        now_us = loop.start_us + tick * 50_000
        for outgoing in vehicle.step(now_us / 1e6):
            writer.write(now_us, encoder.encode(outgoing.message, 1, 1))
    writer.close()


def _reading_rate(log: Path) -> float:
    """Messages a second of our reader and the translation to facts."""
    started_s = time.perf_counter()
    records = read_tlog(log, only=WANTED)
    for time_us, frame in records:
        frame_to_fact(frame, time_us / 1e6)
    return records.messages / (time.perf_counter() - started_s)


def _pymavlink_rate(log: Path) -> float:
    from pymavlink import mavutil

    started_s = time.perf_counter()
    count = sum(1 for _ in _messages(mavutil.mavlink_connection(os.fspath(log), dialect="ardupilotmega")))
    return count / (time.perf_counter() - started_s)


def _messages(connection: Any) -> Iterator[Any]:
    with contextlib.closing(connection):
        while (message := connection.recv_match(blocking=False)) is not None:
            yield message
