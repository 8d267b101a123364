"""A panel on a terminal that is drawn again and again; without a terminal, a line for each event."""

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self

from rich.console import Console, RenderableType
from rich.live import Live
from rich.text import Text


class LiveView(ABC):
    """Draws `render` several times a second while it is entered, and once when it is made."""

    def __init__(self, console: Console, *, refresh_per_s: float, lines_shown: int) -> None:
        self._console = console
        self._lines_shown = lines_shown
        self._lines: list[str] = []
        self._live = Live(
            get_renderable=self.render,
            console=console,
            refresh_per_second=refresh_per_s,
            transient=True,
            auto_refresh=console.is_terminal,
        )

    @abstractmethod
    def render(self) -> RenderableType:
        """What is shown now."""

    def add_line(self, time_s: float, text: str) -> None:
        """Show an event with its time."""
        line = f"{clock(time_s)}  {text}"
        self._lines.append(line)
        if not self._console.is_terminal:
            self._console.print(line, markup=False, soft_wrap=True)

    @property
    def newest_lines(self) -> Text:
        """The newest events, for `render`."""
        return Text("\n".join(self._lines[-self._lines_shown :]))

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._console.is_terminal:
            self._live.stop()


def clock(seconds: float) -> str:
    """Minutes and seconds."""
    return f"{int(seconds) // 60:3d}:{int(seconds) % 60:02d}"
