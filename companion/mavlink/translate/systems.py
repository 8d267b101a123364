"""MAVLink systems about themselves: HEARTBEAT, GLOBAL_POSITION_INT, EXTENDED_SYS_STATE."""

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, Heartbeat, LandedState, OwnPosition, Sender
from companion.mavlink.translate.wire import Translation, angle_rad, place_deg


def _heartbeat(message: Message, sender: Sender, _received_s: float) -> Fact:
    return Heartbeat(
        sender=sender,
        vehicle_type=message.type,
        autopilot=message.autopilot,
        armed=bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        custom_mode=message.custom_mode,
        system_status=message.system_status,
    )


def _own_position(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`vz` is positive down; without a fix autopilots send 0, 0."""
    place = place_deg(message.lat, message.lon)
    if place is None:
        return None
    return OwnPosition(
        sender=sender,
        boot_time_s=message.time_boot_ms / 1000.0,
        lat_deg=place[0],
        lon_deg=place[1],
        altitude_m=message.alt / 1000.0,
        height_above_home_m=message.relative_alt / 1000.0,
        velocity_mps=(message.vx / 100.0, message.vy / 100.0, message.vz / 100.0),
        heading_rad=angle_rad(message.hdg),
    )


def _landed_state(message: Message, sender: Sender, _received_s: float) -> Fact:
    known = mavlink.MAV_LANDED_STATE_UNDEFINED < message.landed_state < mavlink.MAV_LANDED_STATE_ENUM_END
    return LandedState(sender, message.landed_state if known else None)


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: _heartbeat,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _own_position,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _landed_state,
}
