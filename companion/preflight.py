"""What there is at the other end of the links, and whether it would be flown: asked, never commanded."""

import asyncio
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from companion.config import Config
from companion.engine import Engine
from companion.links import Link
from companion.mavlink.dialect import mavlink
from companion.runtime import Runtime
from companion.supervisor import Role

# The rates are those of whole windows of five seconds, after the autopilot was adopted and asked for them.
DEFAULT_SECONDS = 12.0


@dataclass(frozen=True, slots=True)
class Finding:
    """One line: what it is about, what was found, and whether that is as it should be."""

    topic: str
    words: str
    good: bool = True


@dataclass(frozen=True, slots=True)
class Preflight:
    """All that was found. `hindrances` are the reasons why it would not be flown now."""

    heard: bool
    findings: tuple[Finding, ...]
    hindrances: tuple[str, ...]


async def look(config: Config, links: Sequence[Link], seconds: float = DEFAULT_SECONDS) -> Preflight:
    """Listen and ask for so long. Whatever the configuration says, nothing is commanded meanwhile."""
    engine_config = config.for_engine()
    advising = replace(engine_config, supervisor=replace(engine_config.supervisor, role="advise"))
    engine = Engine(advising)
    engine.operator.at_most = Role.ADVISE
    runtime = Runtime(engine, links)
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(runtime.run(), name="preflight")
        await asyncio.sleep(seconds)
        now_s = runtime.clock.now_us() / 1e6
        wanted = Role[config.supervisor.role.upper()]
        result = Preflight(
            engine.aircraft.adapter is not None,
            tuple(_findings(runtime, now_s)),
            tuple(engine.readiness.hindrances(now_s, role=wanted)),
        )
        runtime.stop()
    return result


def _findings(runtime: Runtime, now_s: float) -> Iterator[Finding]:
    engine = runtime.engine
    for link in runtime.links:
        counted = link.counters
        words = f"{counted.frames} frames, {counted.bad_bytes} bad bytes, {counted.lost} lost"
        yield Finding(f"link {link.address}", words, counted.frames > 0)
    aircraft = engine.aircraft
    adapter = aircraft.adapter
    if adapter is None:
        several = f"several: systems {sorted(aircraft.others)}" if aircraft.others else "none heard"
        yield Finding("autopilot", several, good=False)
        return
    kind = "fixed wing" if aircraft.fixed_wing else "no fixed wing"
    version = aircraft.version or "of unknown version"
    words = f"{adapter.name} {version}, system {adapter.target.system_id}, {kind}"
    yield Finding("autopilot", words, aircraft.fixed_wing)
    if aircraft.others:
        yield Finding("other autopilots", ", ".join(f"system {number}" for number in sorted(aircraft.others)))
    armed = "armed" if aircraft.armed else "disarmed"
    yield Finding("mode", f"{aircraft.mode}, {armed}{', failsafe' if aircraft.failsafe else ''}")
    age_s = now_s - aircraft.position_s
    position = "none" if aircraft.position is None else f"{age_s:.1f} s old"
    yield Finding("position", position, aircraft.position is not None and age_s < 1.0)
    for message_id, wanted_s in adapter.intervals_s.items():
        rate_hz = engine.rates_hz.get(message_id)
        if rate_hz is not None:
            name = mavlink.mavlink_map[message_id].msgname
            yield Finding(f"rate {name}", f"{rate_hz:.1f} Hz of {1 / wanted_s:.1f}", rate_hz > 0.5 / wanted_s)
    for taken in engine.onboard.limits.taken:
        yield Finding("limit", str(taken))
    for doubt in (*engine.onboard.limits.doubts, *adapter.advice(engine.onboard.parameters)):
        yield Finding("set otherwise", doubt, good=False)
    other = adapter.other_avoider(engine.onboard.parameters)
    yield Finding("second avoider", other or "none acts", other is None)
    offset_s = aircraft.clock_offset_s
    words = "unknown" if offset_s is None else f"{offset_s:+.1f} s from ours"
    yield Finding("its clock", words, offset_s is not None and abs(offset_s) < 5.0)
    tracks = engine.snapshot(now_s).tracks
    yield Finding("traffic", ", ".join(track.track_id for track in tracks) or "none heard")
