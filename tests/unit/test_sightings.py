"""The table of aircraft that a replay prints."""

from companion.model import Decision, Layer, Ownship, Track, TrackState, TrafficKind
from companion.output.decision_record import Circumstances
from companion.output.effects import Record
from companion.sightings import Sightings

OWN = Ownship(0.0, (0.0, 0.0, -500.0), (20.0, 0.0, 0.0), 20.0, 0.0)


def record(time_s: float, *tracks: Track, **reports: int) -> Record:
    around = Circumstances("monitor", False, "AUTO", None, reports=reports)
    return Record(time_s, Decision(Layer.CLEAR), OWN, tracks, around)


def track(name: str, north_m: float, **changes: object) -> Track:
    return Track(name, 0.0, (north_m, 0.0, -500.0), (0.0, 0.0, 0.0), **changes)  # type: ignore[arg-type]


def test_the_nearest_is_first_and_an_obstacle_is_no_aircraft() -> None:
    sightings = Sightings()
    assert [*sightings.lines()] == []
    far = track("FAR", 5000.0, sources=("ADS-B",))
    mast = track("mast", 10.0, kind=TrafficKind.OBSTACLE)
    near = track("A1", 320.0, sources=("ADS-B", "sbs:tcp:a:1"), age_s=0.4, callsign="N1")
    sightings.take(1.0, record(1.0, far, mast, near, FAR=1, A1=2))
    sightings.take(2.0, record(2.0, far, track("A1", 900.0, state=TrackState.COASTED, age_s=1.4), A1=2))
    sightings.take(9.0, record(9.0, far, FAR=8))
    assert [*sightings.lines()] == [
        "aircraft  first heard  last heard  reports          closest  at the end  sources",
        "N1              0.6 s       0.6 s        2   320 m at 1.0 s  lost        ADS-B, sbs:tcp:a:1",
        "FAR             1.0 s       9.0 s        8  5000 m at 1.0 s  confirmed   ADS-B",
    ]
    assert sightings.values()[0]["track"] == "A1"


def test_a_flood_is_counted_and_the_table_stays_short() -> None:
    sightings = Sightings()
    for start in range(0, 12_000, 2000):
        sightings.take(1.0, record(1.0, *(track(f"T{number}", 1e4) for number in range(start, start + 2000))))
    lines = [*sightings.lines()]
    assert len(lines) == 22
    assert sightings.left_out == 5000
    assert lines[-1] == "and at least 9980 more aircraft"
