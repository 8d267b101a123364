"""Options that several commands share."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from sim.members.scenario import formation_names
from sim.receivers import FORMATS
from sim.scenario import Autopilot, scenario_names

ScenarioOption = Annotated[
    str, typer.Option(metavar="NAME|FILE", help=f"One of {', '.join(scenario_names())}, or a YAML file.")
]
AnyScenarioOption = Annotated[
    str,
    typer.Option(
        metavar="NAME|FILE",
        help=f"One of {', '.join((*scenario_names(), *formation_names()))}, or a YAML file.",
    ),
]
AutopilotOption = Annotated[
    Autopilot, typer.Option(help="The autopilot that the vehicle imitates; px4 is version 1.16.")
]
FormatName = StrEnum("FormatName", list(FORMATS))  # type: ignore[misc]
SpeedupOption = Annotated[float, typer.Option(min=0.1, max=100.0, help="Simulated time against real time.")]
ReportOption = Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the figures as JSON.")]
