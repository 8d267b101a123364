"""Where the tests find the project's own files, and the shared recordings that may lie beside it."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs"
# Recordings of real flights, and encounter models; a clone of its own has nothing here.
SHARED = ROOT.parent / "shared" / "data"
TLOGS = SHARED / "tlogs"
FLIGHTS = SHARED / "flights"
ENCOUNTER_MODELS = SHARED / "encounter-models"
