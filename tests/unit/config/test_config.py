"""Configuration files: what loads, and the one-line error for each mistake."""

import math
import re
from pathlib import Path

import pytest

from companion.config import Config, RecordingParams, describe, load_config
from companion.config.document import Leaf, parse_document
from companion.engine import EngineConfig
from companion.errors import ConfigError
from tests.support.paths import CONFIGS
from tests.unit.config.loading import LINKS, load, refusal

# --- valid files --------------------------------------------------------------------------------------


def test_only_links_are_required(tmp_path: Path) -> None:
    config = load(tmp_path, LINKS)
    assert config == Config(links=("udpin:0.0.0.0:14550",))
    assert config.recording == RecordingParams(enabled=True, directory=Path("recordings"))
    assert config.autopilot == "auto"
    assert config.for_engine() == EngineConfig()


def test_values_are_read_into_their_fields(tmp_path: Path) -> None:
    config = load(
        tmp_path,
        """
links: ["udpin:0.0.0.0:14550", "udpout:[::1]:14551"]
autopilot: px4
recording: {enabled: false, directory: /tmp/flights 1}
engine: {system_id: 7, component_id: 195}
supervisor:
  take_over_from: [MISSION]
traffic:
  stale_s: 30
  own_icao: [0x4B1234, 10]
  estimate: {position_sigma_m: 1e1}
avoidance:
  outer_time_s: 45
  envelope:
    max_bank_deg: 45
    max_turn_rate_degps: 12.5
    min_altitude_m: null
    max_altitude_m: 600
""",
    )
    assert config.links == ("udpin:0.0.0.0:14550", "udpout:[::1]:14551")
    assert config.autopilot == "px4"
    assert config.recording == RecordingParams(enabled=False, directory=Path("/tmp/flights 1"))
    assert (config.engine.system_id, config.engine.component_id) == (7, 195)
    assert config.supervisor.take_over_from == ("MISSION",)
    assert config.traffic.stale_s == 30.0
    assert isinstance(config.traffic.stale_s, float)
    assert config.traffic.own_icao == frozenset({0x4B1234, 10})
    assert config.traffic.estimate.position_sigma_m == 10.0
    assert config.avoidance.outer_time_s == 45.0
    envelope = config.avoidance.envelope
    assert envelope.max_bank_rad == math.radians(45)
    assert envelope.max_turn_rate_radps == math.radians(12.5)
    assert (envelope.min_altitude_m, envelope.max_altitude_m) == (None, 600.0)
    assert config.for_engine().avoidance is config.avoidance


def test_a_section_with_comments_only_has_its_defaults(tmp_path: Path) -> None:
    assert load(tmp_path, LINKS + "avoidance:\n  # outer_time_s: 40\n") == load(tmp_path, LINKS)


def test_a_byte_order_mark_is_ignored(tmp_path: Path) -> None:
    assert load(tmp_path, b"\xef\xbb\xbf" + LINKS.encode()) == load(tmp_path, LINKS)


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.name)
def test_each_example_loads_and_its_description_loads_to_the_same(path: Path, tmp_path: Path) -> None:
    config = load_config(str(path))
    assert config == load_config(path)
    assert load(tmp_path, describe(config)) == config


def test_there_are_examples() -> None:
    assert {"arduplane.yaml", "px4.yaml", "sitl.yaml"} <= {path.name for path in CONFIGS.glob("*.yaml")}


# --- wrong values ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("avoidance:\n  outer_time_s: -3", "3: avoidance.outer_time_s: must be at least 10 (got -3)"),
        ("avoidance:\n  outer_time_s: fast", "3: avoidance.outer_time_s: must be a number (got fast)"),
        ("avoidance:\n  outer_time_s: '60'", "3: avoidance.outer_time_s: must be a number (got 60)"),
        ("avoidance:\n  outer_time_s: true", "3: avoidance.outer_time_s: must be a number (got true)"),
        ("avoidance:\n  outer_time_s:", "3: avoidance.outer_time_s: must be a number (got nothing)"),
        ("avoidance:\n  outer_time_s: [60]", "3: avoidance.outer_time_s: must be a number"),
        ("avoidance:\n  outer_time_s: {a: 1}", "3: avoidance.outer_time_s: must not be a mapping"),
        ("avoidance:\n  outer_time_s: .nan", "3: avoidance.outer_time_s: must be a finite number (got .nan)"),
        (
            "avoidance:\n  outer_time_s: -.inf",
            "3: avoidance.outer_time_s: must be a finite number (got -.inf)",
        ),
        (
            "avoidance:\n  outer_time_s: 1e999",
            "3: avoidance.outer_time_s: must be a finite number (got 1e999)",
        ),
        ("avoidance:\n  priced_tracks: 1.5", "3: avoidance.priced_tracks: must be a whole number (got 1.5)"),
        ("avoidance:\n  priced_tracks: 2.0", "3: avoidance.priced_tracks: must be a whole number (got 2.0)"),
        ("avoidance: 3", "2: avoidance: must be a mapping (got 3)"),
        ("avoidance: [3]", "2: avoidance: must be a mapping"),
        (
            "avoidance:\n  envelope:\n    max_bank_deg: 85",
            "4: avoidance.envelope.max_bank_deg: must be less than 80 (got 85)",
        ),
        (
            "avoidance:\n  delta_beta_deg: 181",
            "3: avoidance.delta_beta_deg: must be at most 180 (got 181)",
        ),
        (
            "avoidance:\n  envelope: {min_airspeed_mps: 20, max_airspeed_mps: 10}",
            "3: avoidance.envelope: min_airspeed_mps must not exceed max_airspeed_mps",
        ),
        ("traffic: {max_tracks: 0}", "2: traffic.max_tracks: must be at least 1 (got 0)"),
        (
            "traffic: {repeat_window_s: 25}",
            "2: traffic: repeat_window_s must be less than stale_s, or hovering traffic disappears",
        ),
        ("traffic:\n  own_icao:\n  - 1\n  - x", "5: traffic.own_icao[1]: must be a whole number (got x)"),
        ("traffic: {own_icao: 3}", "2: traffic.own_icao: must be a list (got 3)"),
        ("autopilot: apm", "2: autopilot: must be 'auto', 'ardupilot' or 'px4' (got apm)"),
        ("recording: {enabled: yes}", "2: recording.enabled: must be true or false (got yes)"),
        ("recording: {enabled: 1}", "2: recording.enabled: must be true or false (got 1)"),
        ("recording: {directory: 3}", "2: recording.directory: must be text (got 3)"),
        ("supervisor: {take_over_from: []}", "2: supervisor.take_over_from: must be a list of at least 1"),
        ("supervisor: {take_over_from: [1]}", "2: supervisor.take_over_from[0]: must be text (got 1)"),
        (
            "engine:\n  position_fresh_s: 3\n  position_stale_s: 2",
            "3: engine: position_fresh_s must not exceed position_stale_s",
        ),
        (
            "avoidance:\n  outer_time_s: 30\n  well_clear_vertical_m: 80\n  inner_time_s: 40",
            "5: avoidance: inner_time_s must not exceed outer_time_s",
        ),
        (
            "avoidance:\n  well_clear_vertical_m: 80\n  envelope:\n    min_airspeed_mps: 20\n"
            "    max_airspeed_mps: 10",
            "5: avoidance.envelope: min_airspeed_mps must not exceed max_airspeed_mps",
        ),
        (
            "supervisor:\n  role: fly\n  take_over_from:\n  - MISSION\n  - AUOT",
            "6: supervisor.take_over_from[1]: no autopilot has a mode 'AUOT', did you mean AUTO?",
        ),
        (
            "supervisor:\n  take_over_from: [auto]",
            "3: supervisor.take_over_from[0]: no autopilot has a mode 'auto', did you mean AUTO?",
        ),
        (
            "supervisor: {take_over_from: [MANUAL]}",
            "2: supervisor.take_over_from[0]: MANUAL is never taken over from",
        ),
        (
            "engine:\n  max_height_m: 30\nsupervisor: {role: fly}",
            "3: engine.max_height_m must be above supervisor.min_height_m",
        ),
        (
            "supervisor:\n  min_height_m: 200\nengine:\n  max_height_m: 100",
            "5: engine.max_height_m must be above supervisor.min_height_m",
        ),
        (
            "state_file: a\nsettings_file: a",
            "3: settings_file and state_file must be two different files",
        ),
        (
            "recording:\n  enabled: true\n  max_file_mb: 10\n  max_total_mb: 5",
            "5: recording: max_total_mb must not be below max_file_mb",
        ),
    ],
)
def test_the_error_of_a_wrong_value_has_line_key_and_allowed_values(
    tmp_path: Path, text: str, message: str
) -> None:
    assert refusal(tmp_path, LINKS + text) == f"c.yaml:{message}"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("supervisor: {take_over_from: [AUTO, MANUAL]}", "MANUAL is never taken over from"),
        ("supervisor: {take_over_from: [OFFBOARD]}", "OFFBOARD is never taken over from"),
        ("supervisor: {take_over_from: [TAKEOFF]}", "TAKEOFF is never taken over from"),
        ("autopilot: px4\nsupervisor: {take_over_from: [AUTO]}", "px4 has none of these modes"),
        ("autopilot: ardupilot\nsupervisor: {take_over_from: [HOLD]}", "ardupilot has none of these modes"),
        (
            "engine: {max_height_m: 30}\nsupervisor: {min_height_m: 30}",
            "engine.max_height_m must be above supervisor.min_height_m",
        ),
    ],
)
def test_contradictory_values_are_refused(tmp_path: Path, text: str, words: str) -> None:
    assert words in refusal(tmp_path, LINKS + text)


@pytest.mark.parametrize("system_id", ["0", "255", "robot"])
def test_the_alternatives_of_a_value_are_one_message(tmp_path: Path, system_id: str) -> None:
    message = refusal(tmp_path, f"{LINKS}engine:\n  system_id: {system_id}")
    assert re.fullmatch(
        rf"c\.yaml:3: engine\.system_id: must be 'auto' or (at least 1|at most 254|a whole number) "
        rf"\(got {system_id}\)",
        message,
    )


def test_the_first_of_several_mistakes_is_reported(tmp_path: Path) -> None:
    text = "avoidance:\n  inner_time_s: -1\n  outer_time_s: -3\nautopilot: apm\n"
    assert refusal(tmp_path, text + LINKS).startswith("c.yaml:2: avoidance.inner_time_s: ")


def test_a_long_value_is_shortened_in_the_message(tmp_path: Path) -> None:
    message = refusal(tmp_path, LINKS + "autopilot: " + "x" * 500)
    assert message.endswith("(got " + "x" * 60 + "...)")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("autopilot: px4", "1: links: is required"),
        ("links: []", "1: links: must be a list of at least 1"),
        ("links: 'udpin:0.0.0.0:1'", "1: links: must be a list (got udpin:0.0.0.0:1)"),
        ("links:\n- 14550", "2: links[0]: must be text (got 14550)"),
        ("links:\n- udpin:a:1\n- udpin:a:1", "1: links: the same address is given twice"),
        (
            "links:\n- udpin:a:1\n- upd:a:2",
            "3: links[1]: 'upd:a:2' is not a link address: "
            "use udpin|udpout|tcpin|tcpout:HOST:PORT or serial:/dev/NAME:BAUD",
        ),
        ("links: ['udpout:a:0']", "1: links[0]: udpout:a:0: port 0 cannot be sent to"),
    ],
)
def test_the_error_of_a_wrong_link(tmp_path: Path, text: str, message: str) -> None:
    assert refusal(tmp_path, text) == f"c.yaml:{message}"


# --- wrong keys --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("avoidence: {}", "2: avoidence: is unknown, did you mean avoidance?"),
        (
            "avoidance:\n  outer_times: 3",
            "3: avoidance.outer_times: is unknown, did you mean outer_time_s?",
        ),
        (
            "avoidance:\n  delta_beta_rad: 0.1",
            "3: avoidance.delta_beta_rad: is unknown, did you mean delta_beta_deg?",
        ),
        (
            "recording: {zzz: 1}",
            "2: recording.zzz: is unknown, allowed are directory, enabled, max_file_mb, max_total_mb",
        ),
        ("autopilot: px4\nautopilot: px4", "3: autopilot: is a duplicate of line 2"),
        (
            "avoidance:\n  outer_time_s: 3\n  outer_time_s: 4",
            "4: outer_time_s: is a duplicate of line 3",
        ),
        ("3: 4", "2: a key must be text"),
        ("[a]: 4", "2: a key must be text"),
        ("null: 4", "2: a key must be text"),
        ("<<: {autopilot: px4}", "2: <<: is unknown, allowed are "),
    ],
)
def test_the_error_of_a_wrong_key(tmp_path: Path, text: str, message: str) -> None:
    assert refusal(tmp_path, LINKS + text).startswith(f"c.yaml:{message}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('"a\\nb\\e[31m": 1', "2: a b?[31m: is unknown, "),
        ("x" * 500 + ": 1", "2: " + "x" * 60 + "...: is unknown, "),
        (
            "? " + "x" * 5000 + "\n: 1\n? " + "x" * 5000 + "\n: 1",
            "4: " + "x" * 60 + "...: is a duplicate of ",
        ),
        ("a: !" + "x" * 5000 + " {}", "2: tags (!" + "x" * 59 + "...) are not supported"),
        ('autopilot: "a\\nb"', "2: autopilot: must be 'auto', 'ardupilot' or 'px4' (got a b)"),
    ],
    ids=["control characters", "long key", "long key twice", "long tag", "two lines"],
)
def test_quoted_text_in_a_message_is_short_and_printable(tmp_path: Path, text: str, message: str) -> None:
    assert refusal(tmp_path, LINKS + text).startswith(f"c.yaml:{message}")


def test_a_long_address_is_shortened_in_the_message(tmp_path: Path) -> None:
    assert len(refusal(tmp_path, f"links: ['{'x' * 5000}']")) < 250


# --- files that are not a configuration --------------------------------------------------------------


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^.*/none\.yaml: cannot be read: No such file or directory$"):
        load_config(tmp_path / "none.yaml")
    with pytest.raises(ConfigError, match=r": cannot be read: Is a directory$"):
        load_config(tmp_path)


@pytest.mark.parametrize("text", ["", "\n\n", "# only a comment\n", "---\n", "~", "null\n"])
def test_an_empty_file_is_refused(tmp_path: Path, text: str) -> None:
    assert refusal(tmp_path, text) == "c.yaml: is empty"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- links", "1: must be a mapping of keys to values"),
        ("\nlinks", "2: must be a mapping of keys to values"),
        (LINKS + "a: [1, 2", "2: not valid YAML: expected ',' or ']', but got '<stream end>'"),
        (LINKS + "\ta: 1", "2: not valid YAML: found character '\\t' that cannot start any token"),
        (LINKS + "---\n" + LINKS, "2: not valid YAML: but found another document"),
        (LINKS + "a: \x00", "2: not valid YAML: special characters are not allowed"),
        (LINKS.encode() + b"a: \xff\xfe", "2: is not UTF-8 text"),
        (LINKS + "a: !!python/object:os.system 1", "2: tags (tag:yaml.org,2002:python/object:os.system)"),
        (LINKS + "a: !mine {}", "2: tags (!mine) are not supported"),
        (LINKS + "a: !!set {b}", "2: tags (tag:yaml.org,2002:set) are not supported"),
        (LINKS + "a: !!int b", "2: tags (tag:yaml.org,2002:int) are not supported"),
        (LINKS + "a: &b 1\nc: *b", "2: anchors (&) and aliases (*) are not supported"),
        (LINKS + "a: *b", "2: anchors (&) and aliases (*) are not supported"),
        (LINKS + "a: " + "9" * 5000, "2: a number with 5000 characters"),
        (LINKS + "a: " + "[" * 100_000, "2: is nested too deeply"),
        (LINKS + "a: " + "{b: " * 50, "2: is nested too deeply"),
        (LINKS + "a: [" + "1, " * 20_000 + "1]", "2: has too many values, this is not a configuration"),
        ("#" * (1 << 20) + "\n" + LINKS, " is larger than 1 MiB, this is not a configuration"),
    ],
    ids=lambda value: str(value)[:40].encode("ascii", "replace").decode() if isinstance(value, str) else "",
)
def test_a_file_that_is_not_a_configuration_is_refused(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    assert refusal(tmp_path, text).startswith(f"c.yaml:{message}")


def test_nested_aliases_are_refused_before_they_expand(tmp_path: Path) -> None:
    bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n"
    for before, here in zip("abcdefgh", "bcdefghi", strict=True):
        bomb += f"{here}: &{here} [" + ", ".join([f"*{before}"] * 9) + "]\n"
    assert refusal(tmp_path, bomb) == "c.yaml:1: anchors (&) and aliases (*) are not supported"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0),
        (".5", 0.5),
        ("-2.", -2.0),
        ("+7", 7),
        ("010", 10),
        ("0x1F", 31),
        ("0o17", 15),
        ("True", True),
        ("no", "no"),
        ("on", "on"),
        ("12:30", "12:30"),
        ("2024-01-01", "2024-01-01"),
        ("1_000", "1_000"),
        ("'3'", "3"),
        ("", None),
        ("''", ""),
        ("!!float 3", 3.0),
        ("!!str 3", "3"),
    ],
)
def test_scalars_follow_the_core_schema(text: str, value: object) -> None:
    _, leaf = parse_document(f"a: {text}", "t").entries["a"]
    assert isinstance(leaf, Leaf)
    assert leaf.value == value
    assert type(leaf.value) is type(value)
