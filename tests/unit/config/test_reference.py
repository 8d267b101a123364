"""The configuration reference: complete, and the same in configs as in the code."""

import dataclasses

import pytest

from companion.config import Config, load_config, reference
from companion.config.keys import file_key
from tests.support.paths import CONFIGS


def test_the_file_is_up_to_date() -> None:
    """After a change: companion check --reference > configs/reference.yaml."""
    assert (CONFIGS / "reference.yaml").read_text() == reference()


def test_it_loads_to_the_defaults() -> None:
    assert load_config(CONFIGS / "reference.yaml") == Config(links=("udpin:0.0.0.0:14550",))


@pytest.mark.parametrize("name", [file_key(field.name) for field in dataclasses.fields(Config)])
def test_every_section_is_there(name: str) -> None:
    assert f"\n{name}:" in reference()


def test_ranges_and_comments_are_those_of_the_code() -> None:
    text = reference()
    assert "  well_clear_horizontal_m: 609.6  # at least 50, at most 5000\n" in text
    assert "    max_bank_deg: 30  # more than 0, less than 80\n" in text, "in degrees, like the key"
    assert "  # Never below this height above home.\n" in text
