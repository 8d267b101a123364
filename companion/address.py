"""Link addresses as users write them: `udpin:HOST:PORT` listens, `udpout:HOST:PORT` sends there."""

import re
from dataclasses import dataclass

from companion.errors import LinkError

_ADDRESS = re.compile(
    r"(?P<kind>udpin|udpout):(?:\[(?P<v6>[0-9A-Fa-f:.%\w]+)\]|(?P<host>[^\s:\[\]]+)):(?P<port>\d{1,5})",
    re.ASCII,
)


@dataclass(frozen=True, slots=True)
class LinkAddress:
    """An address that is well formed; whether the host exists turns out when the link is opened."""

    listens: bool
    host: str
    port: int


def parse_address(text: str) -> LinkAddress:
    """The address that a text stands for, IPv6 hosts in brackets. `LinkError` for anything else."""
    match = _ADDRESS.fullmatch(text)
    if match is None:
        raise LinkError(f"{text!r} is no link address: use udpin:HOST:PORT or udpout:HOST:PORT")
    listens, port = match["kind"] == "udpin", int(match["port"])
    if port > 65_535:
        raise LinkError(f"{text}: {port} is no port")
    if port == 0 and not listens:
        raise LinkError(f"{text}: {port} is no port to send to")
    return LinkAddress(listens, match["v6"] or match["host"], port)
