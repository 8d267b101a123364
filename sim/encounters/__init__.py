"""Encounters: generated from the closest approach, sampled from models, or read from files."""

from sim.encounters.encounter import Encounter, Passing, Path, passing
from sim.encounters.files import read_encounters, write_encounters
from sim.encounters.generators import KINDS, generate
from sim.encounters.model import EncounterModel, read_model
from sim.encounters.presets import SURVEILLANCE_PRESETS, surveillance_of
from sim.encounters.sampling import sample
from sim.encounters.surveillance import Heard, Observer, Reception, Surveillance

__all__ = [
    "KINDS",
    "SURVEILLANCE_PRESETS",
    "Encounter",
    "EncounterModel",
    "Heard",
    "Observer",
    "Passing",
    "Path",
    "Reception",
    "Surveillance",
    "generate",
    "passing",
    "read_encounters",
    "read_model",
    "sample",
    "surveillance_of",
    "write_encounters",
]
