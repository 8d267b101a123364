"""Settings of the display."""

from dataclasses import dataclass
from ipaddress import ip_address

SHORTEST_TOKEN = 12


@dataclass(frozen=True, slots=True)
class Settings:
    """Where the display listens, and who may use it.

    `token` allows changes of the role; without one the display is read-only. `origins` are URLs of other
    servers whose pages may open the stream. `members` are the names of several aircraft that share a display.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    token: str | None = None
    origins: tuple[str, ...] = ()
    title: str = "Companion"
    feet: bool = False  # unit of heights, until the user chooses one on the page
    members: tuple[str, ...] = ()

    @property
    def url(self) -> str:
        """The URL of the page on this computer."""
        host = "127.0.0.1" if self.host in ("0.0.0.0", "::") else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}"

    @property
    def is_local(self) -> bool:
        """True when only this computer can connect."""
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"
