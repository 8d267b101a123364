"""Which telemetry is due: the message intervals of one channel."""

from companion.mavlink.dialect import mavlink
from sim.vehicle.telemetry import BUILT

# REQUEST_DATA_STREAM's groups, as ArduPilot fills them
_EXTENDED_STATUS = (
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
)
_POSITION = (mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
_EXTRA_1 = (mavlink.MAVLINK_MSG_ID_ATTITUDE,)
_EXTRA_2 = (mavlink.MAVLINK_MSG_ID_VFR_HUD,)
_EXTRA_3 = (
    mavlink.MAVLINK_MSG_ID_WIND,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
)
_SENSORS = (mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,)
DEFAULT_STREAM = (*_EXTENDED_STATUS, *_POSITION, *_EXTRA_1, *_EXTRA_2, *_EXTRA_3, *_SENSORS)
_GROUPS = {
    mavlink.MAV_DATA_STREAM_ALL: DEFAULT_STREAM,
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: _SENSORS,
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: _EXTENDED_STATUS,
    mavlink.MAV_DATA_STREAM_POSITION: _POSITION,
    mavlink.MAV_DATA_STREAM_EXTRA1: _EXTRA_1,
    mavlink.MAV_DATA_STREAM_EXTRA2: _EXTRA_2,
    mavlink.MAV_DATA_STREAM_EXTRA3: _EXTRA_3,
}
_STREAMED = BUILT | {mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, mavlink.MAVLINK_MSG_ID_HEARTBEAT}

_TOLERANCE_S = 1e-6


class Streams:
    """The intervals that one channel has asked for. They belong to the channel and are lost with it."""

    def __init__(self, now_s: float, default_rate_hz: float) -> None:
        """Start with ArduPilot's default messages, all at one rate (like SR0_* parameters); 0 is silence."""
        self._default_interval_s = 1.0 / default_rate_hz if default_rate_hz > 0.0 else 0.0
        self._interval_s: dict[int, float] = {}
        self._due_s: dict[int, float] = {}
        for message_id in DEFAULT_STREAM:
            self.set_interval(message_id, self._default_interval_s, now_s)

    def interval_s(self, message_id: int) -> float:
        """The interval of a message, 0 when it is not sent."""
        return self._interval_s.get(message_id, 0.0)

    def set_interval(self, message_id: int, interval_s: float, now_s: float) -> bool:
        """Send a message so often; 0 stops it. False for a message that is not streamed at all."""
        if message_id not in _STREAMED:
            return False
        if interval_s <= 0.0:
            self._interval_s.pop(message_id, None)
            self._due_s.pop(message_id, None)
        else:
            self._interval_s[message_id] = interval_s
            self._due_s[message_id] = now_s + interval_s
        return True

    def reset_interval(self, message_id: int, now_s: float) -> bool:
        """Back to the default rate."""
        default_s = self._default_interval_s if message_id in DEFAULT_STREAM else 0.0
        return self.set_interval(message_id, default_s, now_s)

    def set_group(self, stream_id: int, rate_hz: float, now_s: float) -> None:
        """REQUEST_DATA_STREAM: one rate for a group of messages; unknown groups are ignored."""
        for message_id in _GROUPS.get(stream_id, ()):
            self.set_interval(message_id, 1.0 / rate_hz if rate_hz > 0.0 else 0.0, now_s)

    def due(self, now_s: float) -> list[int]:
        """The messages to send now. What could not be sent in time is dropped, not caught up."""
        ready: list[int] = []
        for message_id, due_s in self._due_s.items():
            if due_s <= now_s + _TOLERANCE_S:
                ready.append(message_id)
                interval_s = self._interval_s[message_id]
                self._due_s[message_id] = max(due_s + interval_s, now_s)
        return ready
