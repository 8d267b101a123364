"""`companion-sim campaign` and `encounter`: fly many encounters, or one of them again."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.cli.common import note_if_slow, writable
from companion.control.rejoin import RejoinMode
from companion.errors import ConfigError, require
from sim.campaign.plan import BOTH, Part, Plan
from sim.cli.common import ReportOption
from sim.encounters import SURVEILLANCE_PRESETS
from sim.formation.engines import separated
from sim.formation.plan import FormationPlan

EncountersOption = Annotated[
    int, typer.Option("--encounters", min=1, max=10_000_000, help="Number of encounters.")
]
SeedOption = Annotated[int, typer.Option(min=0, help="Random seed: the same seed gives the same campaign.")]
AvoiderOption = Annotated[
    list[str] | None,
    typer.Option(
        "--avoider", metavar="NAME", help="companion (default), none, ardupilot, ardupilot-610, mvp, orca."
    ),
]
ModelOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--model", metavar="FILE", help="MIT Lincoln Laboratory model (.txt), or encounters (.csv, .daa)."
    ),
]
SurveillanceOption = Annotated[
    list[str] | None,
    typer.Option(
        "--surveillance",
        metavar="PRESET",
        help=f"{', '.join(SURVEILLANCE_PRESETS)}, or adsb-out,latency_s=3,loss=0.4. Default: perfect.",
    ),
]
IntrudersOption = Annotated[int, typer.Option(min=1, max=4, help="Intruders per encounter of a model.")]
LockOption = Annotated[
    bool, typer.Option("--lock-height", help="Ceiling just above the mission's height, floor just below.")
]

LegsOption = Annotated[
    bool,
    typer.Option("--legs", help="Missions with legs of 3 km, slopes and corners; default: a straight line."),
]

RejoinOption = Annotated[
    RejoinMode, typer.Option(metavar="line|direct|off", help="How it is given back, as in `control.rejoin`.")
]

AirframeOption = Annotated[
    str, typer.Option("--airframe", metavar="NAME", help="Dynamics as recorded: ardupilot (default) or px4.")
]

TwoSidedOption = Annotated[
    bool,
    typer.Option("--two-sided", help="Intruders fly the avoider too, as strangers: NAME-both beside NAME."),
]

FormationOption = Annotated[
    int | None,
    typer.Option("--formation", metavar="N", help="Crossings of 2 to 10 members instead of encounters."),
]
LossOption = Annotated[
    list[float] | None,
    typer.Option("--loss", min=0.0, max=0.95, help="Of a formation's radio: share lost; may be repeated."),
]
DelayOption = Annotated[
    list[float] | None,
    typer.Option("--delay", min=0.0, max=10.0, help="Of a formation's radio: longest delay [s]; repeatable."),
]
SeparationOption = Annotated[
    float, typer.Option(min=10.0, max=500.0, help="Members nearer than this have collided [m].")
]
SilentOption = Annotated[
    bool, typer.Option("--falls-silent", help="One member sends nothing from 20 s before the meeting.")
]


def campaign(
    encounters: EncountersOption = 1000,
    seed: SeedOption = 0,
    avoider: AvoiderOption = None,
    model: ModelOption = None,
    surveillance: SurveillanceOption = None,
    intruders: IntrudersOption = 1,
    lock_height: LockOption = False,
    legs: LegsOption = False,
    rejoin: RejoinOption = "line",
    airframe: AirframeOption = "ardupilot",
    two_sided: TwoSidedOption = False,
    formation: FormationOption = None,
    loss: LossOption = None,
    delay: DelayOption = None,
    separation: SeparationOption = 50.0,
    falls_silent: SilentOption = False,
    part: Annotated[
        Part, typer.Option(help="Half of the encounters: tune on one, quote the other.")
    ] = Part.ALL,
    results: Annotated[
        Path,
        typer.Option(metavar="FILE.ndjson", help="Results; an interrupted campaign continues."),
    ] = Path("campaign.ndjson"),
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Processes; default: one per core.")
    ] = None,
    scheduler: Annotated[
        str,
        typer.Option(metavar="local|ADDRESS", help="A dask scheduler, as tcp://192.168.1.7:8786."),
    ] = "local",
    page: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write a page with the worst encounters drawn.")
    ] = None,
    report: ReportOption = None,
) -> None:
    """Fly thousands of encounters through the product's engine, and report the remaining risk."""
    if page is not None:
        require("matplotlib", "companion-sim campaign --page", "sim")
    from sim.campaign import command

    for path in (page, report):
        if path is not None:
            writable(path)
    if formation is not None:
        if two_sided or scheduler != "local":
            raise ConfigError("--formation: not with --two-sided or --scheduler")
        crossings = FormationPlan(
            formation, encounters, seed, losses=tuple(loss or (0.0,)), delays_s=tuple(delay or (0.0,)),
            separation=separated(separation), surveillance=(surveillance or ["perfect"])[0], part=part,
            falls_silent=falls_silent,
        )  # fmt: skip
        _formation(crossings, tuple(dict.fromkeys(avoider or ())), results, workers, page, report)
        return
    plan = Plan(
        encounters, seed, _avoiders(avoider or ["companion"], two_sided=two_sided),
        tuple(map(str, model or ())), tuple(dict.fromkeys(surveillance or ["perfect"])), intruders,
        lock_height, part, legs, rejoin, airframe, two_sided,
    )  # fmt: skip
    note_if_slow()
    console = Console(highlight=False)
    figures = command.run(plan, results, console, workers=workers, scheduler=scheduler)
    command.print_figures(console, figures)
    if report is not None:
        command.write_report(report, figures)
    if page is not None:
        page.write_text(command.page_of(plan, results, figures), encoding="utf-8")


def _formation(
    plan: FormationPlan, avoiders: tuple[str, ...], results: Path, workers: int | None,
    page: Path | None, report: Path | None,
) -> None:  # fmt: skip
    """Fly the crossings of a formation."""
    from sim.campaign.command import write_report
    from sim.formation import command

    note_if_slow()
    console = Console(highlight=False)
    plan = command.available(avoiders, console, plan)
    figures = command.run(plan, results, console, workers=workers)
    command.print_figures(console, figures)
    if report is not None:
        write_report(report, figures)
    if page is not None:
        page.write_text(command.page_of(plan, results, figures), encoding="utf-8")


def _avoiders(names: list[str], *, two_sided: bool) -> tuple[str, ...]:
    """Each avoider once; two-sided, the same flown on both sides follows it."""
    ways = [(name, name + BOTH) if two_sided and name != "none" else (name,) for name in names]
    return tuple(dict.fromkeys(name for way in ways for name in way))


def encounter(
    number: Annotated[
        int, typer.Argument(metavar="NUMBER", min=0, help="Its number in the results of the campaign.")
    ],
    seed: SeedOption = 0,
    avoider: Annotated[str, typer.Option(metavar="NAME", help="As in the campaign.")] = "companion",
    model: ModelOption = None,
    surveillance: Annotated[str, typer.Option(metavar="PRESET", help="As in the campaign.")] = "perfect",
    intruders: IntrudersOption = 1,
    lock_height: LockOption = False,
    legs: LegsOption = False,
    rejoin: RejoinOption = "line",
    airframe: AirframeOption = "ardupilot",
    two_sided: TwoSidedOption = False,
    formation: FormationOption = None,
    loss: LossOption = None,
    delay: DelayOption = None,
    separation: SeparationOption = 50.0,
    falls_silent: SilentOption = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw paths, heights and separation.")
    ] = None,
) -> None:
    """Fly one encounter of a campaign again, and list its decisions."""
    from sim.campaign import command

    if out is not None:
        require("matplotlib", "companion-sim encounter --out", "sim")
        writable(out)
    if formation is not None:
        from sim.formation.command import show_crossing

        crossings = FormationPlan(
            formation, number + 1, seed, (avoider,), tuple(loss or (0.0,)), tuple(delay or (0.0,)),
            separated(separation), surveillance, falls_silent=falls_silent,
        )  # fmt: skip
        show_crossing(crossings, number, Console(highlight=False), out)
        return
    models = tuple(map(str, model or ()))
    plan = Plan(
        number + 1, seed, (avoider,), models, (surveillance,), intruders, lock_height,
        legs=legs, rejoin=rejoin, airframe=airframe, two_sided=two_sided,
    )  # fmt: skip
    note_if_slow()
    command.show_encounter(plan, number, Console(highlight=False), out)
