"""The content of page and document: sections of words, tables and figures from the analysis."""

from collections.abc import Iterator, Sequence
from typing import Any

from matplotlib.figure import Figure

from sim.evidence import drawings, tables, words
from sim.evidence.blocks import Drawing, Section, Table
from sim.evidence.pass_lines import HUMAN, PASS_LINES

TITLE = "Evidence of collision avoidance"
# A figure of an encounter, and what it shows in words.
Drawn = tuple[Figure, str]


def sections_of(report: dict[str, Any], worst: Sequence[Drawn]) -> list[Section]:
    """All sections, in order."""
    return [
        _summary(report),
        _sets(report),
        _results(report),
        _convergence(report),
        _groups(report),
        _sweeps(report),
        _two_sided(report),
        _trade_off(report),
        _tracks(report),
        Section("Worst encounters", list(_worst(worst))),
        _configuration(report["configuration"]),
    ]


def _summary(report: dict[str, Any]) -> Section:
    rows = {preset: avoiders["companion"] for preset, avoiders in report["results"].items()}
    table = tables.results(rows)
    sources = "; ".join(dict.fromkeys(f"{line.name}: {line.source}" for line in PASS_LINES))
    blocks: list[str | Table] = [
        words.RATIOS,
        Table(("reports", *table.head[1:]), table.rows),
        words.PARTS,
        tables.verdicts(report["results"]),
        f"{words.QUOTED} {sources}. {HUMAN}",
        words.LIMITS,
    ]
    if len(report["configuration"]["flown_by"]) > 1:
        blocks.insert(0, words.MIXED)
    return Section("Summary", blocks)


def _sets(report: dict[str, Any]) -> Section:
    blocks: list[str | Table] = [
        _where_from(report["configuration"]["models"]),
        tables.encounter_sets(report["encounter_sets"]),
        words.EQUIPAGE,
        tables.presets(report["presets"]),
    ]
    return Section("Encounters and equipage", blocks)


def _where_from(models: Sequence[str]) -> str:
    """Where the encounters come from, and what their weights are."""
    if not models:
        return words.SETS_BUILT
    return words.SETS_DRAWN if models[0].lower().endswith(".txt") else words.SETS_READ


def _results(report: dict[str, Any]) -> Section:
    blocks: list[str | Table] = [words.PEERS]
    for preset, rows in report["results"].items():
        blocks += [f"Reports: {preset}", tables.results(rows)]
    blocks.append("Height locked by floor and ceiling, perfect reports:")
    blocks.append(tables.results({"companion": report["height_locked"]}))
    return Section("Results by surveillance and avoider", blocks)


def _convergence(report: dict[str, Any]) -> Section:
    found = report["convergence"]
    caption = "Running estimates with 95 % intervals; dashed: the strictest pass line."
    drawing = Drawing(drawings.convergence(found), caption)
    return Section("Convergence", [tables.convergence(found), words.CONVERGED, drawing])


def _groups(report: dict[str, Any]) -> Section:
    found = report["groups"]
    dimensions = list(next(iter(found.values())))
    return Section("By kind of encounter", [tables.groups(dimension, found) for dimension in dimensions])


def _sweeps(report: dict[str, Any]) -> Section:
    found = report["sweeps"]
    caption = "Ratios and rate of unnecessary manoeuvres with 95 % intervals over the varied value."
    drawing = Drawing(drawings.sweeps(found), caption)
    return Section("Sweeps", [words.SWEEPS, drawing, *(tables.sweep(one) for one in found)])


def _two_sided(report: dict[str, Any]) -> Section:
    return Section("Two aircraft that avoid", [words.TWO_SIDED, tables.two_sided(report["two_sided"])])


def _trade_off(report: dict[str, Any]) -> Section:
    points = report["trade_off"]
    caption = "Well clear ratio over unnecessary manoeuvres, with 95 % intervals; the chosen point is large."
    drawing = Drawing(drawings.trade_off(points), caption)
    return Section("Trade-off", [words.TRADE_OFF, drawing, tables.trade_off(points)])


def _tracks(report: dict[str, Any]) -> Section:
    found = report["tracks"]
    drawing = Drawing(drawings.tracks(found), "NEES by preset; the band is the 95 % interval around 1.")
    return Section("Consistency of the tracks", [words.NEES, tables.tracks(found), drawing])


def _worst(worst: Sequence[Drawn]) -> Iterator[str | Drawing]:
    found = "The closest approaches that lost well clear, by preset."
    yield found if worst else "No encounter lost well clear."
    for figure, caption in worst:
        yield Drawing(figure, caption)


def _configuration(found: dict[str, Any]) -> Section:
    rows = [
        *([name, str(value)] for name, value in (found["versions"] | found["machine"]).items()),
        *(["flown by", one.get("companion", "")] for one in found["flown_by"]),
        ["seed", str(found["seed"])],
        ["half of the encounters", found["part"]],
        *(["model", name] for name in found["models"]),
        ["flights", f"{sum(found['flights'].values()):,}"],
        *([f"aircraft: {name}", _text(value)] for name, value in found["aircraft"].items()),
        *([f"avoidance: {name}", _text(value)] for name, value in found["avoidance"].items()),
    ]
    shown = Table(("", "value"), [row for row in rows if row[1]])
    return Section("Version, machine and configuration", [words.WHOLE_CONFIGURATION, shown])


def _text(value: Any) -> str:
    """A number or a word; empty for parts with values of their own, which only the JSON file shows."""
    if isinstance(value, (bool, str)):
        return str(value)
    return f"{value:g}" if isinstance(value, (int, float)) else ""
