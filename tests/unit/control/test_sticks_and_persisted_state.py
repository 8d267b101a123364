"""What survives a crash of the companion."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.geodesy import GeoPoint
from companion.model import PriorFlightState, Role
from companion.output.persisted_state import LONGEST_S, PersistedState

HELD = PersistedState(
    1e9,
    1,
    PriorFlightState(10, 3, GeoPoint(1.0, 2.0, 3.0), 0.5, 600.0, 22.0),
    Role.ADVISE,
    5,
    {"FW_AIRSPD_TRIM": 15.0},
)


@pytest.mark.parametrize(
    "held", [HELD, PersistedState(1e9, 1, PriorFlightState(10)), PersistedState(1e9, 1, None, Role.OFF)]
)
def test_what_is_kept_is_found_again(held: PersistedState) -> None:
    assert PersistedState.from_text(held.to_text()) == held


@given(
    st.text()
    | st.sampled_from(
        [
            "{}",
            "[]",
            "null",
            '{"before":{}}',
            HELD.to_text()[:-9],
            HELD.to_text().replace('"system_id":1', '"system_id":Infinity'),
        ]
    )
)
def test_a_damaged_record_is_none(text: str) -> None:
    assert PersistedState.from_text(text) is None


@pytest.mark.parametrize(
    ("later_s", "fresh"), [(0.0, True), (5.0, True), (LONGEST_S + 1.0, False), (-5.0, False)]
)
def test_only_a_fresh_record_says_who_has_the_aircraft(later_s: float, fresh: bool) -> None:
    assert HELD.is_fresh(HELD.time_s + later_s) is fresh
