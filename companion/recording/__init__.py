"""The files of a recording: their names, the MCAP file, its reader and its repair, and how much is kept."""

from companion.recording.mcap_file import McapFile, Note
from companion.recording.mcap_log import Entry, McapLog, is_mcap, read_mcap
from companion.recording.names import PartName, free_name, later_parts, parts_in
from companion.recording.part import Part
from companion.recording.repair import complete, complete_all
from companion.recording.retention import remove_oldest
from companion.recording.schemas import DECISION, STATE, TEXT, Topic

__all__ = [
    "DECISION",
    "STATE",
    "TEXT",
    "Entry",
    "McapFile",
    "McapLog",
    "Note",
    "Part",
    "PartName",
    "Topic",
    "complete",
    "complete_all",
    "free_name",
    "is_mcap",
    "later_parts",
    "parts_in",
    "read_mcap",
    "remove_oldest",
]
