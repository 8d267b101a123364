"""What is requested from the autopilot, and what is stored and announced of its answers."""

import itertools

import pytest

from companion.airspace.fences import FenceZone
from companion.autopilots import Adapter, ArduPlane, Px4FixedWing
from companion.avoidance import Envelope, Fence
from companion.engine import AircraftLimits
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Sender
from companion.ownship.autopilot_queries import UNANSWERED, AutopilotQueries
from tests.support.responder import AUTOPILOT, FENCE, GCS, MISSION, US, Item, Line, Responder, as_fact

PARAMETERS = {
    "AIRSPEED_MIN": 12.0,
    "AIRSPEED_MAX": 30.0,
    "AIRSPEED_CRUISE": 20.0,
    "ROLL_LIMIT_DEG": 45.0,
    "TECS_CLMB_MAX": 5.0,
    "TECS_SINK_MAX": 5.0,
    "WP_LOITER_RAD": 60.0,
    "AVD_ENABLE": 0.0,
    "FENCE_ENABLE": 1.0,
    "FENCE_TYPE": 4.0,
    "MIS_TOTAL": 4.0,
}
ROUTE = [
    Item(16, (47.0, 8.0), 500.0, frame=0),
    Item(22, height_m=50.0),
    Item(16, (47.01, 8.0), 100.0),
    Item(16, (47.02, 8.0), 100.0),
]
SQUARE = ((46.9, 7.9), (46.9, 8.1), (47.1, 8.1), (47.1, 7.9))
ZONES = [Item(5001, corner, params=(4.0, 0.0, 0.0, 0.0)) for corner in SQUARE]
ZONES.append(Item(5004, (47.01, 8.01), params=(300.0, 0.0, 0.0, 0.0)))


class Talk:
    """`AutopilotQueries`, a responder, and the line between them."""

    def __init__(
        self,
        responder: Responder,
        adapter: Adapter | None = None,
        *,
        line: Line | None = None,
        configured: AircraftLimits | None = None,
        zones: tuple[FenceZone, ...] = (),
    ) -> None:
        self.responder = responder
        self.adapter = adapter or ArduPlane(AUTOPILOT)
        self.queries = AutopilotQueries(Envelope(), configured or AircraftLimits(), zones)
        self.line = line or Line()
        self.now_s = 1000.0
        self.sent: list[tuple[float, Message]] = []
        self.announced: list[str] = []

    def receive(self, message: Message, sender: object = AUTOPILOT) -> None:
        fact = as_fact(message, sender)  # type: ignore[arg-type]
        assert fact is not None
        self.queries.observe(fact, self.adapter, US, self.now_s)

    def run(self, seconds: float) -> "Talk":
        for _ in range(round(seconds * 10)):
            self.now_s = round(self.now_s + 0.1, 1)
            for message in self.line.take(self.now_s):
                self.receive(message)
            messages, notices = self.queries.tick(self.adapter, self.now_s)
            self.announced += [notice.text for notice in notices]
            for message in messages:
                self.sent.append((self.now_s, message))
                for answer in self.responder.answer(message):
                    self.line.put(answer, self.now_s)
        return self

    def requests(self, kind: str) -> list[Message]:
        return [message for _, message in self.sent if message.get_type() == kind]

    def requested_names(self) -> list[str]:
        return [str(message.param_id) for message in self.requests("PARAM_REQUEST_READ")]


FRAME = LocalFrame(47.0, 8.0)


def local_fence(talk: Talk, frame: LocalFrame = FRAME) -> Fence:
    fence = talk.queries.local_fence(frame, 500.0)
    assert fence is not None
    return fence


def complete() -> Responder:
    return Responder(dict(PARAMETERS), {MISSION: ROUTE, FENCE: ZONES})


def test_everything_is_known_within_20_seconds() -> None:
    talk = Talk(complete()).run(2.0)
    queries = talk.queries
    assert not queries.complete
    talk.run(18.0)
    assert queries.complete
    assert queries.parameters == PARAMETERS
    assert queries.limits.envelope.max_airspeed_mps == 30.0
    assert queries.mission is not None
    assert [item.command for item in queries.mission.items] == [16, 22, 16, 16]
    assert queries.mission.items[3].lat_deg == pytest.approx(47.02)
    fence = local_fence(talk)
    assert [(zone.inclusion, len(zone.vertices_m), zone.radius_m) for zone in fence.zones] == [
        (True, 4, None),
        (False, 0, 300.0),
    ]
    assert queries.local_fence(LocalFrame(47.0, 8.0), 500.0) == fence
    assert local_fence(talk, LocalFrame(47.0, 8.1)) != fence


def test_at_most_five_messages_a_second_and_none_without_need() -> None:
    talk = Talk(complete()).run(120.0)
    times_s = [sent_s for sent_s, _ in talk.sent]
    assert all(later - sooner >= 0.199 for sooner, later in itertools.pairwise(times_s))
    assert len(talk.requests("MISSION_REQUEST_LIST")) == 2
    assert len(talk.requests("MISSION_REQUEST_INT")) == len(ROUTE) + len(ZONES)
    names = talk.requested_names()
    assert names.count("ROLL_LIMIT_DEG") <= 3, "once, and rarely to see whether it changed"


def test_limits_and_their_sources_are_announced_once_for_each_set_of_values() -> None:
    configured = AircraftLimits(max_climb_mps=2.5)
    talk = Talk(complete(), configured=configured).run(60.0)
    lines = [text for text in talk.announced if text.startswith("Aircraft: ")]
    assert (
        "max bank 45 deg (ROLL_LIMIT_DEG), max climb 2.5 m/s (configured; 0.9 TECS_CLMB_MAX 4.5)" in lines[-1]
    )
    assert len(lines) <= 2
    talk.responder.parameters["ROLL_LIMIT_DEG"] = 35.0
    talk.receive(talk.responder.parameter("ROLL_LIMIT_DEG"))
    talk.run(10.0)
    more = [text for text in talk.announced if text.startswith("Aircraft: ")][len(lines) :]
    assert len(more) == 1
    assert "max bank 35 deg" in more[0]


def test_a_reported_change_counts_at_once_and_a_missed_one_is_found() -> None:
    talk = Talk(complete()).run(20.0)
    talk.responder.parameters["AIRSPEED_MAX"] = 24.0
    talk.receive(talk.responder.parameter("AIRSPEED_MAX"))
    assert talk.queries.limits.envelope.max_airspeed_mps == 24.0
    talk.responder.parameters["AIRSPEED_MAX"] = 26.0
    talk.run(240.0)
    assert talk.queries.limits.envelope.max_airspeed_mps == 26.0


def test_old_parameter_names_are_found() -> None:
    old = {"ARSPD_FBW_MIN": 12.0, "ARSPD_FBW_MAX": 30.0, "TRIM_ARSPD_CM": 2000.0, "LIM_ROLL_CD": 4000.0}
    talk = Talk(Responder(dict(old))).run(60.0)
    assert talk.queries.parameters == old
    sources = {limit.quantity: limit.source for limit in talk.queries.limits.sourced}
    assert sources["max bank"] == "LIM_ROLL_CD"
    assert sources["max climb"] == "assumed"


def test_unanswered_requests_are_given_up_until_a_restart() -> None:
    talk = Talk(Responder({}, {})).run(600.0)
    assert talk.requested_names().count("TECS_CLMB_MAX") == 12
    assert talk.queries.limits.envelope == Envelope()
    last_s = max(s for s, m in talk.sent if m.get_type() == "PARAM_REQUEST_READ")
    assert last_s < 1000.0 + 400.0
    talk.responder.parameters.update(PARAMETERS)
    talk.queries.restart()
    talk.run(20.0)
    assert talk.queries.limits.envelope.max_airspeed_mps == 30.0


def test_an_implausible_value_is_a_warning_and_the_assumed_limit_applies() -> None:
    responder = complete()
    responder.parameters["ROLL_LIMIT_DEG"] = 0.0
    talk = Talk(responder).run(60.0)
    assert talk.queries.limits.envelope.max_bank_rad == Envelope().max_bank_rad
    assert list(talk.queries.limits.warnings) == ["ROLL_LIMIT_DEG 0 implausible, not used"]


def test_px4_is_queried_by_its_own_names() -> None:
    values = {"FW_AIRSPD_MIN": 12.0, "FW_AIRSPD_MAX": 25.0, "FW_R_LIM": 50.0, "GF_ACTION": 0.0}
    talk = Talk(Responder(values, {MISSION: (), FENCE: ZONES}), Px4FixedWing(AUTOPILOT)).run(20.0)
    assert talk.queries.limits.envelope.max_airspeed_mps == 25.0
    assert "ROLL_LIMIT_DEG" not in talk.requested_names()
    assert talk.queries.local_fence(LocalFrame(47.0, 8.0), 500.0) is None, "switched off"


# --- lists


def test_a_list_that_the_autopilot_does_not_support_is_requested_once() -> None:
    responder = complete()
    del responder.lists[FENCE]
    talk = Talk(responder).run(250.0)
    fences = [m for m in talk.requests("MISSION_REQUEST_LIST") if m.mission_type == FENCE]
    assert len(fences) == 1


def test_lists_are_read_again_every_few_minutes() -> None:
    talk = Talk(complete()).run(20.0)
    talk.responder.lists[MISSION] = [*ROUTE[:3], Item(16, (47.5, 8.0), 100.0)]
    talk.run(320.0)
    assert talk.queries.mission is not None
    assert talk.queries.mission.items[3].lat_deg == pytest.approx(47.5)


def current(total: int) -> Message:
    return mavlink.MAVLink_mission_current_message(1, total)


def test_a_new_number_of_items_drops_the_mission_and_reads_it_again() -> None:
    talk = Talk(complete())
    talk.receive(current(3))
    talk.run(20.0)
    talk.responder.lists[MISSION] = ROUTE[:2]
    talk.receive(current(1))
    talk.run(0.1)
    assert talk.queries.mission is None, "its item numbers have another meaning now"
    talk.run(5.0)
    assert talk.queries.mission is not None
    assert len(talk.queries.mission.items) == 2


def test_a_changed_total_parameter_reads_its_list_again() -> None:
    responder = complete()
    responder.parameters["FENCE_TOTAL"] = 5.0
    talk = Talk(responder).run(20.0)
    responder.lists[FENCE] = ZONES[:4]
    responder.parameters["FENCE_TOTAL"] = 4.0
    talk.receive(responder.parameter("FENCE_TOTAL"))
    talk.run(5.0)
    assert len(local_fence(talk).zones) == 1


def test_a_ground_stations_upload_is_read_after_it_has_ended() -> None:
    talk = Talk(complete()).run(20.0)
    before = len(talk.sent)
    talk.responder.lists[MISSION] = ROUTE[:3]
    talk.receive(mavlink.MAVLink_mission_count_message(1, 1, 3, MISSION), GCS)
    for sequence in range(3):
        talk.receive(mavlink.MAVLink_mission_request_message(255, 190, sequence, MISSION))
        talk.run(2.0)
    assert not [m for _, m in talk.sent[before:] if m.get_type().startswith("MISSION")]
    talk.receive(mavlink.MAVLink_mission_ack_message(255, 190, 0, MISSION))
    talk.run(2.0)
    assert not [m for _, m in talk.sent[before:] if m.get_type().startswith("MISSION")]
    talk.run(5.0)
    assert talk.queries.mission is not None
    assert len(talk.queries.mission.items) == 3


def test_our_download_is_cancelled_for_a_ground_stations_transfer() -> None:
    responder = Responder({}, {MISSION: ROUTE * 10, FENCE: ()})
    talk = Talk(responder).run(7.0)
    assert talk.requests("MISSION_REQUEST_INT")
    talk.receive(mavlink.MAVLink_mission_request_list_message(1, 1, MISSION), GCS)
    before = len(talk.requests("MISSION_REQUEST_INT"))
    talk.run(2.5)
    assert len(talk.requests("MISSION_REQUEST_INT")) == before
    assert [ack.type for ack in talk.requests("MISSION_ACK")] == [mavlink.MAV_MISSION_OPERATION_CANCELLED]
    talk.run(40.0)
    assert talk.queries.mission is not None
    assert len(talk.queries.mission.items) == 40


def test_mission_messages_of_another_aircraft_are_ignored() -> None:
    talk = Talk(complete())
    for _ in range(100):
        talk.run(0.2)
        talk.receive(mavlink.MAVLink_mission_request_list_message(7, 1, MISSION), GCS)
    assert talk.queries.mission is not None


def test_a_list_that_shrinks_during_the_download_is_read_from_its_start() -> None:
    talk = Talk(Responder({}, {MISSION: ROUTE * 10, FENCE: ()})).run(7.0)
    talk.responder.lists[MISSION] = ZONES[:2]
    talk.run(20.0)
    assert talk.queries.mission is not None
    assert [item.command for item in talk.queries.mission.items] == [5001, 5001]


def test_repeated_counts_do_not_restart_a_download() -> None:
    talk = Talk(Responder({}, {MISSION: ROUTE * 10, FENCE: ()})).run(7.0)
    before = len(talk.requests("MISSION_REQUEST_INT"))
    assert before
    for _ in range(5):
        talk.receive(mavlink.MAVLink_mission_count_message(1, 196, 40, MISSION))
        talk.run(0.4)
    talk.run(15.0)
    requested = [message.seq for message in talk.requests("MISSION_REQUEST_INT")]
    assert requested == list(range(40))


# --- fences


def home(lat_deg: float = 47.0) -> Message:
    place = (round(lat_deg * 1e7), 80_000_000, 500_000)
    return mavlink.MAVLink_home_position_message(*place, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)


def fence_talk(zones: tuple[FenceZone, ...] = (), items: list[Item] | None = None, **values: float) -> Talk:
    responder = Responder({**PARAMETERS, **values}, {MISSION: (), FENCE: ZONES if items is None else items})
    talk = Talk(responder, zones=zones).run(40.0)
    talk.receive(home())
    return talk


def test_a_fence_that_is_off_counts_only_when_its_status_is_heard() -> None:
    talk = fence_talk(FENCE_ENABLE=0.0)
    frame = LocalFrame(47.0, 8.0)
    assert talk.queries.local_fence(frame, 500.0) is None
    talk.receive(mavlink.MAVLink_fence_status_message(0, 0, 0, 0))
    assert len(local_fence(talk).zones) == 2
    assert talk.queries.fence_until_s <= talk.now_s + 5.0
    talk.queries.refresh_fence(talk.now_s + 10.0)
    assert talk.queries.local_fence(frame, 500.0) is None


def test_heights_and_circle_of_the_fence_parameters_are_kept_within_the_margin() -> None:
    limits = {"FENCE_ALT_MIN": 40.0, "FENCE_ALT_MAX": 300.0, "FENCE_RADIUS": 2000.0, "FENCE_MARGIN": 10.0}
    talk = fence_talk(FENCE_TYPE=15.0, **limits)
    heights = talk.queries.heights(30.0, None)
    assert (heights.fence_min_height_m, heights.fence_max_height_m) == (50.0, 290.0)
    fence = local_fence(talk)
    assert fence.margin_m == 30.0, "at least"
    assert (fence.zones[0].centre_m, fence.zones[0].radius_m) == ((0.0, 0.0), 2000.0)
    unlimited = fence_talk(FENCE_TYPE=4.0, **limits).queries.heights(30.0, None)
    assert (unlimited.fence_min_height_m, unlimited.fence_max_height_m) == (None, None)


def test_one_of_several_inclusion_zones_is_enough() -> None:
    two = [*ZONES[:4], Item(5003, (47.5, 8.0), params=(900.0, 0.0, 0.0, 0.0))]
    assert local_fence(fence_talk(items=two, FENCE_OPTIONS=2.0)).any_inclusion
    assert not local_fence(fence_talk(items=two, FENCE_OPTIONS=1.0)).any_inclusion


def test_a_configured_inclusion_zone_is_not_loosened_by_those_of_the_autopilot() -> None:
    two = [*ZONES[:4], Item(5003, (47.5, 8.0), params=(900.0, 0.0, 0.0, 0.0))]
    ours = FenceZone(True, centre_deg=(47.0, 8.0), radius_m=500.0, max_height_m=120.0)
    talk = fence_talk((ours,), two, FENCE_OPTIONS=2.0)
    fence = local_fence(talk)
    assert not fence.any_inclusion
    assert [(zone.radius_m, zone.max_altitude_m) for zone in fence.zones] == [(500.0, 620.0)]


# --- an autopilot that answers nothing


class _Mute(Responder):
    silent = True

    def answer(self, message: Message, asker: Sender = US) -> list[Message]:
        return [] if self.silent else super().answer(message, asker)


def test_silence_to_all_requests_is_a_condition_until_there_is_an_answer() -> None:
    mute = _Mute(dict(PARAMETERS), {MISSION: ROUTE, FENCE: ZONES})
    talk = Talk(mute).run(8.0)
    assert talk.queries.conditions() == []
    talk.run(5.0)
    (condition,) = talk.queries.conditions()
    assert condition.key == UNANSWERED
    assert condition.matters
    assert len(condition.text) <= 50
    talk.run(300.0)
    assert talk.queries.conditions() == [condition], "also when all requests are given up"
    talk.receive(mavlink.MAVLink_command_ack_message(511, 0, 0, 0, US.system_id, US.component_id))
    assert talk.queries.conditions() == []


def test_unknown_parameters_alone_are_no_silence() -> None:
    few = Responder({"AIRSPEED_MIN": 12.0}, {MISSION: ROUTE, FENCE: ZONES})
    talk = Talk(few)
    for _ in range(300):
        talk.run(1.0)
        assert talk.queries.conditions() == []


def test_answers_for_others_are_none_for_us() -> None:
    talk = Talk(_Mute(dict(PARAMETERS))).run(20.0)
    talk.receive(mavlink.MAVLink_param_value_message(b"AIRSPEED_MIN", 12.0, 9, 1, 0), Sender(7, 1))
    assert len(talk.queries.conditions()) == 1
