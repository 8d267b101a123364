"""The live display in a browser, the state for programs, and metrics; in a process of its own."""

from companion.web.display import Display
from companion.web.observers import Observers

__all__ = ["Display", "Observers"]
