"""What the operator is told of the situation at large: who is there, what we are told to do, what to set."""

from companion.gcs.requests import GcsRequests
from companion.gcs.settings import Settings
from companion.gcs.statustext import StatusText
from companion.mavlink.dialect import mavlink
from companion.model import Role
from companion.output.effects import Effect, Say
from companion.ownship.aircraft import Aircraft
from companion.ownship.autopilot_queries import AutopilotQueries

# Others may be heard before the one that is configured.
_CONFIGURED_AWAITED_S = 5.0
_ROLES = {Role.OFF: "be off", Role.ADVISE: "advise only", Role.FLY: "fly"}


class OperatorNotices:
    """Tells each of it once, and again only what changed."""

    def __init__(
        self,
        aircraft: Aircraft,
        queries: AutopilotQueries,
        operator: GcsRequests,
        announcer: StatusText,
        settings: Settings,
    ) -> None:
        self._aircraft = aircraft
        self._onboard = queries
        self._operator = operator
        self._announcer = announcer
        self._settings = settings
        self._role_told = Role.FLY  # what everybody expects

    def tick(self, now_s: float) -> list[Effect]:
        """What there is to tell."""
        return [
            effect
            for problem in (*self._advice(), *self._company(now_s))
            for effect in self._announcer.tell(
                mavlink.MAV_SEVERITY_WARNING, f"Avoidance: {problem}", now_s, once=True
            )
        ] + [*self._role(now_s), *self._tuned(now_s)]

    def other_avoider(self) -> str | None:
        """The autopilot's own avoidance, where it acts."""
        adapter = self._aircraft.adapter
        return None if adapter is None else adapter.other_avoider(self._onboard.parameters)

    def _role(self, now_s: float) -> list[Effect]:
        role = self._operator.role
        if role is self._role_told:
            return []
        self._role_told = role
        return self._announcer.tell(mavlink.MAV_SEVERITY_NOTICE, f"Avoidance told to {_ROLES[role]}", now_s)

    def _tuned(self, now_s: float) -> list[Effect]:
        """What was refused of what the operator set; what was done his ground station shows."""
        operator = self._operator
        refusals, operator.refusals = operator.refusals, []
        changes, operator.changes = operator.changes, []
        told = [
            effect
            for words in refusals
            for effect in self._announcer.tell(mavlink.MAV_SEVERITY_WARNING, words, now_s)
        ]
        return [*told, *(Say(mavlink.MAV_SEVERITY_INFO, words) for words in changes)]

    def _advice(self) -> list[str]:
        """What should be set otherwise in the autopilot."""
        adapter, other = self._aircraft.adapter, self.other_avoider()
        words = [] if adapter is None else adapter.advice(self._onboard.parameters)
        if other is not None:
            advising = self._settings.supervisor.beside_other_avoider == "advise"
            consequence = ", advising only" if advising else ""
            words.append(f"autopilot avoids too ({other}){consequence}")
        return words

    def _company(self, now_s: float) -> list[str]:
        """Who is heard that should not be, or is not what should be."""
        aircraft = self._aircraft
        if aircraft.adapter is not None:
            if aircraft.others:
                return [f"another autopilot, system {min(aircraft.others)}"]
            return [] if aircraft.fixed_wing else ["not a fixed wing, advising only"]
        if len(aircraft.others) > 1:
            return ["several autopilots, set autopilot_system_id"]
        waited = (
            s for s, since_s in aircraft.unwanted_since_s.items() if now_s - since_s >= _CONFIGURED_AWAITED_S
        )
        return [f"system {number} is heard, not the autopilot configured" for number in waited][:1]
