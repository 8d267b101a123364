"""The reason for a decision in words: the manoeuvre first, one name for the aircraft, no negative times."""

import math

import pytest

from companion.avoidance import AvoidanceParams, Avoider
from companion.avoidance.assess import reason
from companion.avoidance.trajectory import OwnState
from companion.model import Goal, Guidance, Layer, Ownship, Threat, Track

STATE = OwnState((0.0, 0.0, -884.0), 0.0, 22.0, 0.0, (0.0, 0.0))


def threat(above_m: float = 0.0, to_closest_s: float = 68.0, name: str = "HEAD1") -> Threat:
    return Threat("A00001", 0xA00001, 5733.0, above_m, 0.0, 82.0, to_closest_s, 0.0, 0.0, Layer.OUTER, name)


@pytest.mark.parametrize(
    ("guidance", "near", "words"),
    [
        (Guidance(0.0, 22.0, 981.0), threat(),
         "climb 97 m, course 000: HEAD1 5733 m, level, closest in 68 s"),
        (Guidance(0.8, 14.0, 884.0), threat(-61.0),
         "right to 046, 14 m/s: HEAD1 5733 m, 61 m below, closest in 68 s"),
        (Guidance(-0.8, 22.0, 784.0), threat(61.0, -1.0, ""),
         "descend 100 m, left to 314: A00001 5733 m, 61 m above, passed"),
        (Guidance(0.0, 22.0, 884.0), threat(0.0, math.inf),
         "course 000: HEAD1 5733 m, level, keeps its distance"),
    ],
)  # fmt: skip
def test_the_manoeuvre_comes_first(guidance: Guidance, near: Threat, words: str) -> None:
    assert reason(near, guidance, STATE) == words


@pytest.mark.parametrize(
    ("callsign", "icao", "name"),
    [("HEAD1", 0xA1, "HEAD1"), (None, 0xA1, "0000A1"), (None, None, "UTM-1")],
)
def test_the_threat_has_the_name_of_its_track(callsign: str | None, icao: int | None, name: str) -> None:
    own = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
    track = Track("UTM-1", 0.0, (2000.0, 0.0, -300.0), (-60.0, 0.0, 0.0), icao=icao, callsign=callsign)
    goal = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
    decision = Avoider(AvoidanceParams()).decide(0.0, own, [track], goal)
    assert decision.threats[0].name == track.name == name
    assert f": {name} 2000 m" in decision.because
