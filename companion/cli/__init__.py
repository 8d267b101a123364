"""The command line `companion`: one file for each of the commands `run`, `check`, `replay` and `report`."""

from companion.cli.app import main

__all__ = ["main"]
