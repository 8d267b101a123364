"""Notices and conditions that are not about traffic: other systems, our role, settings, hindrances."""

import re
from collections.abc import Iterator

from companion.avoidance import Control
from companion.control.readiness import Readiness
from companion.gcs.requests import GcsRequests
from companion.gcs.settings import Settings
from companion.mavlink.dialect import mavlink
from companion.model import Role
from companion.output.notice import Condition, Notice
from companion.ownship.aircraft import Aircraft
from companion.ownship.autopilot_queries import AutopilotQueries

# The configured autopilot is awaited for this long before others are reported.
_CONFIGURED_AWAITED_S = 5.0
# Limits are reported parameter by parameter: a combination that lasts for less is not announced.
_LIMITS_SETTLED_S = 3.0
# A climb through the lowest height, or a moment without a position, is no news unless there is traffic.
_HINDERED_S, _HINDERED_IN_CONFLICT_S = 10.0, 3.0
# A sensor is calibrated, or not connected yet, while the autopilot starts.
_SENSOR_AWAITED_S = 10.0
_ROLES = {Role.OFF: "off", Role.ADVISE: "advise only", Role.FLY: "fly"}


class OperatorNotices:
    """Returns each notice when something has changed, and the conditions as long as they hold."""

    def __init__(
        self, aircraft: Aircraft, queries: AutopilotQueries, operator: GcsRequests, settings: Settings
    ) -> None:
        self._aircraft = aircraft
        self._queries = queries
        self._operator = operator
        self._settings = settings
        self._announced_role = Role.FLY  # the usual role is not announced

    def tick(self) -> list[Notice]:
        """The notices of this tick."""
        return self._role() + self._settings_changed()

    def conditions(self, readiness: Readiness, now_s: float, *, threatened: bool) -> list[Condition]:
        """The conditions that hold now; `threatened`: there is a conflict."""
        hindered = self._hindered(readiness, now_s, threatened=threatened)
        advice = self._advice(threatened=threatened)
        return [*advice, *self._lost_controls(), *self._other_systems(now_s), *hindered]

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

    def _advice(self, *, threatened: bool) -> Iterator[Condition]:
        """Settings of the autopilot to know or change; most of them cannot be changed in flight."""
        adapter, other = self._aircraft.adapter, self.other_avoider()
        if adapter is None:
            return
        for text in adapter.advice(self._queries.parameters):
            yield _condition(text, text, matters=False)
        for text in self._queries.limits.warnings:
            yield _condition(text, text, matters=False, after_s=_LIMITS_SETTLED_S)
        if other is not None:
            advising = self._settings.supervisor.beside_other_avoider == "advise"
            consequence = ", advising only" if advising else ""
            yield _condition(
                "other avoider",
                f"autopilot avoids too ({other}){consequence}",
                "autopilot does not avoid any more",
                matters=self._aircraft.flight_state.armed or threatened,
            )

    def _lost_controls(self) -> Iterator[Condition]:
        """What an avoidance cannot command."""
        adapter = self._aircraft.adapter
        if self._aircraft.kinematics.airspeed.sensor_usable is False:
            text = "no airspeed sensor, speed not commanded"
            yield _condition("airspeed", text, matters=False, after_s=_SENSOR_AWAITED_S)
        if adapter is not None and Control.HEADING in adapter.lost_controls:
            yield _condition("courses", "courses refused, height only", "courses commanded again")

    def _other_systems(self, now_s: float) -> Iterator[Condition]:
        """Systems that are heard and should not be, and an aircraft of the wrong type."""
        aircraft = self._aircraft
        if aircraft.adapter is not None:
            if aircraft.identity.is_ambiguous(now_s) and not self._is_to_fly():
                yield _condition("two vehicles", "two vehicles have its system id", "one vehicle is left")
            if others := aircraft.identity.others(now_s):
                text = f"another autopilot, system {min(others)}"
                yield _condition(text, text, matters=False)
            elif not aircraft.flight_state.flies_as_wing(aircraft.identity.vehicle_type):
                yield _condition("type", "not a fixed wing, advising only", matters=False)
            return
        if len(aircraft.identity.others(now_s)) > 1:
            yield _condition(
                "several autopilots",
                "several autopilots, set autopilot_system_id",
                "only one autopilot is left",
            )
            return
        for number, since_s in aircraft.identity.unwanted_since_s(now_s).items():
            if now_s - since_s >= _CONFIGURED_AWAITED_S:
                yield _condition(
                    "unwanted autopilot",
                    f"system {number} is heard, not the autopilot configured",
                    "the autopilot configured is heard",
                )
                return

    def _hindered(self, readiness: Readiness, now_s: float, *, threatened: bool) -> Iterator[Condition]:
        """The reasons why an aircraft in the air, in a mode to take over from, would not be taken over."""
        if not self._is_to_fly():
            return
        for reason in readiness.hindrances(now_s, self._operator.role):
            yield Condition(
                f"hindered: {re.sub('[0-9]+', '', reason)}",
                mavlink.MAV_SEVERITY_WARNING,
                f"Avoidance off: {reason}",
                "Avoidance on again",
                after_s=_HINDERED_IN_CONFLICT_S if threatened else _HINDERED_S,
            )

    def _is_to_fly(self) -> bool:
        """Whether the aircraft is in the air and in a mode to take over from, and our role is to fly it."""
        aircraft = self._aircraft
        in_the_air = aircraft.flight_state.armed and aircraft.flight_state.may_be_in_the_air
        if self._operator.role is not Role.FLY or not in_the_air or aircraft.taking_off_or_landing():
            return False
        return aircraft.mode in self._settings.supervisor.take_over_from


def _condition(
    key: str, text: str, ended: str | None = None, *, matters: bool = True, after_s: float = 0.0
) -> Condition:
    """A condition of the severity WARNING; a warning that never changes is its own key."""
    ended = None if ended is None else f"Avoidance: {ended}"
    return Condition(key, mavlink.MAV_SEVERITY_WARNING, f"Avoidance: {text}", ended, matters, after_s)
