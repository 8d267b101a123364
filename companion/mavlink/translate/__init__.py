"""From messages to facts: the one place for the units, sentinels, flags and traps of MAVLink fields.

A field that its sender marked as invalid, left unset, or filled with an implausible value becomes `None`. A
message without any usable field gives no fact. No message that can be decoded raises an error. One file for
each protocol; a new source of traffic is a new file and an entry in `_TRANSLATIONS`.
"""

from companion.mavlink.translate import (
    adsb,
    commands,
    formation,
    missions,
    parameters,
    remote_id,
    telemetry,
    utm,
)
from companion.mavlink.translate.wire import Translation, Translator

_TRANSLATIONS: dict[int, Translation] = {
    **telemetry.TRANSLATIONS,
    **missions.TRANSLATIONS,
    **commands.TRANSLATIONS,
    **parameters.TRANSLATIONS,
    **adsb.TRANSLATIONS,
    **formation.TRANSLATIONS,
    **utm.TRANSLATIONS,
    **remote_id.TRANSLATIONS,
}

_TRANSLATOR = Translator(_TRANSLATIONS, missions.LAYOUTS)
to_fact, frame_to_fact = _TRANSLATOR.to_fact, _TRANSLATOR.frame_to_fact

WANTED: frozenset[int] = frozenset(_TRANSLATIONS)
"""Ids of the messages that can give a fact."""
