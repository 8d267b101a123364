"""ADSB_VEHICLE as an autopilot passes it on."""

from companion.mavlink.dialect import Message, mavlink


def copy_of(report: Message) -> Message:
    """The same fields in a message of our own: the sender's address is not passed on."""
    return mavlink.MAVLink_adsb_vehicle_message(
        ICAO_address=report.ICAO_address,
        lat=report.lat,
        lon=report.lon,
        altitude_type=report.altitude_type,
        altitude=report.altitude,
        heading=report.heading,
        hor_velocity=report.hor_velocity,
        ver_velocity=report.ver_velocity,
        callsign=report.callsign.encode("ascii", errors="replace"),
        emitter_type=report.emitter_type,
        tslc=report.tslc,
        flags=report.flags,
        squawk=report.squawk,
    )
