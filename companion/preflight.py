"""Queries the autopilot, and reports what was found and whether the aircraft would be taken over."""

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from companion.autopilots import Adapter
from companion.clock import Clock
from companion.config import Config
from companion.engine import Engine
from companion.errors import ungrouped
from companion.links import Link, ReceiverLink
from companion.mavlink.dialect import mavlink
from companion.model import Role, TrafficSource
from companion.runtime import Runtime
from companion.traffic.params import Forward

# Message rates are measured over whole windows of five seconds, which begin when they have been requested.
DEFAULT_SECONDS = 12.0


@dataclass(frozen=True, slots=True)
class Finding:
    """One line: a topic, what was found, and whether that is good."""

    topic: str
    text: str
    good: bool = True


@dataclass(frozen=True, slots=True)
class Preflight:
    """What was found. `reasons_not_to_fly` is empty if the aircraft would be taken over in a conflict."""

    heard: bool
    findings: tuple[Finding, ...]
    reasons_not_to_fly: tuple[str, ...]


async def run_preflight(
    config: Config,
    links: Sequence[Link],
    seconds: float = DEFAULT_SECONDS,
    clock: Clock | None = None,
    *,
    receivers: Sequence[ReceiverLink] = (),
) -> Preflight:
    """Listen and send requests for `seconds`. Nothing is commanded meanwhile, whatever the configured role.

    `CompanionError` if a link can never be opened.
    """
    engine_config = config.for_engine()
    advising = replace(
        engine_config,
        supervisor=replace(engine_config.supervisor, role="advise"),
        traffic=replace(engine_config.traffic, forward="off"),
    )
    engine = Engine(advising)
    engine.operator.at_most = Role.ADVISE
    runtime = Runtime(engine, links, receivers=receivers, clock=clock)
    started_s = runtime.clock.now_us() / 1e6
    with ungrouped():
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(runtime.run(), name="preflight")
            until_us = runtime.clock.now_us() + round(seconds * 1e6)
            await asyncio.sleep(runtime.clock.wall_seconds_until(until_us))
            now_s = runtime.clock.now_us() / 1e6
            wanted = Role[config.supervisor.role.upper()]
            result = Preflight(
                engine.aircraft.adapter is not None,
                (
                    *_findings(runtime, now_s),
                    *_receivers(runtime, now_s, now_s - started_s),
                    *_mavlink_sources(runtime, now_s - started_s),
                    *_forwarding(runtime, config.traffic.forward),
                    Finding("role", wanted.name.lower(), wanted is Role.FLY),
                ),
                tuple(engine.hindrances(now_s, wanted)),
            )
            runtime.stop()
    return result


def _findings(runtime: Runtime, now_s: float) -> Iterator[Finding]:
    engine = runtime.engine
    for link in runtime.links:
        counted = link.counters
        text = f"{counted.frames} frames, {counted.bad_bytes} bad bytes, {counted.lost} lost"
        yield Finding(f"link {link.address}", text, counted.frames > 0)
    aircraft = engine.aircraft
    adapter = aircraft.adapter
    if adapter is None:
        others = sorted(aircraft.identity.others(now_s))
        several = f"several: systems {others}" if others else "none heard"
        yield Finding("autopilot", several, good=False)
        yield from _conditions(engine)
        return
    fixed_wing = aircraft.flight_state.flies_as_wing(aircraft.identity.vehicle_type)
    kind = "fixed wing" if fixed_wing else "not a fixed wing"
    version = aircraft.identity.version or "of unknown version"
    text = f"{adapter.name} {version}, system {adapter.target.system_id}, {kind}"
    yield Finding("autopilot", text, fixed_wing)
    if others := sorted(aircraft.identity.others(now_s)):
        yield Finding("other autopilots", ", ".join(f"system {number}" for number in others))
    armed = "armed" if aircraft.flight_state.armed else "disarmed"
    yield Finding("mode", f"{aircraft.mode}, {armed}{', failsafe' if aircraft.flight_state.failsafe else ''}")
    here, age_s, position = aircraft.kinematics.position, now_s - aircraft.kinematics.position_s, "none"
    if here is not None:
        position = f"{here.height_above_home_m:.0f} m above home, {age_s:.1f} s old"
    yield Finding("position", position, here is not None and age_s < 1.0)
    yield from _rates(engine.rates_hz, adapter)
    mission = engine.queries.mission
    yield Finding("mission", "not read" if mission is None else f"{len(mission.items)} items")
    for limit in engine.queries.limits.sourced:
        yield Finding("limit", str(limit))
    yield from _conditions(engine)
    yield Finding("flown in", adapter.mode_name(adapter.guided_mode))
    yield from _other_avoidance(adapter, engine.queries.parameters)
    offset_s = aircraft.contact.clock_offset_s
    text = "unknown" if offset_s is None else f"{offset_s:+.1f} s from ours"
    yield Finding("autopilot clock", text, offset_s is not None and abs(offset_s) < 5.0)
    tracks = engine.snapshot(now_s).tracks
    yield Finding("traffic", ", ".join(track.track_id for track in tracks) or "none heard")


def _receivers(runtime: Runtime, now_s: float, span_s: float) -> Iterator[Finding]:
    """What each receiver sent, why it is of no use, and what its format lacks."""
    for one in runtime.receivers:
        receiver, problem = one.receiver, one.problem(now_s)
        counted = receiver.counters
        if problem is None and not counted.messages:
            problem = (
                "no message" if not receiver.pieces else "nothing understood: another format or baud rate?"
            )
        text = (
            f"{receiver.title}, {counted.messages / span_s:.1f} messages/s, {counted.reports / span_s:.1f} "
            f"reports/s, {receiver.aircraft(now_s)} aircraft"
        )
        if counted.bad:
            text += f", {counted.bad.total()} bad ({', '.join(sorted(counted.bad))})"
        lacks = f"; lacks {receiver.lacks}" if receiver.lacks else ""
        text += f"{'' if problem is None else f'; {problem}'}{lacks}"
        yield Finding(f"receiver {receiver.address}", text, problem is None)


# What a kind of report by MAVLink cannot say; "" for those that come by other receivers only.
_LACKS = {
    TrafficSource.ADSB: "accuracy; ages are whole seconds",
    TrafficSource.ADSR: "",
    TrafficSource.TISB: "",
    TrafficSource.MLAT: "",
    TrafficSource.MODE_S: "",
    TrafficSource.FLARM: "",
    TrafficSource.REMOTE_ID: "the age of positions, and range",
    TrafficSource.UTM: "the age of positions",
    TrafficSource.SYSTEM: "accuracy",
}


def _mavlink_sources(runtime: Runtime, span_s: float) -> Iterator[Finding]:
    """Who sends traffic by MAVLink, how often, and what that lacks."""
    for (source, sender), count in sorted(runtime.engine.mavlink_sources.items()):
        lacks = f"; lacks {_LACKS[source]}" if _LACKS[source] else ""
        name = f"receiver {source} by MAVLink {sender.system_id}/{sender.component_id}"
        yield Finding(name, f"{count / span_s:.1f} reports/s{lacks}")


def _forwarding(runtime: Runtime, forward: Forward) -> Iterator[Finding]:
    """Where the traffic of receivers would be sent, and why it would be of no use there."""
    adapter, parameters = runtime.engine.aircraft.adapter, runtime.engine.queries.parameters
    if forward == "off" or not runtime.receivers or adapter is None:
        return
    ignored = adapter.ignores_traffic(parameters) if forward == "autopilot" else None
    if not runtime.links_to(forward):
        text, good = f"{forward}: there is no such link to send traffic on", False
    elif ignored is not None:
        text, good = f"{adapter.name} ignores the traffic that we send it ({ignored}): set it to 1", False
    else:
        text, good = f"traffic is sent on to the {forward}", True
    yield Finding("forward", text, good)


def _other_avoidance(adapter: Adapter, parameters: Mapping[str, float]) -> Iterator[Finding]:
    """The autopilot's own avoidance: whether it acts, what to do then, and its settings."""
    other = adapter.other_avoider(parameters)
    acts = f"{other} acts: set it to warn only, or supervisor.beside_other_avoider to fly"
    yield Finding("other avoidance", "not active" if other is None else acts, other is None)
    known = [f"{name} {parameters[name]:.0f}" for name in adapter.traffic_parameters if name in parameters]
    if known:
        yield Finding("traffic settings", ", ".join(known))


def _conditions(engine: Engine) -> Iterator[Finding]:
    """What keeps the aircraft from being flown, or is odd."""
    for condition in engine.conditions:
        yield Finding("condition", condition.text.removeprefix("Avoidance: "), good=False)


def _rates(measured_hz: Mapping[int, float], adapter: Adapter) -> Iterator[Finding]:
    """The rates of the requested messages, if they could be measured."""
    if not measured_hz:
        yield Finding("rates", "not measured: listen longer", good=False)
    for message_id, wanted_s in adapter.intervals_s.items():
        rate_hz = measured_hz.get(message_id)
        if rate_hz is not None:
            name = mavlink.mavlink_map[message_id].msgname
            text = f"{rate_hz:.1f} Hz, {1 / wanted_s:.1f} Hz requested"
            yield Finding(f"rate {name}", text, rate_hz > 0.5 / wanted_s)
