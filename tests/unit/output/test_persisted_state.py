"""The state that survives a crash of Companion."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.geodesy import GeoPoint
from companion.model import PriorFlightState, Role
from companion.output.persisted_state import LONGEST_S, PersistedState

SAVED = PersistedState(
    1e9,
    1,
    PriorFlightState(10, 3, GeoPoint(1.0, 2.0, 3.0), 0.5, 600.0, 22.0),
    Role.ADVISE,
    5,
    {"FW_AIRSPD_TRIM": 15.0},
)


@pytest.mark.parametrize(
    "saved", [SAVED, PersistedState(1e9, 1, PriorFlightState(10)), PersistedState(1e9, 1, None, Role.OFF)]
)
def test_a_saved_state_is_read_back_unchanged(saved: PersistedState) -> None:
    assert PersistedState.from_text(saved.to_text()) == saved


@given(
    st.text()
    | st.sampled_from(
        [
            "{}",
            "[]",
            "null",
            '{"before":{}}',
            SAVED.to_text()[:-9],
            SAVED.to_text().replace('"system_id":1', '"system_id":Infinity'),
        ]
    )
)
def test_a_damaged_text_gives_no_state(text: str) -> None:
    assert PersistedState.from_text(text) is None


@pytest.mark.parametrize(
    ("later_s", "fresh"), [(0.0, True), (5.0, True), (LONGEST_S + 1.0, False), (-5.0, False)]
)
def test_only_a_recent_state_is_fresh(later_s: float, fresh: bool) -> None:
    assert SAVED.is_fresh(SAVED.time_s + later_s) is fresh


@pytest.mark.parametrize(
    ("there", "instead"),
    [
        ('"sequence":3', '"sequence":1e308'),
        ('"sequence":3', '"sequence":-1'),
        ('"sequence":3', '"sequence":65536'),
        ('"sequence":3', '"sequence":true'),
        ('"sequence":3', '"sequence":"3"'),
        ('"mode":10', '"mode":4294967296'),
        ('"mode":10', '"mode":-1'),
        ('"system_id":1', '"system_id":0'),
        ('"system_id":1', '"system_id":256'),
        ('"system_id":1', '"system_id":1.5'),
        ('"time_s":1000000000.0', '"time_s":NaN'),
        ('"time_s":1000000000.0', '"time_s":1e300'),
        ('"course_rad":0.5', '"course_rad":Infinity'),
        ('"course_rad":0.5', '"course_rad":100'),
        ('"altitude_m":600.0', '"altitude_m":-1e9'),
        ('"airspeed_mps":22.0', '"airspeed_mps":NaN'),
        ("1.0,2.0,3.0", "91.0,2.0,3.0"),
        ("1.0,2.0,3.0", "1.0,2.0"),
        ("1.0,2.0,3.0", "1.0,2.0,NaN"),
        ('"left_behind":5', '"left_behind":-5'),
        ('"role":1', '"role":9'),
        ('"FW_AIRSPD_TRIM":15.0', '"FW_AIRSPD_TRIM":1e30'),
        ('"FW_AIRSPD_TRIM":15.0', '"FW_AIRSPD_TRIM":NaN'),
        ('"FW_AIRSPD_TRIM":15.0', '"FW_AIRSPD_TRIM_AND_MORE":15.0'),
        ('{"FW_AIRSPD_TRIM":15.0}', "[]"),
        ('{"FW_AIRSPD_TRIM":15.0}', "[" * 1000 + "]" * 1000),
    ],
)
def test_a_value_that_companion_would_not_write_gives_no_state(there: str, instead: str) -> None:
    text = SAVED.to_text()
    assert there in text
    assert PersistedState.from_text(text.replace(there, instead)) is None


@pytest.mark.parametrize("text", ["[" * 1000, "[" * 60_000, '{"a":' * 20_000, "9" * 60_000, "1e308"])
def test_a_deep_or_long_text_gives_no_state(text: str) -> None:
    assert PersistedState.from_text(text) is None
