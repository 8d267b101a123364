"""Strangers that avoid too, heard by ADS-B alone: the maneuvers of both do not cancel each other."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from companion.avoidance import AvoidanceParams
from companion.engine import Engine, EngineConfig, EngineParams
from companion.ownship.performance_limits import AircraftLimits
from companion.units import WELL_CLEAR_VERTICAL_M
from sim.campaign.avoiders import PeerAvoider, engine_for
from sim.campaign.mirroring import SIDEWAYS, VERTICAL
from sim.campaign.plane import Limits
from sim.campaign.two_sided import fly_both, sides_of
from sim.encounters import SURVEILLANCE_PRESETS, Encounter, Path
from sim.peers import Peer, PeerLimits
from sim.peers.ardupilot import ArduPilot
from tests.support.thorough import THOROUGH, pairs
from tests.support.vertical_advisories import VerticalAdvisories

OWN_MPS = 25.0
# With either one having the smaller address, and with decisions at the same moments and half a second apart.
SEEDS = (0, 4)
# Course and speed of the stranger [deg, m/s], its height above us where they meet, and its climb [m, m/s].
GEOMETRIES = {
    "head-on": (180.0, 25.0, 0.0, 0.0),
    "from the right": (270.0, 25.0, 0.0, 0.0),
    "from the left": (90.0, 25.0, 0.0, 0.0),
    "from the left behind": (50.0, 32.0, 0.0, 0.0),
    "converging": (330.0, 27.0, 0.0, 0.0),
    "overtaking us": (0.0, 42.0, 0.0, 0.0),
    "overtaken by us": (0.0, 16.0, 0.0, 0.0),
    "head-on, a little higher": (180.0, 25.0, 15.0, 0.0),
    "head-on, a little lower": (180.0, 25.0, -15.0, 0.0),
    "climbing from below": (180.0, 25.0, 0.0, 2.0),
    "sinking across": (270.0, 28.0, 0.0, -2.0),
}


def encounter(name: str) -> Encounter:
    """Two aircraft that would collide, or pass a little above each other, well after the first leg began."""
    course_deg, speed_mps, above_m, climb_mps = GEOMETRIES[name]
    meet_s = 150.0 if name == "overtaken by us" else 90.0
    course_rad = math.radians(course_deg)
    velocity = np.array([speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), -climb_mps])
    times_s = np.arange(2.0 * meet_s + 1.0)
    meeting_m = np.array([meet_s * OWN_MPS, 0.0, -400.0 - above_m])
    path = Path(
        times_s, meeting_m + (times_s - meet_s)[:, None] * velocity, np.tile(velocity, (len(times_s), 1))
    )
    return Encounter(name, (0.0, 0.0, -400.0), 0.0, OWN_MPS, (path,), duration_s=2.0 * meet_s)


def stranger(peer: Callable[[PeerLimits], Peer], limits: Limits) -> Engine:
    """The engine of the second aircraft with a peer's avoidance."""
    envelope = PeerLimits(
        limits.min_airspeed_mps,
        limits.max_airspeed_mps,
        limits.max_bank_rad,
        limits.max_climb_mps,
        limits.max_climb_mps,
        floor_m=50.0,
    )
    config = EngineConfig(
        engine=EngineParams(autopilot_system_id=1), aircraft=AircraftLimits(max_bank_rad=limits.max_bank_rad)
    )
    return Engine(config, avoider=PeerAvoider(AvoidanceParams(), peer(envelope)))


# `make test` flies each with both kinds of surveillance and one seed; the longest one with ADS-B only.
ROWS = [
    (name, surveillance, SEEDS if THOROUGH else SEEDS[(place + number) % 2 :][:1])
    for place, name in enumerate(GEOMETRIES)
    for number, surveillance in enumerate(("perfect", "adsb-out"))
    if THOROUGH or (name, surveillance) != ("overtaken by us", "perfect")
]


@pytest.mark.parametrize(("name", "surveillance", "seeds"), ROWS)
def test_two_companions_do_not_mirror(name: str, surveillance: str, seeds: tuple[int, ...]) -> None:
    """Either may have the smaller address, and decisions come together or half a second apart.

    Where they are apart in height, to which side each has turned does not matter.
    """
    for seed in seeds:
        sides = sides_of(encounter(name), Limits())
        _, flown = fly_both(
            sides,
            lambda one, limits: engine_for("companion", limits)(one),
            SURVEILLANCE_PRESETS[surveillance],
            seed,
        )
        assert not flown.closest.lowc, (seed, flown.closest)
        mirrored = flown.mirrored or ()
        assert VERTICAL not in mirrored, (seed, flown.reasons)
        apart = flown.closest.vertical_m >= WELL_CLEAR_VERTICAL_M
        assert apart or SIDEWAYS not in mirrored, (seed, flown.reasons)


@pytest.mark.parametrize(("name", "peer"), pairs([*GEOMETRIES], [ArduPilot, VerticalAdvisories]))
def test_we_keep_clear_of_a_stranger_that_avoids_by_another_rule(
    name: str, peer: Callable[[PeerLimits], Peer]
) -> None:
    for seed in SEEDS[:1]:
        sides = sides_of(encounter(name), Limits())
        _, flown = fly_both(
            sides,
            lambda one, limits: (
                engine_for("companion", limits)(one)
                if one is sides[0].encounter  # noqa: B023
                else stranger(peer, limits)
            ),
            SURVEILLANCE_PRESETS["perfect"],
            seed,
        )
        assert not flown.closest.lowc, (seed, flown.closest)
