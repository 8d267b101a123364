"""The examples that come with the package."""

from pathlib import Path

import pytest

from companion.config import example, example_names, load_config
from companion.errors import ConfigError
from tests.support.paths import CONFIGS


def test_every_example_of_the_repository_is_in_the_package() -> None:
    assert example_names() == ["arduplane", "companion.service", "px4", "sitl"]
    assert example("companion.service") == (CONFIGS / "companion.service").read_text()


@pytest.mark.parametrize("name", [name for name in example_names() if "." not in name])
def test_an_example_is_a_configuration(name: str, tmp_path: Path) -> None:
    path = tmp_path / "companion.yaml"
    path.write_text(example(name))
    assert load_config(path).links


def test_an_unknown_name_is_refused_with_those_that_exist() -> None:
    with pytest.raises(ConfigError, match=r"--example boat: there are arduplane, companion\.service"):
        example("boat")
