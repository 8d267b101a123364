"""Figures for Prometheus, made from the newest moment when they are asked for."""

from collections.abc import Callable, Iterable

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.registry import Collector

from companion.model import Layer
from companion.web.loop_times import LoopTimes
from companion.web.source import Live

Family = CounterMetricFamily | GaugeMetricFamily | HistogramMetricFamily


class Metrics(Collector):
    """The metrics of one flight; `viewers` counts who is looking."""

    def __init__(self, source: Live, viewers: Callable[[], int]) -> None:
        self._source = source
        self._viewers = viewers
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(self)

    def text(self) -> bytes:
        """In Prometheus' text format."""
        return generate_latest(self._registry)

    def collect(self) -> Iterable[Family]:
        """All families; few of them while nothing is known."""
        yield _gauge("up", "1 while the flying loop tells what it does", float(self._source.is_fresh))
        yield _gauge("viewers", "Browsers that look at the display", float(self._viewers()))
        moment = self._source.moment
        if moment is None:
            return
        health, shot = moment.health, moment.snapshot
        bounds = [*map(str, LoopTimes.BOUNDS_S), "+Inf"]
        yield HistogramMetricFamily(
            "companion_tick_seconds",
            "How long one tick of the flying loop takes",
            buckets=list(zip(bounds, map(float, health.ticks_below), strict=True)),
            sum_value=health.ticks_total_s,
        )
        yield _counter("ticks_skipped", "Ticks left out as they came too late", health.skipped_ticks)
        for name, words, field in (
            ("frames", "MAVLink frames that came in", "frames"),
            ("frames_lost", "Frames missing in the sequence numbers", "lost"),
            ("bad_bytes", "Bytes that belong to no frame", "bad_bytes"),
            ("frames_sent", "MAVLink frames that went out", "sent_frames"),
            ("send_errors", "Frames that did not go out", "send_errors"),
        ):
            family = CounterMetricFamily(f"companion_{name}", words, labels=["link"])
            for link in health.links:
                family.add_metric([link.address], getattr(link, field))
            yield family
        yield _counter("messages_unusable", "Messages of which nothing could be believed", health.unusable)
        yield _counter("setpoints_sent", "Setpoints sent to the autopilot", health.setpoints_sent)
        yield _counter("engagements", "How often the aircraft was taken over", moment.engagements)
        yield _counter("command_rejections", "Commands refused or not answered", moment.rejections)
        yield _gauge("tracks", "Other aircraft and obstacles that are tracked", float(len(shot.tracks)))
        yield _gauge("threats", "Tracks that take part in a conflict", float(len(shot.decision.threats)))
        layers = GaugeMetricFamily("companion_layer", "1 for the layer that decides", labels=["layer"])
        for layer in Layer:
            layers.add_metric([str(layer)], float(layer is shot.decision.layer))
        yield layers
        yield _gauge("flying", "1 while the companion flies the aircraft", float(moment.flying))
        yield _gauge("position_age_seconds", "Age of the own position", moment.position_age_s)
        recording = float(health.recording_problem is not None)
        yield _gauge("recording_failed", "1 when something is missing from the record", recording)
        yield _gauge("uptime_seconds", "Since the service was started", health.uptime_s)


def _gauge(name: str, words: str, value: float) -> GaugeMetricFamily:
    return GaugeMetricFamily(f"companion_{name}", words, value=value)


def _counter(name: str, words: str, value: float) -> CounterMetricFamily:
    return CounterMetricFamily(f"companion_{name}", words, value=value)
