"""Where tests find the project's files, and the recordings and models that may lie beside the checkout."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs"
# Made by `tests/support/make_data.py`, and always here.
OWN_DATA = ROOT / "tests" / "data"
# Recordings of real flights, and encounter models; a clone of its own has nothing here.
SHARED = ROOT.parent / "shared" / "data"


def data(kind: str, ending: str) -> dict[str, Path]:
    """The files of a kind by name: our own, and those beside the checkout."""
    folders = (OWN_DATA / kind, SHARED / kind)
    return {path.stem: path for folder in folders for path in sorted(folder.glob(f"*{ending}"))}


TLOGS = data("tlogs", ".tlog")
ENCOUNTER_MODELS = data("encounter-models", ".txt")
DAA_SCENARIOS = data("daa-scenarios", ".daa")
