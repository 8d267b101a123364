"""The content of a configuration file, composed of parameters that are defined next to their use."""

import difflib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Le, MinLen
from pydantic import AfterValidator

from companion.address import ReceiverAddress, host_and_port, is_of_receiver, parse_any_address
from companion.airspace.fences import FenceZone
from companion.airspace.obstacles import Obstacle, ObstacleParams
from companion.autopilots import MODE_NAMES, MODES_OF, NEVER_TAKEN
from companion.avoidance import AvoidanceParams
from companion.control.rejoin import ControlParams
from companion.control.state_machine import SupervisorParams
from companion.engine import AircraftLimits, EngineConfig, EngineParams
from companion.errors import ConfigError, LinkError
from companion.sources.registry import decoder_class
from companion.traffic import TrafficParams


def _is_address(text: str) -> str:
    try:
        address = parse_any_address(text)
        if isinstance(address, ReceiverAddress):
            decoder_class(address.format)  # refuses a format that cannot be decoded here
    except (LinkError, ConfigError) as error:
        raise ValueError(str(error)) from error
    return text


def _are_distinct(addresses: tuple[str, ...]) -> tuple[str, ...]:
    if len({parse_any_address(text).place for text in addresses}) < len(addresses):
        raise ValueError("the same address is given twice")
    if all(map(is_of_receiver, addresses)):
        raise ValueError("one of them must be a MAVLink link: a receiver does not lead to the autopilot")
    return addresses


@dataclass(frozen=True, slots=True)
class RecordingParams:
    """The recordings of flights: everything received and sent, and the decisions."""

    enabled: bool = True
    directory: Path = Path("recordings")
    # A new part of a recording begins when one of its files reaches this size.
    max_file_mb: Annotated[int, Ge(1), Le(1_000_000)] = 256
    # Size of all recordings in the folder; above it the oldest are deleted, never the one being written.
    max_total_mb: Annotated[int, Ge(1), Le(1_000_000_000)] = 4096

    def __post_init__(self) -> None:
        if self.max_total_mb < self.max_file_mb:
            raise ValueError("max_total_mb must not be below max_file_mb")


def _is_listening_place(text: str) -> str:
    host_and_port(text)
    return text


@dataclass(frozen=True, slots=True)
class WebParams:
    """The live display: where it listens, who may change the role, and which other pages may show it."""

    enabled: bool = True
    # Local only, unless changed here: anyone who can reach this address can see everything.
    listen: Annotated[str, AfterValidator(_is_listening_place)] = "127.0.0.1:8080"
    # The first line of this file is the token with which a browser may change the role; without it the
    # display is read-only.
    token_file: Path | None = None
    # Origins (https://ground.example) of other pages that may open the stream.
    origins: tuple[str, ...] = ()


def _did_you_mean(mode: str) -> str:
    """A hint at the mode that was meant, if one is similar."""
    close = difflib.get_close_matches(mode.upper(), sorted(MODE_NAMES - NEVER_TAKEN), n=1)
    return f", did you mean {close[0]}?" if close else ""


@dataclass(frozen=True, slots=True)
class Config:
    """The configuration of `companion run`."""

    # MAVLink: udpin, udpout, tcpin or tcpout:HOST:PORT, or serial:DEVICE:BAUD. We receive on all links, and
    # send on those that do not end in `?listen`. Receivers of traffic, which are only listened to, have their
    # format before the address: sbs, beast, gdl90 or flarm:tcp:HOST:PORT (or :udpin:, :tcpin:, :serial:), and
    # readsb:http://HOST/PATH or readsb:file:/PATH of its aircraft.json.
    links: Annotated[
        tuple[Annotated[str, AfterValidator(_is_address)], ...], MinLen(1), AfterValidator(_are_distinct)
    ]
    # The autopilot; "auto" detects it from its heartbeat.
    autopilot: Literal["auto", "ardupilot", "px4"] = "auto"
    recording: RecordingParams = field(default_factory=RecordingParams)
    web: WebParams = field(default_factory=WebParams)
    # Written while we fly the aircraft: if the service is killed, the next run gives the aircraft back.
    state_file: Path = Path("companion.state")
    # Settings that the operator changed by MAVLink parameters; they take precedence over this file.
    settings_file: Path = Path("companion.settings")
    engine: EngineParams = field(default_factory=EngineParams)
    supervisor: SupervisorParams = field(default_factory=SupervisorParams)
    control: ControlParams = field(default_factory=ControlParams)
    traffic: TrafficParams = field(default_factory=TrafficParams)
    # Files of obstacles on the ground, YAML or GeoJSON; paths are relative to the folder of this file.
    obstacle_files: tuple[Path, ...] = ()
    obstacles: ObstacleParams = field(default_factory=ObstacleParams)
    avoidance: AvoidanceParams = field(default_factory=AvoidanceParams)
    # Limits that the autopilot's parameters do not give, or give too generously.
    aircraft: AircraftLimits = field(default_factory=AircraftLimits)
    # Zones to stay inside or outside of, in addition to the autopilot's own fence.
    fences: tuple[FenceZone, ...] = ()

    def __post_init__(self) -> None:
        for index, name in enumerate(self.supervisor.take_over_from):
            where = f"supervisor.take_over_from[{index}]"
            if name not in MODE_NAMES:
                raise ValueError(f"{where}: no autopilot has a mode {name!r}{_did_you_mean(name)}")
            if name in NEVER_TAKEN:
                raise ValueError(f"{where}: {name} is never taken over from")
        if self.autopilot != "auto" and not MODES_OF[self.autopilot] & {*self.supervisor.take_over_from}:
            raise ValueError(f"supervisor.take_over_from: {self.autopilot} has none of these modes")
        if self.settings_file == self.state_file:
            raise ValueError("settings_file and state_file must be two different files")
        self.for_engine()  # refuses sections that contradict each other

    def for_engine(self, known_obstacles: tuple[Obstacle, ...] = ()) -> EngineConfig:
        """The configuration of the engine, with the obstacles from the obstacle files."""
        return EngineConfig(
            autopilot=self.autopilot,
            engine=self.engine,
            supervisor=self.supervisor,
            control=self.control,
            traffic=self.traffic,
            obstacles=self.obstacles,
            known_obstacles=known_obstacles,
            avoidance=self.avoidance,
            aircraft=self.aircraft,
            fences=self.fences,
        )
