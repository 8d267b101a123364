"""What the README shows to be copied can be used as it stands."""

import re
from pathlib import Path

import pytest

from companion.config import load_config, load_obstacles
from companion.config.keys import file_key
from companion.gcs.parameters import GCS_PARAMETERS
from companion.model import Role
from tests.support.paths import ROOT

TEXT = (ROOT / "README.md").read_text(encoding="utf-8")

NAMED = r"(?<![/\w])(?:configs|companion|sim)/[\w/.-]+\w"


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


def test_the_configuration_with_obstacles_and_fences_loads(tmp_path: Path) -> None:
    for block in blocks("yaml"):
        name = block.splitlines()[0].removeprefix("# ")
        (tmp_path / name).write_text(block)
    (geojson,) = blocks("json")
    (tmp_path / "power-lines.geojson").write_text(geojson)
    config = load_config(tmp_path / "companion.yaml")
    assert [zone.inclusion for zone in config.fences] == [True, False]
    names = {obstacle.name for obstacle in load_obstacles(config)}
    assert names == {"Radio mast", "Wind turbine", "Line 4"}


def test_the_roles_have_the_numbers_that_it_says() -> None:
    table = dict(re.findall(r"^\| `(off|advise|fly)` \|.*\| (\d) \|$", TEXT, re.MULTILINE))
    assert {name: int(number) for name, number in table.items()} == {
        role.name.lower(): role.value for role in Role
    }


def rows_of_settings() -> list[str]:
    """The table of settings as it should be; after a change, this is what to put there."""
    return [
        f"| `{tunable.name}` | `{file_key(tunable.field)}` | {tunable.unit} "
        f"| {tunable.lowest:g} to {tunable.highest:g} | {tunable.words} |"
        for tunable in GCS_PARAMETERS
    ]


def test_the_settings_are_those_of_the_table_in_the_code() -> None:
    assert re.findall(r"^\| `CA_\w+` \| `.*$", TEXT, re.MULTILINE) == rows_of_settings()


@pytest.mark.parametrize(
    "path", sorted(set(re.findall(r"(?<![/\w])(?:configs|companion|sim)/[\w/.-]+\w", TEXT)))
)
def test_every_file_that_it_names_is_there(path: str) -> None:
    assert (ROOT / path).exists()
