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
