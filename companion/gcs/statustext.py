"""STATUSTEXT: each notice once, in as many messages as its text takes."""

from companion.mavlink.dialect import Message, mavlink
from companion.output.effects import Say
from companion.output.notice import TEXT_BYTES, Notice

_PREFIX = "Avoidance: "
# The same text is sent again only after this time: repeated warnings are ignored.
_REPEAT_S = 30.0


class StatusText:
    """Turns notices into messages, and remembers which were sent."""

    def __init__(self) -> None:
        self._said_s: dict[str, float] = {}
        self._chunk_id = 0
        self.last_text = ""

    def say(self, notice: Notice, now_s: float) -> list[Say | Message]:
        """The notice for the log and the ground station; or nothing if its topic was sent recently."""
        if notice.log_only:
            return [Say(notice.severity, notice.text)]
        if not self._is_news(notice.topic or notice.text, now_s):
            return []
        self.last_text = notice.text
        return [Say(notice.severity, notice.text), *self._chunks(notice.severity, _brief(notice))]

    def _is_news(self, topic: str, now_s: float) -> bool:
        said_s = self._said_s.get(topic)
        if said_s is not None and 0.0 <= now_s - said_s < _REPEAT_S:
            return False
        self._said_s = {t: s for t, s in self._said_s.items() if now_s - s < _REPEAT_S}
        self._said_s[topic] = now_s
        return True

    def _chunks(self, severity: int, text: str) -> list[Message]:
        raw = text.encode("ascii", "replace")
        if len(raw) <= TEXT_BYTES:
            return [mavlink.MAVLink_statustext_message(severity, raw, 0, 0)]
        self._chunk_id = self._chunk_id % 65535 + 1
        chunks = []
        while raw:
            chunk, raw = _cut(raw)
            chunks.append(chunk)
        if len(chunks[-1]) == TEXT_BYTES:
            chunks.append(b"")  # a full last chunk does not end the text; an empty one does
        return [
            mavlink.MAVLink_statustext_message(severity, chunk, self._chunk_id, i)
            for i, chunk in enumerate(chunks)
        ]


def _brief(notice: Notice) -> str:
    """The text for STATUSTEXT: the brief one, or without the prefix if it fits then."""
    text = notice.brief or notice.text
    if len(text) > TEXT_BYTES >= len(text) - len(_PREFIX):
        return text.removeprefix(_PREFIX)
    return text


def _cut(raw: bytes) -> tuple[bytes, bytes]:
    """One chunk and the rest. Instead of cutting a number it is padded: a shorter one would end the text."""
    chunk, rest = raw[:TEXT_BYTES], raw[TEXT_BYTES:]
    if not (rest and chunk[-1:].isdigit() and (rest[:1].isdigit() or rest[:1] == b".")):
        return chunk, rest
    begin = chunk.rfind(b" ") + 1
    if begin == 0:
        return chunk, rest
    return chunk[:begin].ljust(TEXT_BYTES), chunk[begin:] + rest
