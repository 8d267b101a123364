"""The plan of the evidence: its campaigns, with their shares of the encounters."""

from dataclasses import dataclass, field
from functools import cached_property

from sim.campaign.avoiders import COMPANION
from sim.campaign.changes import Changes
from sim.campaign.plan import BOTH, Part, Plan
from sim.encounters import SURVEILLANCE_PRESETS
from sim.evidence.sweeps import BASE, SWEEPS, TRADE_OFF, Sweep

PERFECT = "perfect"
PRESETS = tuple(SURVEILLANCE_PRESETS)
# Encounters of each campaign, as a share of those with perfect reports.
_OTHER_PRESETS, _PEERS, _TWO_SIDED, _LOCKED, _SWEEP, _TRADE_OFF, _TRACKS = 0.4, 0.1, 0.1, 0.2, 0.1, 0.2, 0.1
_FEWEST = 2
_MOST_TRACKS = 300


@dataclass(frozen=True)
class Campaign:
    """A campaign with the name of its results file."""

    name: str
    plan: Plan


@dataclass(frozen=True)
class EvidencePlan:
    """All that is flown for the evidence; the same plan gives the same figures on any machine."""

    encounters: int
    seed: int = 0
    peers: tuple[str, ...] = ()
    models: tuple[str, ...] = ()
    part: Part = Part.EVALUATION
    presets: tuple[str, ...] = field(default=PRESETS)
    sweeps: tuple[Sweep, ...] = SWEEPS
    trade_off: tuple[tuple[str, Changes], ...] = TRADE_OFF

    @cached_property
    def campaigns(self) -> dict[str, Campaign]:
        """The campaigns by name, in the order of their flights."""
        others = tuple(name for name in self.presets if name != PERFECT)
        plans = {
            PERFECT: self.base(1.0),
            "presets": self.base(_OTHER_PRESETS, surveillance=others),
            "height-locked": self.base(_LOCKED, lock_height=True),
            "two-sided": self.base(
                _TWO_SIDED,
                avoiders=(COMPANION, COMPANION + BOTH),
                surveillance=(PERFECT, BASE),
                two_sided=True,
            ),
        }
        if self.peers:
            plans["peers"] = self.base(_PEERS, avoiders=self.peers, surveillance=self.presets)
        plans |= {key: plan for sweep in self.sweeps for key, plan in self._of_sweep(sweep).items()}
        for label, changes in self.trade_off:
            plans[trade_off_campaign(label)] = self.base(_TRADE_OFF, surveillance=(BASE,), avoidance=changes)
        return {name: Campaign(name, plan) for name, plan in plans.items()}

    @property
    def tracks(self) -> int:
        """Encounters per preset in which the tracks are compared with the truth."""
        return min(self._share(_TRACKS), _MOST_TRACKS)

    @property
    def flights(self) -> int:
        """Number of flights of all campaigns, and of followed encounters."""
        flown = sum(campaign.plan.flights for campaign in self.campaigns.values())
        return flown + self.tracks * len(self.presets)

    def base(self, share: float, **settings: object) -> Plan:
        """A campaign of a share of the encounters."""
        return Plan(
            self._share(share),
            self.seed,
            models=self.models,
            part=self.part,
            **settings,  # type: ignore[arg-type]
        )

    def _share(self, share: float) -> int:
        return max(round(share * self.encounters), min(self.encounters, _FEWEST))

    def _of_sweep(self, sweep: Sweep) -> dict[str, Plan]:
        """One campaign for all values of a surveillance, as they share a file; one for each own aircraft."""
        if not any(point.own_limits for point in sweep.points):
            names = tuple(point.surveillance for point in sweep.points)
            return {sweep.name: self.base(_SWEEP, surveillance=names)}
        return {
            f"{sweep.name}-{point.label}": self.base(
                _SWEEP, surveillance=(point.surveillance,), own_limits=point.own_limits
            )
            for point in sweep.points
        }


def trade_off_campaign(label: str) -> str:
    """The name of the campaign that flies a point of the trade-off."""
    return f"trade-off-{label.replace(' ', '-')}"


def campaign_of(sweep: Sweep, place: int) -> str:
    """The name of the campaign that flies a value of a sweep."""
    point = sweep.points[place]
    return f"{sweep.name}-{point.label}" if point.own_limits else sweep.name
