"""What the autopilots' parameters say of their fence; its zones come over the mission protocol."""

from collections.abc import Mapping
from dataclasses import dataclass

# ArduPilot's bits of FENCE_TYPE and FENCE_OPTIONS
_HIGHEST, _CIRCLE, _ZONES, _LOWEST = 1, 2, 4, 8
_UNION_OF_INCLUSIONS = 2


@dataclass(frozen=True, slots=True)
class FenceSettings:
    """What an autopilot makes of its fence; heights are above home, `None`: no such limit.

    `on` is `None` while nobody knows. `any_inclusion`: inside one of several inclusion zones is enough.
    `zones`: whether the zones count that were uploaded. `home_radius_m` is a circle around home to stay in.
    """

    on: bool | None = None
    any_inclusion: bool = False
    zones: bool = True
    home_radius_m: float | None = None
    min_height_m: float | None = None
    max_height_m: float | None = None
    margin_m: float = 0.0


def ardupilot_fence(values: Mapping[str, float]) -> FenceSettings:
    """FENCE_* parameters; what was not answered limits nothing but the zones, which count until known off."""
    enabled, automatic = values.get("FENCE_ENABLE"), values.get("FENCE_AUTOENABLE")
    on = None if enabled is None else bool(enabled or automatic)
    kinds = values.get("FENCE_TYPE")
    bits = _ZONES if kinds is None else _bits(kinds)
    options = _bits(values.get("FENCE_OPTIONS", 0.0))
    return FenceSettings(
        on=on,
        any_inclusion=bool(options & _UNION_OF_INCLUSIONS),
        zones=bool(bits & _ZONES),
        home_radius_m=_positive(values.get("FENCE_RADIUS")) if bits & _CIRCLE else None,
        min_height_m=values.get("FENCE_ALT_MIN") if bits & _LOWEST else None,
        max_height_m=_positive(values.get("FENCE_ALT_MAX")) if bits & _HIGHEST else None,
        margin_m=_positive(values.get("FENCE_MARGIN")) or 0.0,
    )


def px4_fence(values: Mapping[str, float]) -> FenceSettings:
    """GF_* parameters; PX4 wants to be inside one of the inclusion zones, and 0 switches a limit off."""
    action = values.get("GF_ACTION")
    return FenceSettings(
        on=None if action is None else action != 0.0,
        any_inclusion=True,
        home_radius_m=_positive(values.get("GF_MAX_HOR_DIST")),
        max_height_m=_positive(values.get("GF_MAX_VER_DIST")),
    )


def _positive(value: float | None) -> float | None:
    return value if value is not None and value > 0.0 else None


def _bits(value: float) -> int:
    return int(value) if 0.0 <= value < 2**31 else 0
