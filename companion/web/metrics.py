"""Metrics for Prometheus, computed from the newest snapshot on request."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.registry import Collector

from companion.load import OVERLOADED
from companion.model import Layer, TrackState, TrafficKind
from companion.traffic import ConcernKind
from companion.web.health import LoopTimes, ReceiverCount
from companion.web.live_snapshot import LiveSnapshot
from companion.web.source import LiveSource

Family = CounterMetricFamily | GaugeMetricFamily | HistogramMetricFamily


class Metrics(Collector):
    """The metrics of one flight; `viewers` returns the number of open streams."""

    def __init__(self, source: LiveSource, viewers: Callable[[], int]) -> None:
        self._source = source
        self._viewers = viewers
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(self)

    def text(self) -> bytes:
        """All metrics in Prometheus' text format."""
        return generate_latest(self._registry)

    def collect(self) -> Iterable[Family]:
        """All metric families; only two before the first snapshot."""
        yield _gauge("up", "1 while the flying loop sends snapshots", float(self._source.is_fresh))
        yield _gauge("viewers", "Browsers that show the display", float(self._viewers()))
        live = self._source.snapshot
        if live is None:
            return
        health, snapshot = live.health, live.snapshot
        bounds = [*map(str, LoopTimes.BOUNDS_S), "+Inf"]
        yield HistogramMetricFamily(
            "companion_tick_seconds",
            "Duration of one tick of the flying loop",
            buckets=list(zip(bounds, map(float, health.ticks_below), strict=True)),
            sum_value=health.ticks_total_s,
        )
        yield _counter("ticks_late", "Ticks made half an interval after their time", health.late_ticks)
        yield _counter("ticks_skipped", "Ticks left out because they were late", health.skipped_ticks)
        for name, help_text, field in (
            ("frames", "MAVLink frames received", "frames"),
            ("frames_lost", "Frames missing by their sequence numbers", "lost"),
            ("bad_bytes", "Bytes that belong to no frame", "bad_bytes"),
            ("link_dropped", "Datagrams that arrived faster than they were processed", "dropped"),
            ("frames_sent", "MAVLink frames sent", "sent_frames"),
            ("send_errors", "Frames that could not be sent", "send_errors"),
        ):
            family = CounterMetricFamily(f"companion_{name}", help_text, labels=["link"])
            for link in health.links:
                family.add_metric([link.address], getattr(link, field))
            yield family
        yield from _of_receivers(health.receivers)
        by_source = CounterMetricFamily(
            "companion_reports", "Reports of traffic by MAVLink, by kind and sender", labels=["source"]
        )
        for source, count in health.mavlink_sources:
            by_source.add_metric([source], float(count))
        yield by_source
        yield _counter("messages_unusable", "Messages without a usable value", health.unusable)
        yield _counter("messages_late", "Messages that arrived too late to be used", health.past)
        yield _counter(
            "messages_of_others", "Messages of another vehicle with a known address", health.of_others
        )
        yield _counter("requests_repeated", "Copies of requests that were obeyed before", health.repeated)
        dropped = "Reports of traffic that came faster than they were processed"
        yield _counter("reports_dropped", dropped, health.dropped_reports)
        yield _counter("reports_forwarded", "Reports of traffic that were sent on", health.forwarded)
        yield _counter("messages_unsent", "Messages not sent, as they were late by a stall", health.unsent)
        yield _counter("setpoints_sent", "Setpoints sent to the autopilot", health.setpoints_sent)
        yield _counter("engagements", "Times the aircraft was taken over", live.engagements)
        yield _counter("command_rejections", "Commands refused or not answered", live.rejections)
        yield _gauge("tracks", "Aircraft and obstacles that are tracked", float(len(snapshot.tracks)))
        yield from _of_traffic(live)
        yield _gauge("threats", "Tracks in conflict", float(len(snapshot.decision.threats)))
        layers = GaugeMetricFamily("companion_layer", "1 for the layer that decides", labels=["layer"])
        for layer in Layer:
            layers.add_metric([str(layer)], float(layer is snapshot.decision.layer))
        yield layers
        yield _gauge("flying", "1 while the companion flies the aircraft", float(live.flying))
        yield _gauge("position_age_seconds", "Age of our own position", live.position_age_s)
        overloaded = any(one.key == OVERLOADED for one in live.conditions)
        yield _gauge("overloaded", "1 while ticks are late or anything is dropped", float(overloaded))
        held = Counter(one.severity for one in live.conditions)
        conditions = GaugeMetricFamily(
            "companion_conditions", "Conditions that hold, by MAV_SEVERITY", labels=["severity"]
        )
        for severity in range(8):
            conditions.add_metric([str(severity)], float(held[severity]))
        yield conditions
        recording = float(health.recording_problem is not None)
        yield _gauge("recording_failed", "1 when data is missing from the record", recording)
        yield _gauge("uptime_seconds", "Time since the service started", health.uptime_s)


def _of_traffic(live: LiveSnapshot) -> Iterator[Family]:
    """How the aircraft are known: by state and by source, and what is not avoided or is odd."""
    aircraft = [track for track in live.snapshot.tracks if track.kind is not TrafficKind.OBSTACLE]
    states = Counter(track.state for track in aircraft)
    by_state = GaugeMetricFamily("companion_aircraft", "Aircraft tracked, by state", labels=["state"])
    for state in (TrackState.TENTATIVE, TrackState.CONFIRMED, TrackState.COASTED):
        by_state.add_metric([str(state)], float(states[state]))
    sources = Counter(source for track in aircraft for source in track.sources)
    by_source = GaugeMetricFamily(
        "companion_aircraft_by_source", "Aircraft that a source reports", labels=["source"]
    )
    for source in sorted(sources):
        by_source.add_metric([source], float(sources[source]))
    kinds = Counter(concern.kind for concern in live.concerns)
    concerns = GaugeMetricFamily(
        "companion_traffic_concerns", "Aircraft not avoided or odd, at most three of a kind", labels=["kind"]
    )
    for kind in ConcernKind:
        concerns.add_metric([str(kind)], float(kinds[kind]))
    yield from (by_state, by_source, concerns)


def _of_receivers(receivers: Iterable[ReceiverCount]) -> Iterator[Family]:
    """The metrics of the receivers that do not speak MAVLink, by their addresses."""
    bad = CounterMetricFamily(
        "companion_receiver_bad", "What was not understood, by reason", labels=["receiver", "reason"]
    )
    failed = GaugeMetricFamily(
        "companion_receiver_failed", "1 while it is down, silent or reports a problem", labels=["receiver"]
    )
    kinds: tuple[tuple[type[CounterMetricFamily | GaugeMetricFamily], str, str, str], ...] = (
        (CounterMetricFamily, "messages", "Whole messages of the receiver", "messages"),
        (CounterMetricFamily, "reports", "Reports of aircraft", "reports"),
        (CounterMetricFamily, "dropped", "Pieces that arrived faster than they were processed", "dropped"),
        (GaugeMetricFamily, "aircraft", "Aircraft heard in the last minute", "aircraft"),
        (GaugeMetricFamily, "silent_seconds", "Time since the last message", "silent_s"),
    )
    families = [
        (kind(f"companion_receiver_{name}", text, labels=["receiver"]), field)
        for kind, name, text, field in kinds
    ]
    for one in receivers:
        for family, field in families:
            family.add_metric([one.address], float(getattr(one, field)))
        for reason, count in one.bad:
            bad.add_metric([one.address, reason], float(count))
        failed.add_metric([one.address], float(one.problem is not None))
    yield from (family for family, _ in families)
    yield from (bad, failed)


def _gauge(name: str, help_text: str, value: float) -> GaugeMetricFamily:
    return GaugeMetricFamily(f"companion_{name}", help_text, value=value)


def _counter(name: str, help_text: str, value: float) -> CounterMetricFamily:
    return CounterMetricFamily(f"companion_{name}", help_text, value=value)
