"""Prints how well the fake vehicles fit recordings of real autopilots.

`python -m tests.tools.fit [LOG.tlog ...]` flies each segment of the recordings with the fake and compares
course, height, airspeed, mode and mission item. Without logs it takes those of the shared data, if they are
there. `--segments` lists each segment.
"""

import argparse
import sys
from pathlib import Path

from sim.fit.measures import fit_of, measure, table
from sim.fit.recording import read_recording
from sim.fit.segments import segments_of
from tests.support.recordings import RECORDINGS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("logs", nargs="*", type=Path, metavar="LOG.tlog")
    parser.add_argument("--segments", action="store_true", help="list each segment")
    arguments = parser.parse_args()
    for path in arguments.logs or RECORDINGS:
        recording = read_recording(path)
        errors = measure(recording, segments_of(recording))
        fits = [fit_of(name, [part]) for name, part in errors.items()] if arguments.segments else []
        fits.append(fit_of(recording.name, errors.values()))
        sys.stdout.write("\n".join(table(fits)) + "\n")


if __name__ == "__main__":
    main()
