"""The analysis as tables of text."""

from collections.abc import Mapping
from typing import Any

from sim.campaign.avoiders import COMPANION
from sim.evidence.blocks import Table
from sim.evidence.pass_lines import PASS_LINES

Row = Mapping[str, Any]

_RATIOS = ("risk ratio", "well clear ratio", "unnecessary")
_INDUCED, _UNRESOLVED = "induced NMAC, losses", "unresolved NMAC, losses"
NAMES = {
    "none": "no avoidance",
    "ardupilot": "ArduPilot at 300 x 100 m",
    "ardupilot-610": "ArduPilot at 610 x 76 m",
    "mvp": "MVP",
    "orca": "ORCA",
    "companion, the peers' encounters": "companion, as many",
}


def encounter_sets(sets: Mapping[str, Row]) -> Table:
    """How many encounters came from each model, and what they weigh."""
    head = ("model or kind", "encounters", "share of weight", "effective", "lose well clear", "NMAC")
    rows = [
        [source, _count(one["encounters"]), f"{one['weight_share']:.1%}", f"{one['effective']:,.0f}",
         _count(one["conflicts"]), _count(one["nmac_without"])]
        for source, one in sets.items()
    ]  # fmt: skip
    return Table(head, rows)


def presets(surveillance: Mapping[str, Row]) -> Table:
    """The equipage: errors, latency, loss and range of each preset."""
    head = (
        "preset", "position", "height, bias", "velocity", "climb", "latency", "lost", "range", "accuracy",
    )  # fmt: skip
    rows = [
        [name, f"{one['position_sigma_m']:g} m",
         f"{one['height_sigma_m']:g} m, {one['height_bias_sigma_m']:g} m",
         f"{one['velocity_sigma_mps']:g} m/s", f"{one['climb_sigma_mps']:g} m/s",
         f"{one['latency_s']:g} s{'' if one['age_reported'] else ', unknown'}", f"{one['loss']:.0%}",
         _range(one["first_heard_m"]), "stated" if one["accuracy_stated"] else "-"]
        for name, one in surveillance.items()
    ]  # fmt: skip
    return Table(head, rows)


def results(rows: Mapping[str, Row]) -> Table:
    """All avoiders with one preset."""
    head = (
        "avoider", "encounters", *_RATIOS, _INDUCED,
        _UNRESOLVED, "aside, height",
    )  # fmt: skip
    return Table(head, [[NAMES.get(name, name), *_result(row)] for name, row in rows.items()])


def _result(row: Row) -> list[str]:
    return [
        _count(row["encounters"]), *_ratios(row),
        f"{row['induced_nmac']}, {row['induced_lowc']}",
        f"{row['unresolved_nmac']}, {row['unresolved_lowc']}",
        _deviations(row),
    ]  # fmt: skip


def verdicts(by_preset: Mapping[str, Mapping[str, Row]]) -> Table:
    """The pass lines, and how the product does against them with each preset."""
    head = ("pass line", "risk ratio", "well clear ratio", *by_preset)
    rows = [
        [line.name, f"{line.risk_ratio:g}", f"{line.lowc_ratio:g}",
         *(rows[COMPANION]["pass"][line.name] for rows in by_preset.values())]
        for line in PASS_LINES
    ]  # fmt: skip
    return Table(head, rows)


def convergence(by_preset: Mapping[str, Mapping[str, Row]]) -> Table:
    """Whether the ratios have converged."""
    head = (
        "preset",
        "ratio",
        "encounters",
        "estimate",
        "half interval",
        "moved",
        "within 5 %",
        "needs about",
    )
    rows = []
    for preset, ratios in by_preset.items():
        for name, one in ratios.items():
            if not one["encounters"]:
                continue
            moved, needed = one["moved"], one["needed"]
            rows.append(
                [preset, "risk" if name == "risk_ratio" else "well clear", _count(one["encounters"][-1]),
                 f"{one['estimate'][-1]:.4f}", _percent(one["relative"]), _percent(moved),
                 _converged(one), "-" if needed is None else _count(_two_digits(needed))]
            )  # fmt: skip
    return Table(head, rows)


def _converged(one: Row) -> str:
    if one["relative"] is None:
        return "no event"
    return "yes" if one["converged"] else "no"


def groups(dimension: str, by_preset: Mapping[str, Mapping[str, Mapping[str, Row]]]) -> Table:
    """The product by group of encounters."""
    head = (
        dimension, "reports", "encounters", "conflicts", *_RATIOS, _INDUCED,
    )  # fmt: skip
    names = dict.fromkeys(name for groups in by_preset.values() for name in groups[dimension])
    rows = [
        [name, preset, _count(row["encounters"]), _count(row["conflicts"]), *_ratios(row),
         f"{row['induced_nmac']}, {row['induced_lowc']}"]
        for name in names
        for preset, groups in by_preset.items()
        if (row := groups[dimension].get(name)) is not None
    ]  # fmt: skip
    return Table(head, rows)


def sweep(one: Row) -> Table:
    """The values of one sweep."""
    unit = f" [{one['unit']}]" if one["unit"] else ""
    head = (
        f"{one['title'].partition(':')[0]}{unit}", "encounters", *_RATIOS, _INDUCED,
    )  # fmt: skip
    return Table(head, [[point["label"], *_result(point | _NO_DEVIATION)[:5]] for point in one["points"]])


_NO_DEVIATION = {"median_max_deviation_m": None, "median_max_height_m": None}


def trade_off(points: list[Row]) -> Table:
    """The values of the trade-off."""
    head = ("begin of an avoidance", "changed values", "encounters", "well clear ratio", "unnecessary")
    rows = [
        [point["label"], ", ".join(f"{name} {value:g}" for name, value in point["changes"].items()) or "none",
         _count(point["encounters"]), *_ratios(point)[1:]]
        for point in points
    ]  # fmt: skip
    return Table(head, rows)


def two_sided(by_preset: Mapping[str, Mapping[str, Row]]) -> Table:
    """One aircraft avoids, and both do."""
    head = (
        "reports", "who avoids", "encounters", *_RATIOS, _INDUCED,
        "mirrored",
    )  # fmt: skip
    rows = [
        [preset, "one" if name == COMPANION else "both", *_result(row)[:5], _mirrored(row)]
        for preset, avoiders in by_preset.items()
        for name, row in avoiders.items()
    ]  # fmt: skip
    return Table(head, rows)


def _mirrored(row: Row) -> str:
    return f"{row['mirrored']['either']} of {row['both_avoided']}" if "mirrored" in row else "-"


def tracks(by_preset: Mapping[str, Row]) -> Table:
    """NEES and errors of the tracks with each preset."""
    head = (
        "preset", "encounters", "interval", "position", "velocity", "p., shifted", "v., shifted",
        "RMS position, velocity", "RMS height, climb",
    )  # fmt: skip
    rows = [
        [name, _count(one["encounters"]), f"{one['interval'][0]:.2f}-{one['interval'][1]:.2f}",
         *(f"{one[key]:.2f}" for key in _NEES),
         f"{one['position_m']:.1f} m, {one['velocity_mps']:.1f} m/s",
         f"{one['height_m']:.1f} m, {one['climb_mps']:.2f} m/s"]
        for name, one in by_preset.items()
        if one["encounters"]
    ]  # fmt: skip
    return Table(head, rows)


_NEES = ("position_nees", "velocity_nees", "shifted_position_nees", "shifted_velocity_nees")


def _ratios(row: Row) -> list[str]:
    return [interval(row, name) for name in ("risk_ratio", "lowc_ratio", "nuisance_rate")]


def interval(row: Row, name: str) -> str:
    """A value with its 95 % interval."""
    value, edges = row[name], row[f"{name}_ci95"]
    return "-" if value is None else f"{value:.3f} ({edges[0]:.3f}-{edges[1]:.3f})"


def _deviations(row: Row) -> str:
    aside, above = row.get("median_max_deviation_m"), row.get("median_max_height_m")
    return "-" if aside is None or above is None else f"{aside:.0f} m, {above:.0f} m"


def _range(distance_m: float) -> str:
    return f"{distance_m / 1000.0:g} km" if distance_m < 1e6 else "any"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{share:.1%}"


def _count(number: float) -> str:
    return f"{number:,.0f}"


def _two_digits(number: float) -> float:
    return float(f"{number:.2g}")
