"""Mode requests are repeated on fresh heartbeats, at growing intervals, and never against the heartbeat."""

from companion.control.mode_request import ModeRequest, Progress

AUTO, GUIDED, FBWA = 10, 15, 5


def sent(request: ModeRequest, mode: int, heartbeats_s: list[float], until_s: float) -> list[float]:
    """Times at which the request is sent; it is checked every tenth of a second."""
    times = []
    for tenth in range(round(until_s * 10) + 1):
        now_s = tenth / 10
        heartbeat_s = max((at for at in heartbeats_s if at <= now_s), default=-1.0)
        if request.due(mode, heartbeat_s, now_s):
            times.append(now_s)
    return times


def test_a_request_is_repeated_while_heartbeats_show_the_old_mode() -> None:
    request = ModeRequest(AUTO, GUIDED, 0.0)
    assert sent(request, AUTO, [n / 5 for n in range(20)], 2.0) == [0.0, 1.0, 2.0]


def test_without_heartbeats_a_request_is_not_repeated() -> None:
    assert len(sent(ModeRequest(AUTO, GUIDED, 0.0), AUTO, [0.0], 60.0)) == 1
    assert len(sent(ModeRequest(GUIDED, AUTO, 0.0), GUIDED, [0.0], 60.0)) == 1


def test_without_a_fresh_heartbeat_a_request_is_not_sent_at_all() -> None:
    assert sent(ModeRequest(GUIDED, AUTO, 10.0), GUIDED, [8.4], 60.0) == []


def test_an_accepted_request_is_not_repeated_for_three_seconds() -> None:
    request = ModeRequest(GUIDED, AUTO, 0.0)
    assert request.due(GUIDED, 0.0, 0.0)
    request.accepted(0.2)
    assert sent(request, GUIDED, [n / 5 for n in range(16)], 3.1) == []


def test_nothing_is_sent_while_the_heartbeat_shows_a_third_mode() -> None:
    assert sent(ModeRequest(GUIDED, AUTO, 0.0), FBWA, [0.0, 0.2, 0.4], 10.0) == []


def test_progress_follows_the_heartbeats_since_the_request() -> None:
    request = ModeRequest(AUTO, GUIDED, 10.0)
    assert request.progress(FBWA, 9.9) is Progress.WAITING, "older than the request"
    assert request.progress(AUTO, 10.1) is Progress.WAITING
    assert request.progress(GUIDED, 10.2) is Progress.CONFIRMED
    assert request.progress(FBWA, 10.2) is Progress.OVERRULED


def test_the_wanted_mode_seen_too_soon_does_not_count() -> None:
    request = ModeRequest(GUIDED, AUTO, 10.0, settle_s=1.0)
    assert request.progress(AUTO, 10.5) is Progress.WAITING
    assert request.progress(AUTO, 11.1) is Progress.CONFIRMED


def test_a_postponed_request_is_repeated_with_the_next_heartbeat() -> None:
    request = ModeRequest(10, 15, 0.0)
    assert request.due(10, 0.0, 0.0)
    request.postponed(0.1)
    assert not request.due(10, 0.3, 0.3)
    assert not request.due(10, 0.0, 0.6), "no heartbeat since the last try"
    assert request.due(10, 0.3, 0.6)
    assert (request.refusals, request.postponements) == (0, 1)


def test_the_wait_grows_with_each_refusal() -> None:
    request = ModeRequest(GUIDED, AUTO, 0.0)
    heartbeats = [n / 5 for n in range(500)]
    times = []
    for tenth in range(300):
        now_s = tenth / 10
        if request.due(GUIDED, max(at for at in heartbeats if at <= now_s), now_s):
            times.append(now_s)
            request.refused(now_s)
    assert times[:3] == [0.0, 1.0, 3.0]
    assert len(times) <= 9
