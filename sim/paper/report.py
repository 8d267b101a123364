"""The output of `companion-sim paper`: `report.json` for machines, `table.md` for readers."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from sim.paper import methods
from sim.paper.flight import Flight
from sim.paper.measures import Measures, measure
from sim.paper.studies import FieldShare, TransitionPoint, Triple

# The values printed in the paper (§4.2, §4.3), for comparison only.
PAPER: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "single": {
        "outer": {"safety_value": 1.3445},
        "inner": {"safety_value": 1.6816, "heading_effort": 1.0936, "speed_effort": 0.0039},
        "two_layer": {"safety_value": 1.6192, "heading_effort": 0.7951, "speed_effort": 0.0038},
    },
    "group": {
        "outer": {"safety_value": 1.2207},
        "inner": {"safety_value": 1.2442},
        "two_layer": {"safety_value": 1.6727},
    },
}
_TITLES = {"single": "One UAV (§4.2)", "group": "Three UAVs (§4.3)"}


@dataclasses.dataclass(frozen=True, slots=True)
class Goal:
    """A target ratio of two layers to a single layer in an experiment."""

    experiment: str
    measure: str
    against: str
    at_least: float | None = None
    at_most: float | None = None

    def reached(self, ratio: float) -> bool:
        """True if a ratio meets the target."""
        return ratio >= self.at_least if self.at_least is not None else ratio <= (self.at_most or 0.0)


GOALS = (
    Goal("single", "safety_value", "outer", at_least=1.20),
    Goal("single", "safety_value", "inner", at_least=0.95),
    Goal("single", "heading_effort", "inner", at_most=0.73),
    Goal("group", "safety_value", "outer", at_least=1.35),
    Goal("group", "safety_value", "inner", at_least=1.35),
    Goal("group", "heading_effort", "inner", at_most=0.73),
)

Measured = Mapping[str, Mapping[str, Measures]]


def measured(flights: Mapping[str, Sequence[Flight]]) -> dict[str, dict[str, Measures]]:
    """Measures by experiment (or scene) and name of the strategy."""
    return {
        name: {flight.method.name: measure(flight, common_steps(flown)) for flight in flown}
        for name, flown in flights.items()
    }


def common_steps(flown: Sequence[Flight]) -> int:
    """Number of steps in which every UAV of all these flights was under way."""
    return min(one.steps for flight in flown for one in flight.uavs)


def report(experiments: Measured, minima: Measured) -> dict[str, Any]:
    """The JSON report: the four compared strategies by experiment, the others under `more`."""
    main = {method.name for method in methods.REPORTED}
    return {
        **{name: _reports(rows, main) for name, rows in experiments.items()},
        "more": {name: _reports(rows, set(rows) - main) for name, rows in experiments.items()},
        "minima": {name: _reports(rows, set(rows)) for name, rows in minima.items()},
    }


def _reports(rows: Mapping[str, Measures], names: set[str]) -> dict[str, Any]:
    return {name: one.report() for name, one in rows.items() if name in names}


def succeeded(experiments: Measured) -> bool:
    """True if the two layers arrived in every experiment without collision."""
    both = [rows[methods.TWO_LAYER.name] for rows in experiments.values()]
    return all(one.arrived and not one.collisions for one in both)


def table(experiments: Measured, minima: Measured) -> str:
    """The comparison in Markdown: the paper's values beside ours, ratios, and missed targets with reasons."""
    parts = ["# The paper's experiments, flown with the product's avoidance\n", _READING]
    for name, rows in experiments.items():
        parts += [f"## {_TITLES[name]}\n", _experiment(name, rows)]
    parts += ["## Two layers against one\n", _ratios(experiments)]
    parts += ["## Local minima and oscillation\n", _minima(minima)]
    return "\n".join(parts)


_READING = """Our values, with the paper's in brackets where it prints one. The paper does not print its
obstacles, so absolute values cannot agree; ratios and orders can. Lengths are the paper's. The safety value
(eq. 3) is the mean over the whole flight; for a group, until the last arrival, with the others standing at
their goals. "Same time" is the mean over the steps in which all UAVs of all strategies are under way. The
safety value alone rewards flying far apart, so read it with the other measures. Heading effort is the mean
square of the commanded change of course [rad²], speed effort that of speed [length²/step²]; separation is
between centres, clearance between surfaces; path is flown length over straight length; jitter counts changes
of the turn's side.
"""

_COLUMNS = (
    ("safety value", "safety_value"),
    ("same time", "common_safety_value"),
    ("heading effort", "heading_effort"),
    ("speed effort", "speed_effort"),
    ("separation", "min_separation"),
    ("clearance", "min_clearance"),
    ("collisions", "collisions"),
    ("arrived", "arrived"),
    ("steps", "steps"),
    ("path", "path_ratio"),
    ("jitter", "jitter"),
)


def _experiment(name: str, rows: Mapping[str, Measures]) -> str:
    labels = {m.name: m.label for m in (*methods.REPORTED, *methods.MORE[name])}
    body = []
    for key, one in rows.items():
        paper = PAPER[name].get(key, {})
        cells = [_cell(getattr(one, field), paper.get(field)) for _, field in _COLUMNS]
        label = f"**{labels[key]}**" if key == methods.TWO_LAYER.name else labels[key]
        body.append([label, *cells])
    return markdown(["strategy", *(title for title, _ in _COLUMNS)], body)


def _cell(value: float | bool | None, paper: float | None) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "-"
    # Show small efforts with their digits: a zero means that nothing was commanded.
    value = round(value, 6)
    text = f"{value:.4f}" if abs(value) >= 1e-3 else f"{value:.2g}"
    if isinstance(value, int):
        text = str(value)
    return text if paper is None else f"{text} (paper {paper:.4f})"


def _ratios(experiments: Measured) -> str:
    body, reasons = [], []
    for goal in GOALS:
        rows = experiments[goal.experiment]
        both, one = rows[methods.TWO_LAYER.name], rows[goal.against]
        ratio = _ratio(both, one, goal.measure)
        what = f"{goal.experiment}: {goal.measure.replace('_', ' ')}, two layers / {goal.against}"
        wanted = f"≥ {goal.at_least:.2f}" if goal.at_least is not None else f"≤ {goal.at_most:.2f}"
        if ratio is None:
            body.append([what, _paper_ratio(goal), wanted, "-", "not compared: one of them did not arrive"])
            continue
        reached = goal.reached(ratio)
        body.append([what, _paper_ratio(goal), wanted, f"{ratio:.2f}", "reached" if reached else "**short**"])
        if not reached:
            reasons.append(f"- {what} is {ratio:.2f}, not {wanted}: {_reason(goal, both, one)}")
    text = markdown(["ratio", "paper", "wanted", "ours", ""], body)
    if alone := _alone(experiments):
        reasons.append(alone)
    return text + ("\n" + "\n".join(reasons) + "\n" if reasons else "")


def _alone(experiments: Measured) -> str:
    """The part of the group's ratios that is due to its joint table."""
    rows = experiments["group"]
    alone = rows.get(methods.TWO_LAYER_ALONE.name)
    if alone is None:
        return ""
    ratios = [_ratio(alone, rows[against], "safety_value") for against in ("outer", "inner")]
    shown = " and ".join("-" if ratio is None else f"{ratio:.2f}" for ratio in ratios)
    return (
        "- group: the single layers do not cooperate, the two layers do. Two layers without cooperation "
        f"reach {shown} times the safety value of the outer and of the inner layer alone; the rest is due "
        "to the joint table."
    )


def _ratio(both: Measures, one: Measures, name: str) -> float | None:
    if not (both.arrived and one.arrived):
        return None
    value, other = getattr(both, name), getattr(one, name)
    return None if value is None or not other else float(value / other)


def _paper_ratio(goal: Goal) -> str:
    printed = PAPER[goal.experiment]
    both, one = printed["two_layer"].get(goal.measure), printed[goal.against].get(goal.measure)
    return "-" if both is None or one is None else f"{both / one:.2f}"


def _reason(goal: Goal, both: Measures, one: Measures) -> str:
    """The reason for a missed target, from the other measures of the two flights."""
    if goal.measure == "safety_value" and one.path_ratio > both.path_ratio:
        text = (
            f"the single layer is far from the obstacles because of its detour, {one.path_ratio:.2f} times "
            f"the straight path against {both.path_ratio:.2f}; its smallest clearance is "
            f"{one.min_clearance:.2f} against {both.min_clearance:.2f}."
        )
        common = _ratio(both, one, "common_safety_value")
        return text if common is None else f"{text} While all are under way the ratio is {common:.2f}."
    if goal.measure == "safety_value":
        return (
            f"the single layer already keeps a clearance of {one.min_clearance:.2f} (two layers "
            f"{both.min_clearance:.2f}); more distance would cost a longer path than the present "
            f"{both.path_ratio:.2f} times the straight one."
        )
    return (
        f"the two layers turn more for a clearance of {both.min_clearance:.2f} against "
        f"{one.min_clearance:.2f} and a safety value of {both.safety_value:.2f} against "
        f"{one.safety_value:.2f}."
    )


def _minima(minima: Measured) -> str:
    body = []
    for scene, rows in minima.items():
        for name, one in rows.items():
            arrived = f"yes, {one.steps} steps" if one.arrived else "no"
            cells = [f"{one.path_ratio:.2f}", _cell(one.min_clearance, None), str(one.collisions)]
            body.append([scene, name.replace("_", " "), arrived, str(one.jitter), *cells])
    heads = ["scene", "strategy", "arrived", "jitter", "path", "clearance", "collisions"]
    return markdown(heads, body)


def transition_table(points: Sequence[TransitionPoint], chosen_deg: float) -> str:
    """The sweep of the transition domain in Markdown."""
    heads = ["strategy", "dbeta [deg]", "arrived without collision", "safety value", "clearance", "path"]
    body = [
        [
            point.method,
            f"{point.delta_beta_deg:g}" + (" **chosen**" if point.delta_beta_deg == chosen_deg else ""),
            _triple(point.arrived_share, 3),
            _triple(point.safety_value, 3),
            _triple(point.min_clearance, 3),
            _triple(point.path_ratio, 3),
        ]
        for point in points
    ]
    return "# Width of the transition domain\n\nMeans, with 95 % intervals.\n\n" + markdown(heads, body)


def fields_table(shares: Sequence[FieldShare], closed: int) -> str:
    """The shares over random fields in Markdown."""
    heads = [
        "strategy",
        "arrived without collision",
        "safety value",
        "heading effort",
        "path",
        "jitter",
        "failed seeds",
    ]
    body = [
        [
            share.method.label,
            _triple(share.without_collision, 3),
            f"{share.safety_value:.3f}",
            f"{share.heading_effort:.4f}",
            f"{share.path_ratio:.3f}",
            f"{share.jitter:.1f}",
            " ".join(map(str, share.failed_seeds[:10])) + (" ..." if len(share.failed_seeds) > 10 else ""),
        ]
        for share in shares
    ]
    count = shares[0].fields if shares else 0
    intro = (
        f"# Random fields\n\n{count} passable fields ({closed} others are impassable). "
        "Shares have 95 % intervals (Wilson); the other values are means over the flights that arrived.\n\n"
    )
    return intro + markdown(heads, body)


def transition_report(points: Sequence[TransitionPoint], chosen_deg: float) -> dict[str, Any]:
    """The sweep for JSON."""
    return {"chosen_deg": chosen_deg, "points": [dataclasses.asdict(point) for point in points]}


def fields_report(shares: Sequence[FieldShare], closed: int) -> dict[str, Any]:
    """The shares for JSON, by strategy."""
    rows = {}
    for share in shares:
        row = dataclasses.asdict(share)
        del row["method"]
        rows[share.method.name] = row
    return {"without_way": closed, "strategies": rows}


def _triple(value: Triple, digits: int) -> str:
    middle, low, high = value
    if not math.isfinite(middle):
        return "-"
    return f"{middle:.{digits}f} ({low:.{digits}f}-{high:.{digits}f})"


def markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (heads, ["---"] * len(heads), *rows)]
    return "\n".join(lines) + "\n"
