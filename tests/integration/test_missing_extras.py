"""Commands without the optional packages that they need: one line that says what to install."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.thorough import sample

WITHOUT = "import sys; sys.modules[sys.argv.pop(1)] = None; from {package}.cli import main; main()"


def call(package: str, missing: str, *words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in an empty folder as if `missing` were not installed."""
    return subprocess.run(
        [sys.executable, "-c", WITHOUT.format(package=package), missing, *words],
        cwd=folder, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


# Program, package that it lacks, words, and what it says. `make test` tries each package, and each program.
ASKED: dict[str, tuple[str, str, tuple[str, ...], str]] = {
    "report": ("companion", "matplotlib", ("report", "flight.tlog"),
        "companion report needs matplotlib: pip install 'mavlink-companion[report]'"),
    "paper": ("sim", "matplotlib", ("paper", "--out", "results"),
        "companion-sim paper --out needs matplotlib: pip install 'mavlink-companion[sim]'"),
    "page": ("sim", "matplotlib", ("campaign", "--page", "page.html"),
        "companion-sim campaign --page needs matplotlib: pip install 'mavlink-companion[sim]'"),
    "evidence": ("sim", "matplotlib", ("evidence", "--out", "results"),
        "companion-sim evidence needs matplotlib: pip install 'mavlink-companion[sim]'"),
    "encounter": ("sim", "matplotlib", ("encounter", "1", "--out", "one.png"),
        "companion-sim encounter --out needs matplotlib: pip install 'mavlink-companion[sim]'"),
    "scheduler": ("sim", "distributed", ("campaign", "--scheduler", "tcp://127.0.0.1:9"),
        "companion-sim campaign --scheduler needs distributed: pip install 'mavlink-companion[sim]'"),
    "orca": ("sim", "pyrvo", ("campaign", "--avoider", "orca", "--encounters", "1"),
        "orca needs the pyrvo package: make orca, or pip install 'mavlink-companion[orca]'"),
}  # fmt: skip


@pytest.mark.parametrize("asked", sample(["report", "page", "scheduler", "orca"], [*ASKED]))
def test_a_command_says_what_to_install(asked: str, tmp_path: Path) -> None:
    package, missing, words, line = ASKED[asked]
    result = call(package, missing, *words, folder=tmp_path)
    assert (result.returncode, result.stderr) == (2, line + "\n")
    assert not list(tmp_path.iterdir()), "nothing is written before"


WORDS = [("campaign", "--encounters", "2", "--workers", "1"), ("paper", "--table"), ("encounter", "1")]


@pytest.mark.parametrize("words", sample(WORDS[:1], WORDS), ids=lambda words: words[0])
def test_what_draws_nothing_needs_no_matplotlib(words: tuple[str, ...], tmp_path: Path) -> None:
    result = call("sim", "matplotlib", *words, folder=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
