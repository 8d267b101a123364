"""The heart: one object that flies, replays, simulates and is tested. Facts in, effects out."""

from companion.engine.effective import AircraftLimits
from companion.engine.effects import Effect, Keep, Record, Save, Say, Transmit
from companion.engine.engine import Engine
from companion.engine.params import EngineConfig, EngineParams
from companion.engine.stepper import LONGEST_CATCH_UP_US, TICK_US, Stepper

__all__ = [
    "LONGEST_CATCH_UP_US",
    "TICK_US",
    "AircraftLimits",
    "Effect",
    "Engine",
    "EngineConfig",
    "EngineParams",
    "Keep",
    "Record",
    "Save",
    "Say",
    "Stepper",
    "Transmit",
]
