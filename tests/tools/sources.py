"""Prints the error of one aircraft's track by each of four receivers alone, and by all together.

`python -m tests.tools.sources [--seeds N] [--path NAME]`: RMS and 95 % against the truth, of place, height
and velocity. Their delays, errors and kinds of altitude differ; see `tests/support/one_aircraft.py`.
"""

import argparse
import sys

from tests.support.one_aircraft import PATHS, RECEIVERS, Errors, errors_of

_HEADINGS = ("", "horizontal [m]", "vertical [m]", "velocity [m/s]", "tracks")


def row(name: str, errors: Errors) -> str:
    """A line of the table."""
    figures = "".join(f"{rms:9.1f} {worst:7.1f}" for rms, worst in errors.figures().values())
    return f"{name:10}{figures}{min(errors.tracks):7}..{max(errors.tracks)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="number of flights")
    parser.add_argument("--path", choices=PATHS, default="mixed", help="what the aircraft flies")
    options = parser.parse_args()
    seeds, path = range(options.seeds), options.path
    lines = ["".join(f"{heading:>17}" if heading else " " * 10 for heading in _HEADINGS)]
    lines += [" " * 10 + "      RMS    95 %" * 3]
    lines += [row(name, errors_of([name], seeds, path)) for name in RECEIVERS]
    lines += [row("all", errors_of(list(RECEIVERS), seeds, path))]
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
