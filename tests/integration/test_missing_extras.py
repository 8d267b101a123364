"""Commands without the optional packages that they need: one line that says what to install."""

import subprocess
import sys
from pathlib import Path

import pytest

WITHOUT = "import sys; sys.modules[sys.argv.pop(1)] = None; from {package}.cli import main; main()"


def call(package: str, missing: str, *words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in an empty folder as if `missing` were not installed."""
    return subprocess.run(
        [sys.executable, "-c", WITHOUT.format(package=package), missing, *words],
        cwd=folder, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("package", "missing", "words", "line"),
    [
        ("companion", "matplotlib", ("report", "flight.tlog"),
         "companion report needs matplotlib: pip install 'mavlink-companion[report]'"),
        ("sim", "matplotlib", ("paper", "--out", "results"),
         "companion-sim paper --out needs matplotlib: pip install 'mavlink-companion[sim]'"),
        ("sim", "matplotlib", ("campaign", "--page", "page.html"),
         "companion-sim campaign --page needs matplotlib: pip install 'mavlink-companion[sim]'"),
        ("sim", "matplotlib", ("evidence", "--out", "results"),
         "companion-sim evidence needs matplotlib: pip install 'mavlink-companion[sim]'"),
        ("sim", "matplotlib", ("encounter", "1", "--out", "one.png"),
         "companion-sim encounter --out needs matplotlib: pip install 'mavlink-companion[sim]'"),
        ("sim", "distributed", ("campaign", "--scheduler", "tcp://127.0.0.1:9"),
         "companion-sim campaign --scheduler needs distributed: pip install 'mavlink-companion[sim]'"),
        ("sim", "pyrvo", ("campaign", "--avoider", "orca", "--encounters", "1"),
         "orca needs the pyrvo package: make orca, or pip install 'mavlink-companion[orca]'"),
    ],
    ids=["report", "paper", "page", "evidence", "encounter", "scheduler", "orca"],
)  # fmt: skip
def test_a_command_says_what_to_install(
    package: str, missing: str, words: tuple[str, ...], line: str, tmp_path: Path
) -> None:
    result = call(package, missing, *words, folder=tmp_path)
    assert (result.returncode, result.stderr) == (2, line + "\n")
    assert not list(tmp_path.iterdir()), "nothing is written before"


@pytest.mark.parametrize(
    "words",
    [("paper", "--table"), ("campaign", "--encounters", "2", "--workers", "1"), ("encounter", "1")],
    ids=["strategy table", "campaign", "encounter"],
)
def test_what_draws_nothing_needs_no_matplotlib(words: tuple[str, ...], tmp_path: Path) -> None:
    result = call("sim", "matplotlib", *words, folder=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
