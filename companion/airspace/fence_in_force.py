"""The fence in force: configured zones, the autopilot's own zones, and its circle around home."""

from typing import NamedTuple

from companion.airspace.autopilot_fences import AutopilotFence
from companion.airspace.fence_zones import FenceZone
from companion.avoidance import Fence
from companion.geodesy import LocalFrame

# Own position, wind and the autopilot's course tracking are each known to within this distance.
_MIN_MARGIN_M = 30.0


class _Source(NamedTuple):
    """Everything that the fence in the local frame is made from, besides the configuration."""

    frame: LocalFrame
    home_altitude_m: float
    autopilot: AutopilotFence


class FenceInForce:
    """Combines the configured zones with the autopilot's fence; keeps the result until an input changes."""

    def __init__(self, configured: tuple[FenceZone, ...] = ()) -> None:
        self._configured = configured
        self._source: _Source | None = None
        self._fence: Fence | None = None

    def in_frame(self, frame: LocalFrame, home_altitude_m: float, autopilot: AutopilotFence) -> Fence | None:
        """The fence in the local frame, `None` without zones; the same object until an input changes.

        Its margin is the autopilot's, but at least 30 m.
        """
        # Home's altitude varies by centimetres all the time; whole metres keep the fence constant.
        source = _Source(frame, float(round(home_altitude_m)), autopilot)
        if self._source != source:
            self._source, self._fence = source, self._combine(source)
        return self._fence

    def _combine(self, source: _Source) -> Fence | None:
        settings = source.autopilot.settings
        uploaded = source.autopilot.zones if settings.zones else ()
        others = [*self._configured]
        if settings.home_radius_m is not None and source.autopilot.home_deg is not None:
            home_circle = FenceZone(
                True, centre_deg=source.autopilot.home_deg, radius_m=settings.home_radius_m
            )
            others.append(home_circle)
        any_inclusion = settings.any_inclusion and sum(zone.inclusion for zone in uploaded) > 1
        if any_inclusion and any(zone.inclusion for zone in others):
            # A fence cannot express "inside any of these, and inside that one". The autopilot itself
            # still enforces its own inclusion zones.
            uploaded = tuple(zone for zone in uploaded if not zone.inclusion)
            any_inclusion = False
        zones = tuple(zone.in_frame(source.frame, source.home_altitude_m) for zone in (*others, *uploaded))
        if not zones:
            return None
        return Fence(zones, max(settings.margin_m, _MIN_MARGIN_M), any_inclusion=any_inclusion)
