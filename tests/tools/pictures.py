"""Redraws the pictures of README.md from the demo as it runs now: `make pictures`.

The demo flies in a terminal of its own, with its display. During the second encounter a headless Chromium
takes display.png, and the panel on the terminal goes into README.md. A demo that fails changes nothing.
"""

import fcntl
import json
import os
import pty
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from playwright.sync_api import ViewportSize, sync_playwright

from tests.support.paths import ROOT

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DISPLAY = "http://127.0.0.1:8080"
PICTURE, README = ROOT / "display.png", ROOT / "README.md"
_SIZE: ViewportSize = {"width": 1280, "height": 720}
_LINES, _COLUMNS = 40, 100
_ENCOUNTER = 2  # by then the lines of the start have scrolled off the panel
_CLOSEST_IN_S = 25.0
_LONGEST_S = 240.0
_PANEL = re.compile(r"╭.*?╯", re.DOTALL)
_CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\r")
# A fenced block of README.md that begins with the panel's upper edge.
_BLOCK = re.compile(r"(?<=^```\n)╭.*?╯(?=\n```$)", re.DOTALL | re.MULTILINE)


class Terminal:
    """A command on a terminal of 100 x 40 characters without colours."""

    def __init__(self, words: Sequence[str], folder: Path) -> None:
        ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", _LINES, _COLUMNS, 0, 0))
        environment = {**os.environ, "NO_COLOR": "1", "TERM": "xterm"}
        self.process = subprocess.Popen(
            words, stdin=theirs, stdout=theirs, stderr=theirs, env=environment, cwd=folder
        )
        os.close(theirs)
        self._output = bytearray()
        self._reader = threading.Thread(target=self._read, args=(ours,), daemon=True)
        self._reader.start()

    def _read(self, ours: int) -> None:
        with os.fdopen(ours, "rb", buffering=0) as stream:
            try:
                while data := stream.read(65536):
                    self._output += data
            except OSError:  # how a terminal says that the command has ended
                return

    @property
    def text(self) -> str:
        """All that was printed, without control sequences."""
        return _CONTROL.sub("", self._output.decode(errors="replace"))

    @property
    def panel(self) -> str:
        """The newest whole panel; empty when there is none yet."""
        panels = _PANEL.findall(self.text)
        return panels[-1] if panels else ""

    def wait(self) -> int:
        """Wait for the end; the exit code."""
        code = self.process.wait(_LONGEST_S)
        self._reader.join(5.0)
        return code


def demo_words(*options: str) -> list[str]:
    """The command of the demo, from the environment of this Python."""
    return [str(Path(sys.executable).with_name("companion-sim")), "demo", *options]


def with_panel(text: str, panel: str) -> str:
    """A README with this panel in the place of its own."""
    assert len(_BLOCK.findall(text)) == 1, "README.md must have one block with a panel"
    return _BLOCK.sub(lambda _: panel, text)


def panel_in(text: str) -> str:
    """The panel that a README shows."""
    (panel,) = _BLOCK.findall(text)
    return str(panel)


def shape_of(panel: str) -> list[str]:
    """What a panel promises: its labels and headings, without the values of the moment."""
    words = [line.strip("│ ") for line in panel.splitlines()]
    labels = [match[0] for line in words if (match := re.match(r"(position|flying|mode|companion)\b", line))]
    headings = next((re.split(r"\s{2,}", line) for line in words if line.startswith("traffic")), [])
    title = re.findall(r"─ (\w+ \w+) ", panel.partition("\n")[0])
    return [*title, *labels, *headings]


def _state() -> Mapping[str, Any] | None:
    """What the display shows; `None` while it does not answer."""
    try:
        with urllib.request.urlopen(f"{DISPLAY}/api/state", timeout=2.0) as answer:
            state: Mapping[str, Any] = json.load(answer)
            return state
    except (urllib.error.URLError, OSError, ValueError):
        return None


class _Encounters:
    """Counts conflicts by the states of the display."""

    def __init__(self) -> None:
        self._count, self._in_conflict = 0, False

    def is_moment(self, state: Mapping[str, Any] | None) -> bool:
        """Whether the aircraft is flown around the traffic of the encounter to be shown."""
        if state is None:
            return False
        decision = state["decision"]
        in_conflict = decision["layer"] != "clear" and bool(decision["threats"])
        self._count += in_conflict and not self._in_conflict
        self._in_conflict = in_conflict
        if not in_conflict or self._count < _ENCOUNTER or not state["companion"]["flying"]:
            return False
        left_s = decision["threats"][0]["time_to_closest_s"]
        return left_s is not None and left_s < _CLOSEST_IN_S


def _photograph(is_moment: Callable[[Mapping[str, Any] | None], bool], picture: Path) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu", "--disable-quic"]
        )
        page = browser.new_page(viewport=_SIZE, color_scheme="dark")
        _await(lambda state: state is not None)
        page.goto(DISPLAY)
        page.wait_for_selector("html[data-ready=true]")
        _await(is_moment)
        page.screenshot(path=picture)
        browser.close()


def _await(condition: Callable[[Mapping[str, Any] | None], bool]) -> None:
    """Ask for the state ten times a second until it fulfils a condition."""
    deadline_s = time.monotonic() + _LONGEST_S
    while not condition(_state()):
        if time.monotonic() > deadline_s:
            sys.exit("the demo did not come to the moment of the picture, nothing is written")
        time.sleep(0.1)


def main() -> None:
    if CHROMIUM is None:
        sys.exit("make pictures needs Chromium: make browser")
    if _state() is not None:
        sys.exit(f"another display answers at {DISPLAY}: end it first")
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / PICTURE.name
        terminal = Terminal(demo_words(), Path(folder))
        try:
            _photograph(_Encounters().is_moment, picture)
            panel = terminal.panel
            code = terminal.wait()
        finally:
            terminal.process.terminate()
        result = terminal.text[terminal.text.rindex("╯") + 1 :].strip()
        if code != 0 or "Mission completed" not in result:
            sys.exit(f"the demo did not pass, nothing is written:\n{result}")
        shutil.copyfile(picture, PICTURE)
    README.write_text(with_panel(README.read_text(encoding="utf-8"), panel), encoding="utf-8")
    sys.stdout.write(f"{panel}\n{result}\n{PICTURE.name} and {README.name} are redrawn\n")


if __name__ == "__main__":
    main()
