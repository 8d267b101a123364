"""What the pilot must know about the aircraft in our hands, or left by us, for as long as it lasts."""

from companion.control.context import ControlContext
from companion.control.state_machine import FLYING, State
from companion.control.unattended_guided import UnattendedGuided
from companion.mavlink.dialect import mavlink
from companion.output.notice import Condition

# Giving back takes a second or two.
_RELEASED_AFTER_S = 4.0
# By then the operator has read why we let go.
_LEFT_AFTER_S = 2.0
# An avoidance or a way back that lasts longer than this is news again, with what can be done about it.
_LONG_S = 120.0


def conditions(context: ControlContext, unattended: UnattendedGuided, now_s: float) -> list[Condition]:
    """The conditions that hold at `now_s`."""
    state, data, aircraft = context.supervisor.state, context.data, context.aircraft
    if aircraft.adapter is None:
        return []
    if state is State.RESYNCHRONISING:
        return [_alarm("no heartbeat since a stall, take over", _RELEASED_AFTER_S)]
    if state in (State.RELEASING, State.STOPPING):
        return [_alarm(f"not in {context.prior_mode} yet, take over", _RELEASED_AFTER_S)]
    if state in FLYING:
        return _long_avoidance(context, now_s)
    if data.fallback is not None:
        return [_alarm(f"{context.prior_mode} refused, choose a mode", 0.0)]
    if unattended.is_left(now_s):
        return [_alarm(f"{aircraft.mode}, flown by no one, take over", _LEFT_AFTER_S)]
    return []


def _alarm(text: str, after_s: float) -> Condition:
    ended = "Avoidance: alarm over"
    return Condition(
        "unattended", mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: {text}", ended, after_s=after_s
    )


def _long_avoidance(context: ControlContext, now_s: float) -> list[Condition]:
    """An avoidance that goes on and on: beside a helicopter that hovers at the next waypoint, for example."""
    returning = context.supervisor.state is State.RETURNING
    rejoin = context.data.rejoin
    since_s = rejoin.began_s if returning and rejoin is not None else context.data.flown_since_s
    if since_s is None or now_s - since_s < _LONG_S:
        return []
    what = "returning" if returning else "avoiding"
    text = f"Avoidance: {what} for {(now_s - since_s) / 60.0:.0f} min, RESUME or take over"
    return [Condition("long avoidance", mavlink.MAV_SEVERITY_WARNING, text)]
