"""Campaigns on other machines: scheduler addresses, installed versions, and inputs for the workers."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from companion.errors import ConfigError
from sim.campaign.cluster import parse_scheduler_address
from sim.campaign.environment import difference, environment
from sim.campaign.plan import Plan
from sim.encounters import Encounter, generate, write_encounters
from tests.support.paths import ENCOUNTER_MODELS


@pytest.mark.parametrize(
    ("address", "place"),
    [
        ("tcp://192.168.1.7:8786", ("192.168.1.7", 8786)),
        ("scheduler:8786", ("scheduler", 8786)),
        ("tls://[::1]:8786", ("::1", 8786)),
    ],
)
def test_an_address_is_a_host_and_a_port(address: str, place: tuple[str, int]) -> None:
    assert parse_scheduler_address(address) == place


@pytest.mark.parametrize("address", ["", "somewhere", ":8786", "host:", "host:0", "host:65536", "ws://h:1"])
def test_a_bad_address_is_refused(address: str) -> None:
    with pytest.raises(ConfigError, match="such as tcp://"):
        parse_scheduler_address(address)


def test_a_difference_of_versions_is_named() -> None:
    here = environment(["companion", "orca"])
    assert {"companion", "Python", "numpy", "pymavlink", "pyrvo"} == set(here)
    assert difference(here, dict(here)) is None
    assert difference(here, here | {"numpy": "1.0"}) == f"numpy 1.0, here {here['numpy']}"
    assert difference(here, {}) == f"companion none, here {here['companion']}"
    assert "pyrvo" not in environment(["companion"])


def same(one: Encounter, other: Encounter) -> bool:
    return one.encounter_id == other.encounter_id and all(
        np.array_equal(a.position_m, b.position_m) and np.array_equal(a.velocity_mps, b.velocity_mps)
        for a, b in zip(one.intruders, other.intruders, strict=True)
    )


def test_pickled_inputs_give_the_same_encounters(tmp_path: Path) -> None:
    """Workers do not have the files."""
    write_encounters(tmp_path / "e.csv", [generate("mix", 1, number) for number in range(3)])
    model = ENCOUNTER_MODELS["invented"]
    for plan in (Plan(5), Plan(5, models=(str(tmp_path / "e.csv"),)), Plan(5, seed=2, models=(str(model),))):
        copied = plan.source(pickle.loads(pickle.dumps(plan.inputs())))
        assert all(same(copied(number), plan.source()(number)) for number in plan.numbers())
