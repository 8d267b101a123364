"""PX4's modes: a custom mode is main << 16 | sub << 24."""

from collections.abc import Mapping

_AUTO, _POSCTL = 4, 3
_MAIN_MODES = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
    9: "SIMPLE",
    10: "TERMINATION",
    11: "ALTITUDE_CRUISE",
}
_SUB_MODES: Mapping[int, Mapping[int, str]] = {
    _POSCTL: {1: "ORBIT", 2: "POSITION_SLOW"},
    _AUTO: {
        1: "READY",
        2: "TAKEOFF",
        3: "HOLD",
        4: "MISSION",
        5: "RETURN",
        6: "LAND",
        8: "FOLLOW",
        9: "PRECLAND",
        10: "VTOL_TAKEOFF",
        **{10 + number: f"EXTERNAL{number}" for number in range(1, 9)},
        19: "GUIDED_COURSE",
        20: "DESCEND",
    },
}
MODES = frozenset(_MAIN_MODES.values()).union(*(modes.values() for modes in _SUB_MODES.values()))


def custom_mode(main: int, sub: int = 0) -> int:
    """The custom mode of a main mode and a sub mode."""
    return main << 16 | sub << 24


def parts(mode: int) -> tuple[int, int]:
    """Main and sub mode of a custom mode."""
    return mode >> 16 & 0xFF, mode >> 24 & 0xFF


def name_of(mode: int) -> str:
    """The name of a custom mode, as ground stations show it."""
    main, sub = parts(mode)
    if sub_mode := _SUB_MODES.get(main, {}).get(sub):
        return sub_mode
    return f"AUTO {sub}" if main == _AUTO else _MAIN_MODES.get(main, f"MODE {main}")


HOLD = custom_mode(_AUTO, 3)
RETURN, LAND = custom_mode(_AUTO, 5), custom_mode(_AUTO, 6)
OFFBOARD = custom_mode(6)
GUIDED_COURSE = custom_mode(_AUTO, 19)
