"""Who is taken for whom: how alike two reports of one aircraft are, and for how long."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt


@dataclass(frozen=True, slots=True)
class AssociationParams:
    """How alike two reports of one aircraft are, heard in two ways, and for how long they must be."""

    # Two satellite receivers, each with its error, and the lag of the estimates in a turn.
    horizontal_m: Annotated[float, Gt(0)] = 60.0
    # Each way has its own delay: by the path flown in this time they may be further apart, along it.
    delay_s: Annotated[float, Ge(0)] = 1.0
    # Besides what the references of the two heights leave open.
    vertical_m: Annotated[float, Gt(0)] = 40.0
    velocity_mps: Annotated[float, Gt(0)] = 6.0
    climb_mps: Annotated[float, Gt(0)] = 3.0
    merge_reports: Annotated[int, Ge(1)] = 4
    merge_after_s: Annotated[float, Ge(0)] = 4.0
    # Apart is who is outside a gate that is so many times as large.
    split_factor: Annotated[float, Gt(1)] = 2.5
    split_reports: Annotated[int, Ge(1)] = 3
    split_after_s: Annotated[float, Ge(0)] = 3.0


@dataclass(frozen=True, slots=True)
class EchoParams:
    """How like us an echo is. Velocities tell more than places: satellites give them to a few decimetres."""

    radius_m: Annotated[float, Gt(0)] = 30.0
    vertical_m: Annotated[float, Gt(0)] = 40.0
    velocity_mps: Annotated[float, Gt(0)] = 2.5
    climb_mps: Annotated[float, Gt(0)] = 2.0
    # By how much a report may be late: networks take seconds.
    delay_s: Annotated[float, Ge(0)] = 3.0
    reports: Annotated[int, Ge(1)] = 5
    after_s: Annotated[float, Ge(0)] = 5.0
    # It is somebody else once it is outside a gate so many times as large for so many reports.
    split_factor: Annotated[float, Gt(1)] = 2.0
    split_reports: Annotated[int, Ge(1)] = 2
