"""The lines that the log ends with: what each link and receiver carried, and what was dropped."""

from collections.abc import Iterator, Sequence

from companion.engine import Engine
from companion.links import Link, ReceiverLink
from companion.web.health import Health


def summary(
    links: Sequence[Link], receivers: Sequence[ReceiverLink], health: Health, engine: Engine
) -> Iterator[str]:
    """One line for each link and receiver, and one for what was dropped later."""
    for link in links:
        heard = link.counters
        yield (
            f"{link.address}: {heard.frames} frames in ({heard.bad_bytes} bad bytes, {heard.lost} lost, "
            f"{heard.unknown} unknown, {heard.dropped} datagrams dropped), "
            f"{heard.sent_frames} out ({heard.send_errors} errors)"
        )
    for one in receivers:
        counted = one.receiver.counters
        bad = "".join(f", {count} {why}" for why, count in sorted(counted.bad.items())) or ", none bad"
        yield (
            f"{one.receiver.address}: {counted.messages} messages, {counted.reports} reports{bad}, "
            f"{one.link.counters.dropped} pieces dropped"
        )
    yield (
        f"{health.unusable} unusable messages, {health.past} too late, {health.of_others} of another vehicle "
        f"with a known address, {engine.foreign} from others, {health.repeated} copies of requests ignored, "
        f"{engine.tracker.dropped.total()} traffic reports refused, {health.dropped_reports} dropped, "
        f"{health.forwarded} sent on, "
        f"{health.unsent} messages not sent after a stall, {health.late_ticks} ticks late, "
        f"{health.skipped_ticks} skipped"
    )
