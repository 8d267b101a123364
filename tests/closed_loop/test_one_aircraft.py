"""One aircraft by four receivers at once, with different delays and two references of altitude."""

import pytest

from tests.support.one_aircraft import LASTS_S, PATHS, RECEIVERS, SETTLED_S, STEP_S, Errors, errors_of
from tests.tools import sources

SEEDS, MANY_SEEDS = (0, 1), range(20, 24)
MOMENTS = len(SEEDS) * round((LASTS_S - SETTLED_S) / STEP_S)
# Of two equal ones, one is better by chance.
NO_WORSE = 1.05


@pytest.fixture(scope="module")
def together() -> Errors:
    return errors_of(list(RECEIVERS), SEEDS)


@pytest.fixture(scope="module")
def alone() -> dict[str, Errors]:
    return {name: errors_of([name], SEEDS) for name in RECEIVERS}


def test_it_is_one_track_at_every_moment(together: Errors) -> None:
    assert together.tracks == [1] * MOMENTS


@pytest.mark.parametrize("path", PATHS)
def test_the_track_of_all_is_no_worse_than_that_of_the_best_alone(path: str) -> None:
    """The delays that some do not state are found, and late reports are of use: RMS and 95 %."""
    alone = [errors_of([name], MANY_SEEDS, path).figures() for name in RECEIVERS]
    together = errors_of(list(RECEIVERS), MANY_SEEDS, path)
    assert set(together.tracks) == {1}
    for measure, figures in together.figures().items():
        best = [min(values) for values in zip(*(each[measure] for each in alone), strict=True)]
        assert figures[0] <= NO_WORSE * best[0], measure
        assert figures[1] <= NO_WORSE * best[1], measure


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
