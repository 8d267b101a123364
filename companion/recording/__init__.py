"""Recordings of flights: the recorder, their MCAP files, and the folder that holds them; state files."""

from companion.recording.folder import PartName, free_name, later_parts, parts_in, remove_oldest
from companion.recording.mcap_reader import Entry, McapReader, is_mcap, read_mcap
from companion.recording.mcap_writer import McapMessage, McapWriter
from companion.recording.repair import repair_all, repair_file
from companion.recording.schemas import DECISION, STATE, TEXT, Topic

__all__ = [
    "DECISION",
    "STATE",
    "TEXT",
    "Entry",
    "McapMessage",
    "McapReader",
    "McapWriter",
    "PartName",
    "Topic",
    "free_name",
    "is_mcap",
    "later_parts",
    "parts_in",
    "read_mcap",
    "remove_oldest",
    "repair_all",
    "repair_file",
]
