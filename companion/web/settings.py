"""What the display's own process must know; and where it listens, in words."""

from dataclasses import dataclass
from ipaddress import ip_address

SHORTEST_TOKEN = 12


@dataclass(frozen=True, slots=True)
class Settings:
    """`token`: who has it may change the role; `None`: nobody may. `origins`: pages of others, as URLs."""

    host: str = "127.0.0.1"
    port: int = 8080
    token: str | None = None
    origins: tuple[str, ...] = ()
    title: str = "Companion"
    feet: bool = False  # heights, until somebody chooses otherwise on the page

    @property
    def url(self) -> str:
        """What to type into a browser on this machine."""
        host = "127.0.0.1" if self.host in ("0.0.0.0", "::") else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}"

    @property
    def is_local(self) -> bool:
        """Whether nobody but this machine can connect."""
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"
