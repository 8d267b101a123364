"""PX4's own avoidance, and what it demands of a traffic receiver, by its parameters.

Without DAA_EN, as up to release 1.18, NAV_TRAFF_AVOID decides, in OFFBOARD too. With it, as in the main
branch since July 2026, detect-and-avoid acts while DAA_EN is set: built after ASTM F3442 by DAA_LVL_*_ACT,
otherwise by NAV_TRAFF_AVOID. It acts only from the modes that navigate by themselves, GUIDED_COURSE among
them, and never from OFFBOARD.
"""

from collections.abc import Mapping

_ENABLED = "DAA_EN"
_BEFORE_DAA = "NAV_TRAFF_AVOID"
_LEVELS = ("DAA_LVL_CRIT_ACT", "DAA_LVL_HIGH_ACT", "DAA_LVL_MED_ACT", "DAA_LVL_LOW_ACT")
_RECEIVER, _RECEIVER_BEFORE = "COM_TRAFF_AVOID", "COM_ARM_TRAFF"
FIRST = (_BEFORE_DAA, _ENABLED)
OTHERS = (*_LEVELS, _RECEIVER, _RECEIVER_BEFORE)
_ACTS_FROM = 2.0  # of all actions: 0 does nothing, 1 warns
_RECEIVER_LOSS_BEFORE = {1: "warns", 2: "blocks arming", 3: "blocks arming for missions"}
_RECEIVER_LOSS = {1: "warns", 2: "blocks arming", 3: "returns home", 4: "lands"}


def acting(parameters: Mapping[str, float], *, offboard: bool) -> str | None:
    """The parameter by which PX4 itself acts on traffic, with its value; `None`: it does not act.

    `offboard`: we fly it in OFFBOARD.
    """
    if parameters.get(_ENABLED, 1.0) < 1.0 or (offboard and _ENABLED in parameters):
        return None
    levels = [name for name in _LEVELS if name in parameters]
    for name in levels or [_BEFORE_DAA]:
        if parameters.get(name, 0.0) >= _ACTS_FROM:
            return f"{name} {parameters[name]:.0f}"
    return None


def receiver_advice(parameters: Mapping[str, float]) -> list[str]:
    """What happens if no traffic receiver sends heartbeats to PX4, if anything does."""
    return [
        f"{name} {int(parameters[name])}: {does} without receiver heartbeats"
        for name, losses in ((_RECEIVER, _RECEIVER_LOSS), (_RECEIVER_BEFORE, _RECEIVER_LOSS_BEFORE))
        if (does := losses.get(int(parameters.get(name, 0.0)))) is not None
    ]
