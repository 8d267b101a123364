"""The fence in force: which zones are combined, and the margin."""

from companion.airspace.fences import AutopilotFence, FenceSettings, FenceZone, fence_in_force
from companion.avoidance import Fence
from companion.geodesy import LocalFrame

FRAME = LocalFrame(47.0, 8.0)
HOME_M = 500.0
CONFIGURED = FenceZone(True, centre_deg=(47.0, 8.0), radius_m=5000.0)
INCLUSIONS = (
    FenceZone(True, centre_deg=(47.0, 8.0), radius_m=900.0),
    FenceZone(True, centre_deg=(47.01, 8.0), radius_m=800.0),
)
EXCLUSION = FenceZone(False, centre_deg=(47.01, 8.01), radius_m=70.0)


def combined(autopilot: AutopilotFence, *configured: FenceZone) -> Fence:
    fence = fence_in_force(configured, autopilot, FRAME, HOME_M)
    assert fence is not None
    return fence


def radii_m(fence: Fence) -> list[float | None]:
    return [zone.radius_m for zone in fence.zones]


def test_without_zones_there_is_no_fence() -> None:
    assert fence_in_force((), AutopilotFence(), FRAME, HOME_M) is None
    not_enforced = AutopilotFence(FenceSettings(zones=False), INCLUSIONS)
    assert fence_in_force((), not_enforced, FRAME, HOME_M) is None


def test_configured_zones_come_first_then_the_circle_around_home_then_uploaded_zones() -> None:
    autopilot = AutopilotFence(FenceSettings(home_radius_m=2000.0), (EXCLUSION,), (47.0, 8.0))
    assert radii_m(combined(autopilot, CONFIGURED)) == [5000.0, 2000.0, 70.0]
    assert radii_m(combined(autopilot._replace(home_deg=None), CONFIGURED)) == [5000.0, 70.0]


def test_the_margin_is_the_autopilots_but_at_least_thirty_metres() -> None:
    for margin_m, expected_m in ((0.0, 30.0), (29.0, 30.0), (45.0, 45.0)):
        autopilot = AutopilotFence(FenceSettings(margin_m=margin_m), (EXCLUSION,))
        assert combined(autopilot).margin_m == expected_m


def test_any_inclusion_needs_at_least_two_uploaded_inclusion_zones() -> None:
    settings = FenceSettings(any_inclusion=True)
    assert combined(AutopilotFence(settings, INCLUSIONS)).any_inclusion
    assert not combined(AutopilotFence(settings, INCLUSIONS[:1])).any_inclusion
    assert not combined(AutopilotFence(FenceSettings(), INCLUSIONS)).any_inclusion


def test_alternative_inclusion_zones_do_not_weaken_a_configured_one() -> None:
    autopilot = AutopilotFence(FenceSettings(any_inclusion=True), (*INCLUSIONS, EXCLUSION))
    fence = combined(autopilot, CONFIGURED)
    assert not fence.any_inclusion
    assert radii_m(fence) == [5000.0, 70.0]
