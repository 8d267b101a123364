"""Every way of flying: the autopilots that are simulated, and their modes."""

import pytest

from sim.scenario import Autopilot

ARDUPILOT: Autopilot = "ardupilot"
PX4: Autopilot = "px4"
PX4_1_18: Autopilot = "px4-1.18"
BOTH: tuple[Autopilot, ...] = (ARDUPILOT, PX4)
ALL: tuple[Autopilot, ...] = (*BOTH, PX4_1_18)
MISSION_MODE: dict[Autopilot, str] = {ARDUPILOT: "AUTO", PX4: "MISSION", PX4_1_18: "MISSION"}
GUIDED_MODE: dict[Autopilot, str] = {ARDUPILOT: "GUIDED", PX4: "OFFBOARD", PX4_1_18: "GUIDED_COURSE"}

both = pytest.mark.parametrize("autopilot", BOTH)
every = pytest.mark.parametrize("autopilot", ALL)
