"""What README.md and REFERENCE.md show works as it stands, and says what the code does.

Where a table or a picture differs from the code, `make pictures` redraws it.
"""

import os
import re
import shlex
import signal
import time
import tomllib
from functools import cache
from pathlib import Path

import pytest

import companion
from companion.avoidance import AvoidanceParams
from companion.config import Config, load_config, load_obstacles
from companion.control.state_machine import SupervisorParams
from companion.model import Role
from companion.sources.registry import FORMATS, decoder_class
from companion.traffic import TrafficParams
from sim.members.scenario import formation_names
from sim.scenario import load_scenario, scenario_names
from tests.support.commands import call
from tests.support.paths import ROOT
from tests.tools.documents import README, REFERENCE, parameter_rows, parameter_rows_in
from tests.tools.pictures import Terminal, demo_words, panel_in, shape_of

README_TEXT, REFERENCE_TEXT = README.read_text(encoding="utf-8"), REFERENCE.read_text(encoding="utf-8")
BOTH = README_TEXT + REFERENCE_TEXT
CONTRIBUTING_TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
DOCUMENTS = {
    name: (ROOT / name).read_text(encoding="utf-8")
    for name in ("README.md", "REFERENCE.md", "CONTRIBUTING.md", "CHANGELOG.md")
}
PROGRAMS = ("companion", "companion-sim")


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


# --- configurations


def test_the_configuration_with_obstacles_and_fences_loads(tmp_path: Path) -> None:
    for block in blocks(REFERENCE_TEXT, "yaml"):
        name = block.splitlines()[0].removeprefix("# ")
        (tmp_path / name).write_text(block)
    (geojson,) = blocks(REFERENCE_TEXT, "json")
    (tmp_path / "power-lines.geojson").write_text(geojson)
    config = load_config(tmp_path / "companion.yaml")
    assert [zone.inclusion for zone in config.fences] == [True, False]
    names = {obstacle.name for obstacle in load_obstacles(config)}
    assert names == {"Radio mast", "Wind turbine", "Line 4"}


@pytest.mark.parametrize("block", blocks(README_TEXT, "yaml"))
def test_what_the_readme_says_to_configure_loads(block: str, tmp_path: Path) -> None:
    links = "" if "links:" in block else 'links: ["udpin:127.0.0.1:14550"]\n'
    (tmp_path / "companion.yaml").write_text(links + block)
    load_config(tmp_path / "companion.yaml")


def test_the_shortest_configuration_is_enough(tmp_path: Path) -> None:
    (written,) = re.findall(r"^echo '(.*)' > arduplane-sitl.yaml$", README_TEXT, re.MULTILINE)
    (tmp_path / "arduplane-sitl.yaml").write_text(written)
    assert load_config(tmp_path / "arduplane-sitl.yaml").links == ("tcpout:127.0.0.1:5762",)


# --- tables


def test_the_roles_have_the_numbers_of_the_code() -> None:
    table = dict(re.findall(r"^\| `(off|advise|fly)` \|.*\| (\d) \|$", REFERENCE_TEXT, re.MULTILINE))
    assert {name: int(number) for name, number in table.items()} == {
        role.name.lower(): role.value for role in Role
    }


def test_the_parameters_are_those_of_the_code() -> None:
    assert parameter_rows_in(REFERENCE_TEXT) == parameter_rows(), "make pictures rewrites the table"


def test_the_scenarios_are_those_that_come_with_the_package() -> None:
    (section,) = re.findall(r"^## Scenarios and faults\n(.*?)^## ", REFERENCE_TEXT, re.MULTILINE | re.DOTALL)
    rows = re.findall(r"^\| (`.*?) \|", section, re.MULTILINE)
    assert sorted(re.findall(r"`([\w-]+)`", " ".join(rows))) == sorted(
        [*scenario_names(), *formation_names()]
    )


def test_the_defaults_are_those_of_the_code() -> None:
    avoidance, supervisor, traffic = AvoidanceParams(), SupervisorParams(), TrafficParams()
    recording = Config(links=("udpin:127.0.0.1:14550",)).recording
    for said in (
        f"from {avoidance.outer_time_s:g} s before the closest approach, "
        f"or within {avoidance.outer_radius_m:g} m",
        f"from {avoidance.inner_time_s:g} s, or within {avoidance.inner_radius_m:g} m",
        f"{avoidance.well_clear_horizontal_m:g} m or {avoidance.well_clear_vertical_m:g} m",
        f"plus {100 * avoidance.horizontal_margin:g} % and {100 * avoidance.vertical_margin:g} %",
        f"by {100 * avoidance.release_margin:g} % more than needed",
        f"`settle_s` ({supervisor.settle_s:g} s)",
        f"`abandoned_s` ({supervisor.abandoned_s:g} s)",
        f"`traffic.stale_s` ({traffic.stale_s:g} s)",
        f"`max_file_mb` ({recording.max_file_mb})",
        f"`max_total_mb` ({recording.max_total_mb})",
    ):
        assert said in REFERENCE_TEXT


@pytest.mark.parametrize("key", sorted(set(re.findall(r"\b[a-z]+_[a-z0-9_]+\b", REFERENCE_TEXT.split(
    "## Reports for machines")[1].split("\n## ")[0]))))  # fmt: skip
def test_the_keys_of_reports_are_written_somewhere(key: str) -> None:
    assert re.search(rf'"{key}"|\b{key}:', sources()), key


# --- commands


def commands(text: str) -> list[tuple[str, ...]]:
    """The commands of our own programs: program, and its words."""
    found = []
    for line in "\n".join(blocks(text, "")).splitlines() + re.findall(r"`([^`\n]+)`", text):
        words = line.partition("   #")[0].strip()
        match = re.match(r"(?:sudo -u \w+ )?(?:\S*/bin/)?(companion|companion-sim) (?=[a-z])(.*)", words)
        if match is not None and not re.search(r"[…|]", words):
            found.append((match[1], *shlex.split(match[2])))
    return list(dict.fromkeys(found))


@cache
def helped(program: str, command: str) -> str:
    """The help of a command."""
    module = {"companion": "companion", "companion-sim": "sim"}[program]
    result = call(command, "--help", module=module, COLUMNS="200", NO_COLOR="1")
    return result.stdout if result.returncode == 0 else ""


@pytest.mark.parametrize("words", commands(BOTH), ids=" ".join)
def test_a_command_has_the_options_that_are_shown(words: tuple[str, ...]) -> None:
    program, command, *rest = words
    text = helped(program, command)
    assert text, f"{program} has no command {command}"
    for option in (word for word in rest if word.startswith("--")):
        assert re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", text), option


@pytest.mark.parametrize(
    "target", sorted(set(re.findall(r"(?:^|`)make ([a-z]+)(?:`|$)", BOTH + CONTRIBUTING_TEXT, re.M)))
)
def test_make_knows_the_target(target: str) -> None:
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE)


# --- files, links, pictures


NAMED = r"(?<![/\w.])(?:configs|companion|sim|tests)/[\w/.*-]*\w"


@pytest.mark.parametrize("path", sorted(set(re.findall(NAMED, "".join(DOCUMENTS.values())))))
def test_every_file_that_is_named_exists(path: str) -> None:
    assert [*ROOT.glob(path), *ROOT.glob(f"{path}.py")], path


def anchors(text: str) -> set[str]:
    """The anchors of the headings, as code hosts make them."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_link_leads_somewhere(document: str) -> None:
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", DOCUMENTS[document]):
        path, _, anchor = target.partition("#")
        assert (ROOT / path).exists(), target
        if anchor:
            assert anchor in anchors(DOCUMENTS[path or document]), target


def test_the_contents_name_every_section_in_order() -> None:
    for document in ("README.md", "REFERENCE.md"):
        text = DOCUMENTS[document]
        (contents,) = re.findall(r"^\*\*Contents:\*\*.*?\n\n", text, re.MULTILINE | re.DOTALL)
        sections = re.findall(r"^## (.*)$", text, re.MULTILINE)
        assert [words for words, _ in re.findall(r"\[([^]]+)\]\(#([^)]+)\)", contents)] == [
            section if section in contents else section.partition(":")[0] for section in sections
        ]


def test_the_rooms_of_the_picture_are_folders() -> None:
    picture = (ROOT / "architecture.svg").read_text(encoding="utf-8")
    rooms = re.findall(r"\b([a-z]+)/(?=[,<])", picture)
    assert len(set(rooms)) >= 10
    assert [room for room in rooms if not (ROOT / "companion" / room).is_dir()] == []


def test_the_readme_stays_on_one_page() -> None:
    assert len(README_TEXT.split()) <= 3100, "move tables to REFERENCE.md"


# --- what is printed


@cache
def sources() -> str:
    return "\n".join(
        path.read_text(encoding="utf-8")
        for room in ("companion", "sim")
        for path in (ROOT / room).rglob("*.py")
    )


def messages() -> list[str]:
    """What the table of troubles quotes; "…" stands for what varies."""
    (section,) = re.findall(r"^## Troubleshooting\n(.*?)^## ", README_TEXT, re.MULTILINE | re.DOTALL)
    cells = re.findall(r"^\| ([^|]*`[^|]*) \|", section, re.MULTILINE)
    quotes = [
        *re.findall(r"`([^`]+)`", "\n".join(cells)),
        "its mode is",
        "it is disarmed",
        "it is on the ground",
    ]
    parts = [part.strip() for quote in quotes for part in quote.split("…")]
    by_the_system = {os.strerror(number) for number in range(1, 130)}
    return sorted({part for part in parts if part and part not in by_the_system})


@pytest.mark.parametrize("message", messages())
def test_a_message_of_the_troubleshooting_is_one_of_the_code(message: str) -> None:
    assert message in sources()


@pytest.mark.wire
def test_the_demo_shows_what_the_readme_promises(tmp_path: Path) -> None:
    terminal = Terminal(demo_words("--no-web", "--speedup", "20", "--scenario", "head-on"), tmp_path)
    try:
        deadline_s = time.monotonic() + 60.0
        while "outer:" not in terminal.panel and time.monotonic() < deadline_s:
            time.sleep(0.1)
        shown = terminal.panel
        terminal.process.send_signal(signal.SIGINT)
        terminal.wait()
    finally:
        terminal.process.kill()
    assert "outer:" in shown
    assert shape_of(panel_in(README_TEXT)) == shape_of(shown), "make pictures redraws the panel"


def test_the_demo_takes_about_the_minute_that_the_readme_promises() -> None:
    (speedup,) = re.findall(r"(\d+) x ─", panel_in(README_TEXT))
    assert "After about a minute" in README_TEXT
    assert 45.0 <= load_scenario("two-intruders").duration_s / float(speedup) <= 90.0


def test_the_version_is_the_newest_release_of_the_changelog() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        version = tomllib.load(file)["project"]["version"]
    released = re.findall(r"^## \[(\d[\w.]*)\] - \d{4}-\d\d-\d\d$", DOCUMENTS["CHANGELOG.md"], re.MULTILINE)
    assert companion.__version__ == version == released[0]


@pytest.mark.parametrize("name", FORMATS)
def test_the_table_of_receivers_is_that_of_the_registry(name: str) -> None:
    kind = decoder_class(name)
    row = next(line for line in README_TEXT.splitlines() if line.startswith(f"| {kind.title} |"))
    assert f"`{name}:" in row
    assert kind.lacks in row
