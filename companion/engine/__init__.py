"""The engine of flight, replay, simulation and tests: facts in, effects out."""

from companion.engine.engine import Engine
from companion.engine.stepper import LONGEST_GAP_IN_LOG_US, LONGEST_STALL_US, TICK_US, WATCHDOG_S, Stepper
from companion.engine_config import EngineConfig, EngineParams
from companion.output.effects import Effect, Keep, Record, Save, Say, Transmit
from companion.ownship.performance_limits import AircraftLimits

__all__ = [
    "LONGEST_GAP_IN_LOG_US",
    "LONGEST_STALL_US",
    "TICK_US",
    "WATCHDOG_S",
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
