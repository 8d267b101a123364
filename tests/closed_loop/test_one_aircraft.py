"""One aircraft by four receivers at once, with different delays and two references of altitude."""

import pytest

from tests.support.one_aircraft import LASTS_S, RECEIVERS, SETTLED_S, STEP_S, Errors, errors_of
from tests.tools import sources

SEEDS = (0, 1)
MOMENTS = len(SEEDS) * round((LASTS_S - SETTLED_S) / STEP_S)
# The best of them is not known in flight: a track of all may be so much worse than that of the best alone.
ABOUT_THE_BEST = 1.5


@pytest.fixture(scope="module")
def together() -> Errors:
    return errors_of(list(RECEIVERS), SEEDS)


@pytest.fixture(scope="module")
def alone() -> dict[str, Errors]:
    return {name: errors_of([name], SEEDS) for name in RECEIVERS}


def test_it_is_one_track_at_every_moment(together: Errors) -> None:
    assert together.tracks == [1] * MOMENTS


def test_the_track_of_all_is_about_as_good_as_that_of_the_best_alone(
    together: Errors, alone: dict[str, Errors]
) -> None:
    figures = [errors.figures() for errors in alone.values()]
    for measure, (rms, _) in together.figures().items():
        best = min(each[measure][0] for each in figures)
        assert rms <= ABOUT_THE_BEST * best, measure


def test_each_alone_is_one_track_with_the_right_height(alone: dict[str, Errors]) -> None:
    """By pressure, above the ellipsoid or relative to us: 60 m and 40 m would be seen."""
    for name, errors in alone.items():
        assert errors.tracks == [1] * MOMENTS, name
        assert errors.figures()["vertical_m"][1] < 8.0, name


def test_the_table_has_a_line_for_each_and_for_all(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["sources", "--seeds", "1"])
    sources.main()
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[2:]] == [*RECEIVERS, "all"]
