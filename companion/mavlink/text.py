"""Text on the wire."""


def printable(text: str | bytes) -> str | None:
    """Text up to the first NUL, without padding and what is not ASCII; `None` if nothing is left."""
    if isinstance(text, bytes):
        text = text.split(b"\0", 1)[0].decode("ascii", errors="ignore")
    return "".join(letter for letter in text if " " <= letter <= "~").strip() or None
