"""Where the autopilot flies to: POSITION_TARGET_GLOBAL_INT."""

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, NavigationTarget, Sender
from companion.mavlink.translate.wire import Translation, is_altitude, place_deg


def _navigation_target(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """Only the frames GLOBAL and GLOBAL_INT give the altitude above mean sea level."""
    if message.type_mask & (
        mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    ):
        return None
    place = place_deg(message.lat_int, message.lon_int)
    if place is None:
        return None
    absolute = message.coordinate_frame in (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
    ignored = message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
    given = absolute and not ignored and is_altitude(message.alt)
    return NavigationTarget(sender, place[0], place[1], message.alt if given else None)


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: _navigation_target,
}
