"""Notices that are not about traffic: other systems, our role, settings to change."""

from companion.gcs.requests import GcsRequests
from companion.gcs.settings import Settings
from companion.mavlink.dialect import mavlink
from companion.model import Role
from companion.output.notice import Notice
from companion.ownship.aircraft import Aircraft
from companion.ownship.autopilot_queries import AutopilotQueries

# The configured autopilot is awaited for this long before others are reported.
_CONFIGURED_AWAITED_S = 5.0
_ROLES = {Role.OFF: "off", Role.ADVISE: "advise only", Role.FLY: "fly"}


class OperatorNotices:
    """Returns each notice once, and again when it has changed."""

    def __init__(
        self, aircraft: Aircraft, queries: AutopilotQueries, operator: GcsRequests, settings: Settings
    ) -> None:
        self._aircraft = aircraft
        self._queries = queries
        self._operator = operator
        self._settings = settings
        self._announced_role = Role.FLY  # the usual role is not announced

    def tick(self, now_s: float) -> list[Notice]:
        """The notices of this tick."""
        problems = (*self._advice(), *self._other_systems(now_s))
        notices = [
            Notice(mavlink.MAV_SEVERITY_WARNING, f"Avoidance: {problem}", once=True) for problem in problems
        ]
        return notices + self._role() + self._settings_changed()

    def other_avoider(self) -> str | None:
        """The autopilot's own avoidance, where it acts."""
        adapter = self._aircraft.adapter
        return None if adapter is None else adapter.other_avoider(self._queries.parameters)

    def _role(self) -> list[Notice]:
        role = self._operator.role
        if role is self._announced_role:
            return []
        self._announced_role = role
        return [Notice(mavlink.MAV_SEVERITY_NOTICE, f"Avoidance role: {_ROLES[role]}")]

    def _settings_changed(self) -> list[Notice]:
        """Refused settings for the operator; accepted ones, which the ground station shows, for the log."""
        operator = self._operator
        refusals, operator.refusals = operator.refusals, []
        changes, operator.changes = operator.changes, []
        refused = [Notice(mavlink.MAV_SEVERITY_WARNING, text) for text in refusals]
        return refused + [Notice(mavlink.MAV_SEVERITY_INFO, text, log_only=True) for text in changes]

    def _advice(self) -> list[str]:
        """Settings of the autopilot that the operator should know or change."""
        adapter, other = self._aircraft.adapter, self.other_avoider()
        texts = [] if adapter is None else adapter.advice(self._queries.parameters)
        if other is not None:
            advising = self._settings.supervisor.beside_other_avoider == "advise"
            consequence = ", advising only" if advising else ""
            texts.append(f"autopilot avoids too ({other}){consequence}")
        return texts

    def _other_systems(self, now_s: float) -> list[str]:
        """Systems that are heard and should not be, and an aircraft of the wrong type."""
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
