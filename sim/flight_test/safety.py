"""Whether the vehicle at the link is a simulation. Anything else is flown only when the user says so."""

import asyncio

from companion.errors import CompanionError
from companion.mavlink.dialect import mavlink
from sim.flight_test.observer import Observer
from sim.flight_test.station import Station

# Parameters that only simulations have, or that say so by a value above zero.
_SIGNS = {"ardupilot": ("SIM_SPEEDUP",), "px4": ("SYS_HITL",)}
_PRESENT = frozenset({"SIM_SPEEDUP"})
_ANSWERED_WITHIN_S = 0.5
_ASKED_FOR = (
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    mavlink.MAVLINK_MSG_ID_SIM_STATE,
    mavlink.MAVLINK_MSG_ID_SIMSTATE,
)


class RealAircraftError(CompanionError):
    """The vehicle shows no sign of a simulation."""


async def sign_of_simulation(observer: Observer, station: Station) -> str | None:
    """The first sign that the vehicle is simulated, in words; `None` without any."""
    for message_id in _ASKED_FOR:
        await station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id)
    await asyncio.sleep(_ANSWERED_WITHIN_S)
    if observer.in_simulation is not None:
        return observer.in_simulation
    for name in _SIGNS.get(observer.name, ()):
        value = await station.read(name)
        if value is not None and (name in _PRESENT or value > 0.0):
            return f"parameter {name}"
    return None


def refuse_real_aircraft(observer: Observer, sign: str | None, *, allowed: bool) -> None:
    """`RealAircraftError` unless the vehicle is simulated, or the user allowed a real one."""
    if sign is not None or allowed:
        return
    armed = "armed " if observer.armed else ""
    raise RealAircraftError(
        f"refused: this {armed}vehicle shows no sign of a simulation (no SIMSTATE, SIM_STATE or HIL flag, no "
        f"simulation parameter). With --real-aircraft the test arms it and flies it at simulated traffic."
    )
