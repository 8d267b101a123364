"""Scenario files of a formation: its members with their missions, and the network between them."""

import re
from dataclasses import field
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Gt, Le, Len
from pydantic import dataclasses as checked

from companion.errors import ConfigError
from sim.files import STRICT, names_in, read_named
from sim.scenario import (
    FORMATION_FOLDER,
    Autopilot,
    Conflict,
    Home,
    MissionPlan,
    Receiver,
    Scenario,
    Start,
    Wind,
    check_conflicts,
    has_members,
    load_scenario,
    scenario_names,
)

MOST_MEMBERS = 16
_NAME = re.compile(r"[A-Za-z0-9_-]{1,12}")  # also a folder's, and a part of an address of the page


@checked.dataclass(frozen=True, config=STRICT)
class Member:
    """One aircraft: how it is known, and what it flies."""

    name: str
    system_id: Annotated[int, Ge(1), Le(250)]
    mission: MissionPlan
    start: Start = field(default_factory=Start)
    autopilot: Autopilot = "ardupilot"
    airspeed_mps: Annotated[float, Ge(12.0), Le(28.0)] = 22.0  # of its cruise

    def __post_init__(self) -> None:
        """Refuse a name that is not a plain word."""
        if _NAME.fullmatch(self.name) is None:
            raise ValueError(f"name {self.name!r} must be 1 to 12 letters, digits, - or _")


@checked.dataclass(frozen=True, config=STRICT)
class AimedConflict(Conflict):
    """An intruder, defined by its closest approach to this member; the other members meet it as well."""

    member: str = field(kw_only=True)


@checked.dataclass(frozen=True, config=STRICT)
class NetworkPlan:
    """The share of frames that the network between members loses, and the delay of all others."""

    loss: Annotated[float, Ge(0.0), Le(1.0)] = 0.0
    delay_s: Annotated[float, Ge(0.0), Le(10.0)] = 0.0


@checked.dataclass(frozen=True, config=STRICT)
class FormationScenario:
    """The content of a scenario file with members."""

    description: str
    duration_s: Annotated[float, Gt(0.0), Le(7200.0)]
    home: Home
    formation: Annotated[tuple[Member, ...], Len(2, MOST_MEMBERS)]
    wind: Wind = field(default_factory=Wind)
    network: NetworkPlan = field(default_factory=NetworkPlan)
    intruders: tuple[AimedConflict, ...] = ()
    receiver: Receiver = field(default_factory=Receiver)

    def __post_init__(self) -> None:
        """Refuse members with one name or system id, and intruders aimed at no member."""
        names = [member.name for member in self.formation]
        if len(set(names)) < len(names):
            raise ValueError("formation: two members have the same name")
        if len({member.system_id for member in self.formation}) < len(names):
            raise ValueError("formation: two members have the same system_id")
        check_conflicts(self.intruders, self.duration_s)
        for conflict in self.intruders:
            if conflict.member not in names:
                known = ", ".join(names)
                raise ValueError(
                    f"intruders: {conflict.callsign}: no member {conflict.member!r}; there are: {known}"
                )

    def scenario_of(self, member: Member) -> Scenario:
        """A member's part of it, without the intruders."""
        return Scenario(
            description=self.description,
            duration_s=self.duration_s,
            home=self.home,
            mission=member.mission,
            start=member.start,
            wind=self.wind,
            receiver=self.receiver,
        )


def formation_names() -> list[str]:
    """Names of the formations' scenarios that come with the project."""
    return names_in(FORMATION_FOLDER)


def load_formation(name_or_path: str | Path) -> FormationScenario:
    """Read a formation's scenario by name or from a file; `ConfigError` names file and key."""
    return read_named(name_or_path, FORMATION_FOLDER, FormationScenario, "scenario of a formation")


def load_any(name_or_path: str | Path) -> Scenario | FormationScenario:
    """Read a scenario of either kind."""
    if has_members(name_or_path):
        return load_formation(name_or_path)
    known = [*scenario_names(), *formation_names()]
    if Path(name_or_path).suffix not in (".yaml", ".yml") and str(name_or_path) not in known:
        raise ConfigError(f"{name_or_path}: no such scenario; there are: {', '.join(known)}")
    return load_scenario(name_or_path)
