"""The compiled modules as plain Python, as where there is no C compiler: equal to the last bit."""

import subprocess
import sys
from pathlib import Path

import pytest

from companion.compiled import kernels, slow_notice
from tests.support.decisions import decisions
from tests.support.paths import CONFIGS, ROOT

compiled = pytest.mark.skipif(not kernels.COMPILED, reason="nothing is compiled here (make compiler)")


def plain(code: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run code in a process of its own, after the plain modules are loaded."""
    return subprocess.run(
        [sys.executable, "-c", f"import tests.support.plain_python\n{code}", *words],
        cwd=ROOT, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


@compiled
def test_decisions_and_flight_are_equal_to_the_last_bit() -> None:
    result = plain("from tests.support.decisions import decisions; print(*decisions(), sep='\\n')")
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    assert lines == list(decisions())
    assert sum("layer=<Layer.CLEAR" not in line for line in lines) > 100, "most of them avoid something"


@compiled
def test_a_campaign_has_equal_results(tmp_path: Path) -> None:
    words = ("campaign", "--encounters", "1", "--workers", "1", "--surveillance", "poor", "--results")
    slow, fast = tmp_path / "slow.ndjson", tmp_path / "fast.ndjson"
    assert plain("from sim.cli import main; main()", *words, str(slow)).returncode == 0
    code = "from sim.cli import main; main()"
    subprocess.run([sys.executable, "-c", code, *words, str(fast)], check=True, capture_output=True)
    assert results(slow) == results(fast)


def results(path: Path) -> list[str]:
    """The lines of a campaign without how long its decisions took."""
    return [line.partition('"timing"')[0] for line in path.read_text().splitlines()]


@compiled
def test_the_same_tests_pass() -> None:
    files = ("property/test_kernel_properties.py", "property/test_assessment_kernel_properties.py")
    result = plain(
        "import pytest, sys; sys.exit(pytest.main(sys.argv[1:]))",
        "-q", "-p", "no:cacheprovider", *(f"tests/{name}" for name in (*files, "unit/sim/test_dynamics.py")),
    )  # fmt: skip
    assert result.returncode == 0, result.stdout


def test_one_line_says_that_it_is_slow() -> None:
    code = "from companion.cli import main; main()"
    result = plain(code, "check", str(CONFIGS / "sitl.yaml"))
    assert result.returncode == 0
    assert result.stderr.startswith("Companion runs without its compiled part")
    assert len(result.stderr.splitlines()) == 1


@compiled
def test_nothing_is_said_where_it_is_compiled() -> None:
    assert slow_notice() is None
