"""Encounters: generated, sampled from models, read from files; and the surveillance of them."""

import math
from pathlib import Path as FilePath

import numpy as np
import pytest

from companion.errors import ConfigError
from sim.encounters import (
    KINDS,
    SURVEILLANCE_PRESETS,
    Encounter,
    EncounterModel,
    Observer,
    Surveillance,
    generate,
    passing,
    read_encounters,
    read_model,
    sample,
    write_encounters,
)
from sim.encounters.sampling import WINDOW_HORIZONTAL_M
from tests.support.paths import DAA_SCENARIOS, ENCOUNTER_MODELS

DAA = "name sx sy sz trk gs vs time\n[none] [m] [m] [m] [deg] [m/s] [m/s] [s]\n"
# The smallest possible model: 60 to 90 kt, level, or climbing once a climb has begun.
SMALL = """# labels_initial
"G", "A", "L", "v", "dv", "dh", "dpsi"
# G_initial
0 0 0 0 0 0 0
0 0 0 0 0 0 0
0 0 0 0 0 0 0
0 0 0 0 0 0 0
0 0 0 0 0 0 0
0 0 0 0 0 0 0
0 0 0 0 0 0 0
# r_initial
1 1 1 1 1 2 1
# N_initial
5 5 5 5 5 3 1 5
# labels_transition
"G", "A", "L", "v", "dv", "dh", "dpsi", "dv1", "dh1", "dpsi1"
# G_transition
0 0 0 0 0 0 0 0 0 0
0 0 0 0 0 0 0 0 0 0
0 0 0 0 0 0 0 0 0 0
0 0 0 0 0 0 0 0 0 0
0 0 0 0 0 0 0 1 0 0
0 0 0 0 0 0 0 0 1 0
0 0 0 0 0 0 0 0 0 1
0 0 0 0 0 0 0 0 0 0
0 0 0 0 0 0 0 0 0 0
0 0 0 0 0 0 0 0 0 0
# r_transition
1 1 1 1 1 2 1 1 2 1
# N_transition
1 3 1 0 1 1
# boundaries
*
*
500 1200
60 90
-1 1
-250 250 750
-1.5 1.5
# resample_rates
0 0 0 0 0 0 0
"""


@pytest.fixture
def small(tmp_path: FilePath) -> EncounterModel:
    path = tmp_path / "small.txt"
    path.write_text(SMALL)
    return read_model(path)


def nearest_m(encounter: Encounter) -> float:
    first = encounter.intruders[0]
    return passing(
        encounter.own_position_m, encounter.own_velocity_mps, first, encounter.duration_s
    ).horizontal_m


def test_the_counts_of_a_model_are_read_column_by_column(small: EncounterModel) -> None:
    """N of the climb a second later: from level, 3 of 4 stay level; from climbing, all continue."""
    (_, climb, _) = small.transition
    assert climb.shares == ((0.75,), (0.0,))
    assert climb.draw([0, 0, 0, 0, 0, 0, 0], 0.74) == 0
    assert climb.draw([0, 0, 0, 0, 0, 0, 0], 0.76) == 1
    assert climb.draw([0, 0, 0, 0, 0, 1, 0], 0.01) == 1


def test_drawn_paths_follow_the_model(small: EncounterModel) -> None:
    rng = np.random.default_rng(1)
    begins_level = 0
    for _ in range(400):
        path = small.draw(rng, 20)
        speed_mps = np.hypot(path.velocity_mps[:, 0], path.velocity_mps[:, 1])
        climbs = -path.velocity_mps[:, 2] > 0.0
        assert ((speed_mps > 30.0) & (speed_mps < 46.4)).all()
        assert (np.diff(climbs.astype(int)) >= 0).all(), "a climb continues"
        assert (np.abs(path.velocity_mps[:, 1]) < 1e-9).all(), "the bin around zero gives no turn"
        begins_level += not climbs[0]
    assert 0.69 < begins_level / 400 < 0.81


@pytest.mark.parametrize("name", ENCOUNTER_MODELS)
def test_drawn_speeds_and_layers_are_as_frequent_as_counted(name: str) -> None:
    model = read_model(ENCOUNTER_MODELS[name])
    rng = np.random.default_rng(2)
    chances = rng.random((4000, 14)).tolist()
    begun = np.array([model._begin(iter(row))[0] for row in chances])
    # The shares of a root variable are those of the file.
    roots = np.diff([0.0, *model.initial[0].shares[0], 1.0])
    drawn = np.bincount(begun[:, 0], minlength=len(roots)) / len(begun)
    assert np.abs(drawn - roots).max() < 0.03


def test_broken_models_are_one_clear_line(tmp_path: FilePath) -> None:
    for broken in (
        SMALL.replace("5 5 5 5 5 3 1 5", "5 5 5 5 5 3 1"),
        SMALL.replace("5 5 5 5 5 3 1 5", "5 5 5 5 5 -3 1 5"),
        SMALL.replace("5 5 5 5 5 3 1 5", "5 5 five"),
        SMALL.replace("# boundaries", "# borders"),
        SMALL.replace("500 1200", "500 1200 3000"),
        SMALL.replace("1 1 1 1 1 2 1 1 2 1", "1 1"),
        "nothing\n",
        "",
    ):
        path = tmp_path / "broken.txt"
        path.write_text(broken)
        with pytest.raises(ConfigError, match=r"broken\.txt.*no encounter model") as caught:
            read_model(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(ConfigError, match="No such file"):
        read_model(tmp_path / "missing.txt")


def test_sampled_encounters_depend_on_seed_and_number_alone(small: EncounterModel) -> None:
    one, again, other = (sample([small], 3, number) for number in (7, 7, 8))
    assert one.weight == again.weight
    assert (one.intruders[0].position_m == again.intruders[0].position_m).all()
    assert one.intruders[0].position_m.tolist() != other.intruders[0].position_m.tolist()
    assert len(sample([small], 3, 7, intruders=4).intruders) == 4


def test_weights_correct_for_oversampling(small: EncounterModel) -> None:
    """Weighted misses are uniform over the window; these aircraft never turn, so the miss is as placed."""
    drawn = [sample([small], 4, number) for number in range(800)]
    miss_m = np.array([nearest_m(encounter) for encounter in drawn])
    # Divide out the weight of the closing speed.
    weights = np.array([encounter.weight / encounter.closing_mps for encounter in drawn])
    counted, _ = np.histogram(miss_m, bins=4, range=(0.0, WINDOW_HORIZONTAL_M), weights=weights)
    unweighted, _ = np.histogram(miss_m, bins=4, range=(0.0, WINDOW_HORIZONTAL_M))
    assert np.abs(counted / counted.sum() - 0.25).max() < 0.07
    assert unweighted[0] / unweighted.sum() > 0.5, "half of the samples are in the core"


@pytest.mark.parametrize("kind", KINDS)
def test_generated_encounters_hit_or_miss_as_requested(kind: str) -> None:
    for number in range(20):
        hit, miss = (generate(kind, 5, number, hits=hits) for hits in (True, False))
        assert nearest_m(hit) < 10.0
        assert hit.nominal_vertical_m < 10.0
        assert hit.nominal_horizontal_m == nearest_m(hit)
        assert miss.own_position_m[2] < -100.0
        again = generate(kind, 5, number, hits=True)
        assert (again.intruders[0].position_m == hit.intruders[0].position_m).all()
    assert len(generate("formation", 1, 1).intruders) == 2
    assert 2 <= len(generate("together", 1, 1).intruders) <= 4


def test_paths_are_smooth_between_their_points_and_straight_beyond() -> None:
    encounter = generate("turning", 1, 2)
    path = encounter.intruders[0]
    times = np.linspace(-10.0, 130.0, 1401)
    speed_mps = np.hypot(*np.gradient(path.positions_m(times), 0.1, axis=0)[:, :2].T)
    flown_mps = np.hypot(path.velocity_mps[0, 0], path.velocity_mps[0, 1])
    assert np.abs(speed_mps - flown_mps).max() < 0.5


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ConfigError, match="no such kind"):
        generate("zigzag", 0, 0)


def test_written_csv_is_read_back_unchanged(tmp_path: FilePath) -> None:
    written = [generate("mix", 6, number) for number in range(5)]
    path = tmp_path / "encounters.csv"
    write_encounters(path, written)
    read = read_encounters(path)
    assert [one.encounter_id for one in read] == [one.encounter_id for one in written]
    for one, back in zip(written, read, strict=True):
        assert back.own_position_m == one.own_position_m
        assert math.isclose(back.own_airspeed_mps, one.own_airspeed_mps)
        for path_one, path_back in zip(one.intruders, back.intruders, strict=True):
            assert (path_one.position_m == path_back.position_m).all()


# Own speed [kn], height [ft], and the smallest distance between rows of one time, on the sphere [m].
DAIDALUS = {"crossing": (100.0, 4000.0, 308.0), "C1_0_120": (120.0, 15_000.0, 770.0)}


@pytest.mark.parametrize("name", [name for name in DAIDALUS if name in DAA_SCENARIOS])
def test_a_daidalus_encounter_is_read_in_its_units(name: str) -> None:
    (encounter,) = read_encounters(DAA_SCENARIOS[name])
    own_kn, height_ft, miss_m = DAIDALUS[name]
    assert encounter.own_airspeed_mps == pytest.approx(own_kn * 1852.0 / 3600.0, abs=0.01)
    assert encounter.own_position_m[2] == pytest.approx(-height_ft * 0.3048)
    assert encounter.geometry == "crossing from the right"
    assert nearest_m(encounter) == pytest.approx(miss_m, abs=6.0)


def test_the_units_are_those_of_the_second_row(tmp_path: FilePath) -> None:
    rows = "ownship, 0, 0, 1000, 0, 100, 0, 0\nintruder, 0, 2, 1000, 180, 50, 0, 0\n" + (
        "ownship, 0, 1, 1000, 0, 100, 0, 60\nintruder, 0, 1, 1000, 180, 50, 0, 60\n"
    )
    path = tmp_path / "units.daa"
    header = "name sx sy sz trk gs vs time\n"
    path.write_text(header + "[none] [nmi] [nmi] [ft] [deg] [knot] [fpm] [s]\n" + rows)
    (feet,) = read_encounters(path)
    path.write_text(header + "[none] [km] [km] [m] [deg] [m/s] [m/s] [s]\n" + rows)
    (metres,) = read_encounters(path)
    assert feet.own_position_m[2] == pytest.approx(-304.8)
    assert metres.own_position_m[2] == -1000.0
    assert metres.own_airspeed_mps == 100.0
    assert feet.intruders[0].position_m[0, 0] == pytest.approx(2.0 * 1852.0)
    path.write_text(header + "[none] [furlong] [nmi] [ft] [deg] [knot] [fpm] [s]\n" + rows)
    with pytest.raises(ConfigError, match="furlong"):
        read_encounters(path)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "", "no encounters"),
        ("a.csv", "what,else\n", "the columns are"),
        ("a.daa", "name\n", "no encounters"),
        ("a.daa", "name time\n[none] [s]\nownship, 0\n", "is missing"),
        ("a.daa", f"{DAA}o, 0, 0\n", "line 3"),
        ("a.daa", f"{DAA}o, 0, 0, x, 0, 1, 0, 0\n", "x is not a number"),
        ("a.daa", f"{DAA}o, 0, 0, 1, 0, 1, 0, 0\n", "only one aircraft"),
    ],
)
def test_broken_files_are_one_clear_line(tmp_path: FilePath, name: str, text: str, words: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(ConfigError, match=words) as caught:
        read_encounters(path)
    assert "\n" not in str(caught.value)


def test_an_encounter_shorter_than_a_step_is_refused(tmp_path: FilePath) -> None:
    path = tmp_path / "short.csv"
    encounter = generate("level", 1, 1)
    write_encounters(path, [encounter])
    lines = [line for line in path.read_text().splitlines() if ",0.0," in line[:60] or "time_s" in line]
    short = [line.replace(",0.0,", ",0.5,", 1) for line in lines[1:]]
    path.write_text("\n".join([*lines, *short]) + "\n")
    with pytest.raises(ConfigError, match="less than a decision period"):
        read_encounters(path)


def test_perfect_reports_are_one_second_old_and_exact() -> None:
    encounter = generate("level", 2, 3)
    observer = Observer(encounter, SURVEILLANCE_PRESETS["perfect"])
    ((index, sent_s, position_m, velocity_mps, age_s),) = observer.reports(0.0)
    assert (index, sent_s, age_s) == (0, -1.0, 1.0)
    assert (position_m, velocity_mps) == encounter.intruders[0].state_at(-1.0)
    later = [heard for now_s in range(1, 300) for heard in observer.reports(float(now_s))]
    assert [sent_s for _, sent_s, *_ in later] == [float(sent_s) for sent_s in range(299)]
    assert all(
        (position_m, velocity_mps) == encounter.intruders[0].state_at(sent_s)
        for _, sent_s, position_m, velocity_mps, _ in later
    )


@pytest.mark.parametrize(
    "error",
    [
        "position_sigma_m",
        "height_sigma_m",
        "velocity_sigma_mps",
        "climb_sigma_mps",
        "height_bias_sigma_m",
        "loss",
    ],
)
def test_each_error_alone_makes_reports_differ(error: str) -> None:
    encounter = generate("level", 2, 3)
    exact = Observer(encounter, Surveillance()).reports(60.0)
    assert len(exact) == 61
    assert Observer(encounter, Surveillance(**{error: 0.5})).reports(60.0) != exact


def test_errors_losses_and_range_are_as_stated() -> None:
    encounter = generate("hovering", 2, 3)
    how = Surveillance(position_sigma_m=20.0, velocity_sigma_mps=2.0, loss=0.3, burst_reports=4.0)
    observer = Observer(encounter, how, seed=5)
    heard = [observer.reports(float(second)) for second in range(20_000)]
    truth_m = np.array(encounter.intruders[0].position_m[0])
    off_m = np.array([np.array(reports[0][2]) - truth_m for reports in heard if reports])
    assert off_m[:, 0].std() == pytest.approx(20.0, rel=0.05)
    assert off_m[:, 2].std() == 0.0
    lost = np.array([not reports for reports in heard])
    assert lost.mean() == pytest.approx(0.3, abs=0.03)
    bursts = lost.sum() / (np.diff(lost.astype(int)) == 1).sum()
    assert bursts == pytest.approx(4.0, rel=0.15)
    deaf = Observer(encounter, Surveillance(first_heard_m=1.0))
    assert deaf.reports(0.0) == []
    again, other = (Observer(encounter, how, seed=seed).reports(3.0) for seed in (5, 6))
    assert again == Observer(encounter, how, seed=5).reports(3.0)
    assert again != other
