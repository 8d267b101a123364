"""Saved settings take precedence over the configuration, and never stop a start."""

from pathlib import Path

import pytest

from companion.config import Config, apply_saved, describe_saved, load_saved
from companion.control.state_machine import SupervisorParams
from companion.engine import Engine, Save
from companion.mavlink.facts import ParameterSet, Sender

GCS, US = Sender(255, 190), Sender(1, 196)


def config_in(folder: Path, text: str | bytes | None = None) -> Config:
    path = folder / "companion.settings"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return Config(links=("udpin:127.0.0.1:0",), settings_file=path)


def test_without_a_file_the_configuration_is_used(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    saved = load_saved(config)
    assert (saved.values, saved.problem) == ({}, None)
    assert apply_saved(config, saved) == config


def test_the_next_engine_starts_with_what_the_last_one_saved(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    engine = Engine(config.for_engine())
    for name, value in {"CA_OUTER_TIME": 45.5, "CA_ROLE": 1.0, "CA_MARGIN_H": 0.30000001192092896}.items():
        assert engine.receive(ParameterSet(GCS, US, name, value), 0.0)
    (effect,) = [effect for effect in engine.tick(0.0) if isinstance(effect, Save)]
    assert effect.text is not None
    assert effect.text.count("\n") == 5
    config = config_in(tmp_path, effect.text)
    saved = load_saved(config)
    assert saved.problem is None
    assert saved.values == {"CA_ROLE": 1.0, "CA_MARGIN_H": 0.3, "CA_OUTER_TIME": 45.5}
    following = Engine(config.for_engine(), saved=saved.values)
    assert following.operator.role.name == "ADVISE"
    assert following.operator.settings.config == engine.operator.settings.config
    assert not [effect for effect in following.tick(0.0) if isinstance(effect, Save)]
    assert following.receive(ParameterSet(GCS, US, "CA_ROLE", 2.0), 0.1)
    (effect,) = [effect for effect in following.tick(0.1) if isinstance(effect, Save)]
    assert effect.values == {"CA_MARGIN_H": 0.3, "CA_OUTER_TIME": 45.5}
    with_saved = apply_saved(config, saved)
    assert with_saved.avoidance.outer_time_s == 45.5
    assert with_saved.supervisor.role == "advise"
    assert with_saved.links == config.links


def test_nothing_is_saved_once_the_configured_value_is_set_again() -> None:
    engine = Engine(saved={"CA_OUTER_TIME": 45.0})
    engine.receive(ParameterSet(GCS, US, "CA_OUTER_TIME", 60.0), 0.0)
    (effect,) = [effect for effect in engine.tick(0.0) if isinstance(effect, Save)]
    assert effect.text is None


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "null", "3", '"CA_ROLE"', b"\xff\x00", b"\0" * 100, "[" * 60_000, "{" * 100_000,
     '{"CA_ROLE": 1}' + " " * 70_000, '{"CA_ROLE": ' + "9" * 5000 + "}"],
    ids=range(12),
)  # fmt: skip
def test_a_damaged_file_is_reported_in_one_line_and_not_used(tmp_path: Path, text: str | bytes) -> None:
    saved = load_saved(config_in(tmp_path, text))
    assert saved.values == {}
    path = f"{tmp_path}/companion.settings"
    too_large = f"{path}: cannot be read, not used: larger than 65536 bytes"
    assert saved.problem == (too_large if len(text) > 65536 else f"{path}: damaged, not used")
    assert saved.damaged


def test_an_unreadable_file_is_reported(tmp_path: Path) -> None:
    config = Config(links=("udpin:127.0.0.1:0",), settings_file=tmp_path)
    assert load_saved(config).problem == f"{tmp_path}: cannot be read, not used: a folder"


def test_unusable_values_are_named_and_the_rest_is_used(tmp_path: Path) -> None:
    config = config_in(
        tmp_path,
        '{"CA_OUTER_TIME": 500, "CA_GONE": 1, "CA_SETTLE": NaN, "CA_INNER_TIME": 10, "a\\n\\u001b[2J": {}}',
    )
    saved = load_saved(config)
    assert saved.values == {"CA_INNER_TIME": 10.0}
    assert saved.problem is not None
    assert saved.problem.isprintable()
    assert "CA_OUTER_TIME: 500 refused: 10 to 80 s; CA_GONE: unknown; CA_SETTLE: must be" in saved.problem
    assert list(describe_saved(config, saved)) == [
        "CA_INNER_TIME 10 s instead of 20 s: avoidance.inner_time_s"
    ]


def test_a_value_that_contradicts_a_changed_configuration_is_not_used(tmp_path: Path) -> None:
    config = config_in(tmp_path, '{"CA_HEIGHT_MAX": 50}')
    assert load_saved(config).values == {"CA_HEIGHT_MAX": 50.0}
    higher = Config(
        links=config.links, settings_file=config.settings_file, supervisor=SupervisorParams(min_height_m=60.0)
    )
    saved = load_saved(higher)
    assert saved.values == {}
    assert saved.problem is not None
    assert "must be above" in saved.problem


def test_settings_file_and_state_file_must_differ() -> None:
    with pytest.raises(ValueError, match="two different files"):
        Config(links=("udpin:127.0.0.1:0",), settings_file=Path("a"), state_file=Path("a"))
