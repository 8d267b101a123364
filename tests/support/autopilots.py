"""Every way of flying: the autopilots that are simulated, their modes, and which tests need which of them.

- What judges control is flown in every way of flying (`every`): take-over, hand-back, pilot overrides, modes,
  return to the leg.
- What judges the avoidance needs one airframe of each kind (`both`): it decides above the adapters.
- Between those two, each autopilot is flown, and PX4 in one of its two ways (`ways`).
- The rows of a table that the autopilot does not change are flown in turn (`in_turn`): each row once, and all
  ways of flying in one table. `make thorough` flies each row in every one.
- `tests/closed_loop/test_scenarios.py` flies each scenario in one way after the other.
"""

from collections.abc import Iterable, Sequence

import pytest

from sim.scenario import Autopilot
from tests.support.thorough import THOROUGH, pairs

ARDUPILOT: Autopilot = "ardupilot"
PX4: Autopilot = "px4"
PX4_1_18: Autopilot = "px4-1.18"
BOTH: tuple[Autopilot, ...] = (ARDUPILOT, PX4)
ALL: tuple[Autopilot, ...] = (*BOTH, PX4_1_18)
MISSION_MODE: dict[Autopilot, str] = {ARDUPILOT: "AUTO", PX4: "MISSION", PX4_1_18: "MISSION"}
GUIDED_MODE: dict[Autopilot, str] = {ARDUPILOT: "GUIDED", PX4: "OFFBOARD", PX4_1_18: "GUIDED_COURSE"}

both = pytest.mark.parametrize("autopilot", BOTH)
every = pytest.mark.parametrize("autopilot", ALL)


def ways(*usual: Autopilot, among: Sequence[Autopilot] = ALL) -> pytest.MarkDecorator:
    """Parametrizes `autopilot` with these ways of flying, or with all `among` (`make thorough`)."""
    return pytest.mark.parametrize("autopilot", among if THOROUGH else usual)


def paired(name: str, values: Sequence[object], among: Sequence[Autopilot] = ALL) -> pytest.MarkDecorator:
    """Parametrizes `autopilot` and `name`: each value and each way of flying once, or all `make thorough`."""
    return pytest.mark.parametrize(("autopilot", name), pairs(among, values))


def in_turn(
    name: str, rows: Iterable[object], among: Sequence[Autopilot] = ALL, *, first: int = 0
) -> pytest.MarkDecorator:
    """Parametrizes `autopilot` and `name` with each row, by one way of flying after the other."""
    rows = list(rows)
    if THOROUGH:
        pairs = [(autopilot, row) for row in rows for autopilot in among]
    else:
        pairs = [(among[(first + place) % len(among)], row) for place, row in enumerate(rows)]
    return pytest.mark.parametrize(("autopilot", name), pairs)
