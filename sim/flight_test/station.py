"""The ground station of the flight test: MAVSDK, an implementation of MAVLink that is not ours."""

import asyncio
import json
import math
from collections.abc import Awaitable, Callable, Sequence
from types import TracebackType
from typing import Any, TypeVar

from companion.errors import CompanionError
from sim.vehicle import MissionItem

T = TypeVar("T")

SYSTEM_ID, COMPONENT_ID = 255, 190
_FIND_S = 20.0
_MISSION_ATTEMPTS = 4


class StationError(CompanionError):
    """The vehicle did not do what the ground station asked for."""


class Station:
    """Connects to the hub's port on loopback; as a context, from connecting to disconnecting."""

    def __init__(self, port: int) -> None:
        import mavsdk.asyncio
        from mavsdk import Configuration
        from mavsdk.logging import log_subscribe

        log_subscribe(lambda *_: True)  # it would write over the live table
        self._client = mavsdk.asyncio.Mavsdk(Configuration.create_manual(SYSTEM_ID, COMPONENT_ID, True))
        self._port = port
        self._plugins: dict[str, Any] = {}
        self.target = 1

    async def __aenter__(self) -> "Station":
        await self._client.__aenter__()
        await self._client.add_any_connection(f"udpout://127.0.0.1:{self._port}")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._plugins.clear()
        await self._client.__aexit__(kind, error, trace)

    async def find(self, system_id: int) -> None:
        """Wait for the autopilot of this system; `StationError` if there is none, or another."""
        system = await self._client.first_autopilot(timeout_s=_FIND_S)
        if system is None:
            raise StationError("MAVSDK found no autopilot at the vehicle's link")
        self.target = await system.get_system_id()
        if self.target != system_id:
            raise StationError(f"MAVSDK found system {self.target}, the test system {system_id}")
        self._plugins = _plugins(system)

    # --- parameters

    async def read(self, name: str) -> float | None:
        """A parameter's value; `None` if the vehicle has none of that name."""
        param = self._plugins["param"]
        for get in (param.get_param_float, param.get_param_int):
            try:
                return float(await get(name))
            except Exception:  # noqa: BLE001 - of the wrong type, or unknown: MAVSDK has no base class
                continue
        return None

    async def write(self, name: str, value: float) -> None:
        """Set a parameter, of whatever type it is; `StationError` if it is refused."""
        param = self._plugins["param"]
        try:
            try:
                await param.get_param_int(name)
            except Exception:  # noqa: BLE001 - see `read`
                await param.set_param_float(name, float(value))
            else:
                await param.set_param_int(name, round(value))
        except Exception as error:
            raise StationError(f"parameter {name} could not be set to {value:g}: {error}") from error

    # --- mission

    async def upload(self, items: Sequence[MissionItem]) -> None:
        """Upload a mission, again if the vehicle does not answer at first."""
        sent = [_as_mavsdk(item, number) for number, item in enumerate(items)]
        await self._again(lambda: self._plugins["mission"].upload_mission(sent), "mission not uploaded")

    async def download(self) -> list[MissionItem]:
        """The mission in the vehicle."""
        items = await self._again(self._plugins["mission"].download_mission, "mission not read")
        return [
            MissionItem(
                i.command, (i.param1, i.param2, i.param3, i.param4), i.x, i.y, i.z, i.frame, i.autocontinue
            )
            for i in items
        ]

    async def select_item(self, number: int) -> None:
        """Go on with this mission item."""
        await self._again(lambda: self._plugins["mission"].set_current_mission_item(number), "item refused")

    async def _again(self, call: Callable[[], Awaitable[T]], problem: str) -> T:
        error: Exception | None = None
        for _ in range(_MISSION_ATTEMPTS):
            try:
                return await call()
            except Exception as failed:  # noqa: BLE001 - see `read`
                error = failed
                await asyncio.sleep(1.0)
        raise StationError(f"{problem}: {error}")

    # --- commands

    async def command(self, command: int, *params: float) -> int:
        """Send COMMAND_LONG to the autopilot; the MAV_RESULT, or -1 without an answer."""
        return await self._command("COMMAND_LONG", self._long(command, params))

    async def companion_command(self, component_id: int, command: int, *params: float) -> int:
        """The same, to another component of the vehicle."""
        fields = self._long(command, params) | {"target_component": component_id}
        return await self._command("COMMAND_LONG", fields)

    async def command_at(
        self,
        command: int,
        params: Sequence[float],
        lat_deg: float,
        lon_deg: float,
        height_m: float,
        frame: int,
    ) -> int:
        """Send COMMAND_INT with a place; the MAV_RESULT, or -1 without an answer."""
        fields = {
            "target_system": self.target,
            "target_component": 1,
            "frame": frame,
            "command": command,
            "current": 0,
            "autocontinue": 0,
            **_numbered(params, 4),
            "x": round(lat_deg * 1e7),
            "y": round(lon_deg * 1e7),
            "z": height_m,
        }
        return await self._command("COMMAND_INT", fields)

    def _long(self, command: int, params: Sequence[float]) -> dict[str, object]:
        return {
            "target_system": self.target,
            "target_component": 1,
            "command": command,
            "confirmation": 0,
            **_numbered(params, 7),
        }

    async def _command(self, name: str, fields: dict[str, object]) -> int:
        try:
            ack = await self._plugins["direct"].send_command(self._message(name, fields))
        except Exception:  # noqa: BLE001 - see `read`
            return -1
        return int(json.loads(ack.fields_json)["result"])

    async def send(self, name: str, fields: dict[str, object]) -> None:
        """Send any message."""
        await self._plugins["direct"].send_message(self._message(name, fields))

    def _message(self, name: str, fields: dict[str, object]) -> Any:
        from mavsdk.plugins.mavlink_direct import MavlinkMessage

        return MavlinkMessage(
            message_name=name,
            system_id=SYSTEM_ID,
            component_id=COMPONENT_ID,
            target_system_id=self.target,
            target_component_id=int(str(fields.get("target_component", 0))),
            fields_json=json.dumps(fields),
        )


def _plugins(system: Any) -> dict[str, Any]:
    from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
    from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
    from mavsdk.asyncio.plugins.param import ParamAsync

    return {
        "param": ParamAsync(system),
        "mission": MissionRawAsync(system),
        "direct": MavlinkDirectAsync(system),
    }


def _numbered(params: Sequence[float], count: int) -> dict[str, object]:
    padded = [*params, *(0.0 for _ in range(count - len(params)))]
    return {f"param{i}": (None if math.isnan(value) else value) for i, value in enumerate(padded, 1)}


def _as_mavsdk(item: MissionItem, number: int) -> Any:
    from mavsdk.plugins.mission_raw import MissionItem as Theirs

    first, second, third, fourth = item.params
    return Theirs(
        seq=number,
        frame=item.frame,
        command=item.command,
        current=int(number == 0),
        autocontinue=item.autocontinue,
        param1=first,
        param2=second,
        param3=third,
        param4=fourth,
        x=item.lat_e7,
        y=item.lon_e7,
        z=item.altitude_m,
        mission_type=0,
    )
