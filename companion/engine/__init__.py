"""The heart: one object that flies, replays, simulates and is tested. Facts in, effects out."""

from companion.engine.effects import Effect, Record, Say, Transmit
from companion.engine.engine import Engine, EngineConfig, EngineParams
from companion.engine.stepper import TICK_US, Stepper

__all__ = [
    "TICK_US",
    "Effect",
    "Engine",
    "EngineConfig",
    "EngineParams",
    "Record",
    "Say",
    "Stepper",
    "Transmit",
]
