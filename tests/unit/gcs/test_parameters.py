"""The table of settings: every value in range is also valid in a configuration file."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from companion.avoidance import AvoidanceParams, Control
from companion.config import load_config
from companion.config.keys import file_key
from companion.control.state_machine import SupervisorParams
from companion.engine import EngineConfig, EngineParams
from companion.errors import ConfigError
from companion.gcs.parameters import BY_NAME, GCS_PARAMETERS, GcsParam, values_changed, with_values
from companion.gcs.settings import Settings

DEFAULT = EngineConfig()
# Settings to change first, so that the end of a range agrees with the other settings.
MAKES_ROOM: dict[str, dict[str, float]] = {
    "CA_INNER_DIST": {"CA_OUTER_DIST": 20_000.0},
    "CA_OUTER_DIST": {"CA_INNER_DIST": 50.0},
    "CA_OUTER_TIME": {"CA_INNER_TIME": 5.0},
}
every = pytest.mark.parametrize("parameter", GCS_PARAMETERS, ids=lambda parameter: parameter.name)


def loads(config: EngineConfig) -> bool:
    """Whether the loader of configuration files accepts it."""
    adapter: TypeAdapter[Any] = TypeAdapter(EngineConfig)
    try:
        adapter.validate_json(adapter.dump_json(config), strict=True)
    except ValidationError:
        return False
    return True


def test_the_loader_of_this_test_refuses_invalid_values() -> None:
    assert loads(DEFAULT)
    assert not loads(replace(DEFAULT, avoidance=AvoidanceParams(outer_time_s=90.0)))


@every
def test_a_name_has_our_prefix_and_fits_the_wire(parameter: GcsParam) -> None:
    assert parameter.name.startswith("CA_")
    assert len(parameter.name) <= 16
    assert parameter.name.isascii()
    assert len(parameter.words) <= 40


def test_names_and_fields_are_unique() -> None:
    assert len(BY_NAME) == len(GCS_PARAMETERS) == len({parameter.field for parameter in GCS_PARAMETERS})


@every
def test_the_default_can_be_set(parameter: GcsParam) -> None:
    value = parameter.value(DEFAULT)
    assert parameter.lowest <= value <= parameter.highest
    assert parameter.put(DEFAULT, value, DEFAULT) == DEFAULT


@every
@pytest.mark.parametrize("bound", ["lowest", "highest"])
def test_every_row_can_be_set_to_its_bounds_and_the_loader_agrees(parameter: GcsParam, bound: str) -> None:
    before, refused = with_values(DEFAULT, MAKES_ROOM.get(parameter.name, {}))
    assert not refused
    value = getattr(parameter, bound)
    config = parameter.put(before, value, DEFAULT)
    assert parameter.value(config) == value
    assert loads(config)
    assert values_changed(config, before).keys() <= {parameter.name}


@every
@pytest.mark.parametrize("bound", ["lowest", "highest"])
def test_what_flight_refuses_the_configuration_refuses_too(
    parameter: GcsParam, bound: str, tmp_path: Path
) -> None:
    """One range for both: a value just outside is not good to fly with either."""
    if parameter.name in ("CA_ROLE", "CA_UNITS", "CA_CONTROLS", "CA_HEIGHT_MAX"):
        return  # words in the file, or null
    edge = getattr(parameter, bound)
    beyond = edge + (-1.0 if bound == "lowest" else 1.0) * max(1e-3, abs(edge) * 1e-3)
    with pytest.raises(ValueError, match=" to "):
        parameter.put(DEFAULT, beyond, DEFAULT)
    *sections, key = map(file_key, parameter.field.split("."))
    lines = [f"{'  ' * depth}{name}:" for depth, name in enumerate(sections)]
    lines.append(f"{'  ' * len(sections)}{key}: {beyond}")
    path = tmp_path / "c.yaml"
    path.write_text("\n".join(["links: ['udpin:h:1']", *lines]))
    with pytest.raises(ConfigError, match=rf"{key}: must be at (least|most) {edge:.6g} "):
        load_config(path)


@every
def test_a_value_beyond_its_bounds_is_refused(parameter: GcsParam) -> None:
    for value in (
        parameter.lowest - max(1e-3, abs(parameter.lowest) * 1e-5),
        parameter.highest + max(1e-3, parameter.highest * 1e-5),
        -3.4e38,
        3.4e38,
        1e300,
        math.inf,
        math.nan,
        None,
    ):
        with pytest.raises(ValueError, match=r"\w"):
            parameter.put(DEFAULT, value, DEFAULT)


@pytest.mark.parametrize("name", ["CA_ROLE", "CA_UNITS", "CA_CONTROLS"])
def test_a_choice_is_a_whole_number(name: str) -> None:
    with pytest.raises(ValueError, match="whole"):
        BY_NAME[name].put(DEFAULT, 0.5 if name == "CA_UNITS" else 1.5, DEFAULT)


def test_the_course_is_always_among_the_controls() -> None:
    controls = BY_NAME["CA_CONTROLS"]
    assert controls.put(DEFAULT, 5.0, DEFAULT).avoidance.controls == {Control.HEADING, Control.HEIGHT}
    for bits in (2.0, 4.0, 6.0):
        with pytest.raises(ValueError, match="course"):
            controls.put(DEFAULT, bits, DEFAULT)


@pytest.mark.parametrize(
    ("name", "value"),
    [("CA_INNER_DIST", 2000.0), ("CA_OUTER_DIST", 299.0), ("CA_INNER_TIME", 60.5), ("CA_OUTER_TIME", 15.0)],
)
def test_a_value_that_contradicts_another_setting_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        BY_NAME[name].put(DEFAULT, value, DEFAULT)


def test_the_ceiling_stays_above_the_floor() -> None:
    ceiling, floor = BY_NAME["CA_HEIGHT_MAX"], BY_NAME["CA_HEIGHT_MIN"]
    config = ceiling.put(DEFAULT, 120.0, DEFAULT)
    assert config.engine.max_height_m == 120.0
    with pytest.raises(ValueError, match="above"):
        floor.put(config, 120.0, DEFAULT)
    with pytest.raises(ValueError, match="above"):
        ceiling.put(config, 30.0, DEFAULT)
    assert ceiling.put(config, 0.0, DEFAULT) == DEFAULT


def test_a_configured_value_outside_the_range_of_the_wire_can_be_restored() -> None:
    configured = EngineConfig(supervisor=SupervisorParams(min_height_m=1.0 / 3.0))
    floor = BY_NAME["CA_HEIGHT_MIN"]
    tuned = floor.put(configured, 50.0, configured)
    with pytest.raises(ValueError, match="10 to 1000 m"):
        floor.put(tuned, 0.4, configured)
    again = floor.put(tuned, floor.value(configured), configured)
    assert again == configured
    assert values_changed(again, configured) == {}


def test_a_32_bit_value_is_rounded_to_its_shortest_decimal() -> None:
    sent = 0.20000000298023224  # 0.2 as it comes from the wire
    assert BY_NAME["CA_MARGIN_H"].put(DEFAULT, sent, DEFAULT).avoidance.horizontal_margin == 0.2
    assert BY_NAME["CA_BEGIN_FAR"].put(DEFAULT, sent, DEFAULT).avoidance.begin_far == 0.2
    assert BY_NAME["CA_WC_HORIZ"].put(DEFAULT, 609.5999755859375, DEFAULT) == DEFAULT


def test_values_that_are_valid_only_together_are_accepted_in_any_order() -> None:
    values = {"CA_INNER_DIST": 4000.0, "CA_OUTER_DIST": 5000.0, "CA_INNER_TIME": 9.0, "CA_OUTER_TIME": 10.0}
    for names in (list(values), list(reversed(values))):
        config, refused = with_values(DEFAULT, {name: values[name] for name in names})
        assert refused == []
        assert values_changed(config, DEFAULT) == values


def test_usable_saved_values_are_used_and_the_others_are_named() -> None:
    saved = {
        "CA_OUTER_TIME": 45, "CA_DOMAIN": 500, "CA_OLD": 1.0, "CA_ROLE": "off", "CA_UNITS": True,
        "CA_SETTLE": 10**400, "CA_INNER_DIST": 2000.0,
    }  # fmt: skip
    config, refused = with_values(DEFAULT, saved)
    assert values_changed(config, DEFAULT) == {"CA_OUTER_TIME": 45.0}
    assert refused == [
        "CA_DOMAIN: 500 refused: 0 to 180 deg",
        "CA_OLD: unknown",
        "CA_ROLE: must be a number",
        "CA_UNITS: must be a number",
        "CA_SETTLE: must be a number",
        "CA_INNER_DIST: 2000 refused: inner_radius_m must not exceed outer_radius_m",
    ]


def test_changed_settings_are_those_that_differ_from_the_configuration() -> None:
    configured = EngineConfig(engine=EngineParams(max_height_m=400.0))
    settings = Settings(configured, {"CA_HEIGHT_MAX": 0.0, "CA_OUTER_TIME": 60.0})
    assert settings.engine.max_height_m is None
    assert settings.changed == {"CA_HEIGHT_MAX": 0.0}
    settings.put(BY_NAME["CA_HEIGHT_MAX"], 400.0)
    assert settings.changed == {}
    assert settings.config == configured
