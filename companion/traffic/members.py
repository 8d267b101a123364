"""Members of our formation among the tracks: which they are, and what they announce."""

from dataclasses import dataclass, replace
from typing import Literal

from companion.geodesy import LocalFrame
from companion.mavlink.facts import MemberIntent, Sender
from companion.model import Goal, Intent, Member, Track, system_key

# A counter behind the newest one by less than this is of an older message; by more, of another run.
_OLDER = 600
_COUNTERS = 0x1_0000


@dataclass(frozen=True, slots=True)
class MemberParams:
    """The system ids of the members, how long each is one without being heard, and their volume."""

    system_ids: Literal["all"] | tuple[int, ...] = ()
    silent_s: float = 5.0
    horizontal_m: float = 50.0
    vertical_m: float = 30.0


class Members:
    """Our members by system id. Each is a member only while it is heard."""

    def __init__(self, params: MemberParams) -> None:
        self._params = params
        self._tracks: dict[int, tuple[str, float]] = {}  # id of the track, and when it was updated
        self._intents: dict[int, tuple[MemberIntent, float]] = {}

    def includes(self, system_id: int) -> bool:
        """Whether this system is configured as a member."""
        system_ids = self._params.system_ids
        return system_ids == "all" or system_id in system_ids

    def includes_key(self, key: str) -> bool:
        """Whether the system with this key in the picture is configured as a member."""
        system_ids = self._params.system_ids
        return system_ids == "all" or any(key == system_key(system_id) for system_id in system_ids)

    def observe_intent(self, fact: MemberIntent, now_s: float) -> None:
        """Keep the newest intent of each member; messages may overtake each other."""
        system_id = fact.sender.system_id
        if not self.includes(system_id):
            return
        known = self._intents.get(system_id)
        if known is not None and now_s - known[1] <= self._params.silent_s:
            behind = (known[0].counter - fact.counter) % _COUNTERS
            if 0 < behind < _OLDER:
                return
        self._intents[system_id] = fact, now_s

    def note_track(self, system_id: int, track_id: str, now_s: float) -> None:
        """Note which track a system's own position has updated."""
        if self.includes(system_id):
            self._tracks[system_id] = track_id, now_s

    def marked(self, tracks: tuple[Track, ...], frame: LocalFrame, now_s: float) -> tuple[Track, ...]:
        """The tracks, with the members' volume and what each member announces."""
        silent_s = self._params.silent_s
        names = {name: id_ for id_, (name, at_s) in self._tracks.items() if now_s - at_s <= silent_s}
        if not names:
            return tracks
        return tuple(
            self._member(track, names[track.track_id], frame, now_s) if track.track_id in names else track
            for track in tracks
        )

    def _member(self, track: Track, system_id: int, frame: LocalFrame, now_s: float) -> Track:
        fact, heard_s = self._intents.get(system_id, (None, 0.0))
        member = None
        if fact is not None and now_s - heard_s <= self._params.silent_s:
            member = member_of(fact, frame)
        return replace(
            track,
            is_member=True,
            protected_horizontal_m=self._params.horizontal_m,
            protected_vertical_m=self._params.vertical_m,
            member=member,
        )


def member_of(fact: MemberIntent, frame: LocalFrame) -> Member:
    """The member that announces this, in the local frame."""
    goal = Goal(
        course_rad=fact.goal_course_rad,
        airspeed_mps=fact.goal_airspeed_mps,
        altitude_m=fact.goal_altitude_m,
        position_m=None
        if fact.goal_deg is None
        else (*frame.to_north_east_m(*fact.goal_deg), -fact.goal_altitude_m),
        is_end=fact.goal_is_end,
        then_m=None
        if fact.then_deg is None
        else (*frame.to_north_east_m(*fact.then_deg), -fact.goal_altitude_m),
    )
    heard = {str(system_id): number for system_id, number in fact.heard.items()}
    return Member(
        goal,
        fact.min_airspeed_mps,
        fact.max_airspeed_mps,
        fact.max_turn_rate_radps,
        Intent(fact.flown, fact.proposal, heard, fact.answers),
        str(fact.sender.system_id),
    )


def fact_of(member: Member, frame: LocalFrame, sender: Sender, counter: int) -> MemberIntent:
    """What we announce: the opposite of `member_of`."""
    goal, intent = member.goal, member.intent or Intent()
    place = None if goal.position_m is None else frame.to_geo(*goal.position_m)
    then = None if goal.then_m is None else frame.to_geo(*goal.then_m)
    return MemberIntent(
        sender,
        counter,
        None if place is None else (place.lat_deg, place.lon_deg),
        None if then is None else (then.lat_deg, then.lon_deg),
        goal.course_rad,
        goal.altitude_m or 0.0,
        goal.airspeed_mps or 0.0,
        goal.is_end,
        member.min_airspeed_mps,
        member.max_airspeed_mps,
        member.max_turn_rate_radps,
        intent.flown,
        intent.proposal,
        {int(member_id): number for member_id, number in intent.heard.items()},
        intent.answers,
    )
