"""The command line `companion-sim`: one file per command, `encounter` beside `campaign`."""

from sim.cli.app import main

__all__ = ["main"]
