"""The live display in a browser, the state as JSON, and metrics, served by a process of their own."""

from companion.web.display import Display
from companion.web.observers import Observers

__all__ = ["Display", "Observers"]
