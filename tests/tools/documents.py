"""Rewrites the parts of README.md and REFERENCE.md that are made from the code: `make pictures`."""

import re

from companion.config.keys import file_key
from companion.gcs.parameters import GCS_PARAMETERS
from tests.support.paths import ROOT

README, REFERENCE = ROOT / "README.md", ROOT / "REFERENCE.md"
_PARAMETER_ROWS = re.compile(r"(?:^\| `CA_\w+` \|.*\n)+", re.MULTILINE)


def parameter_rows() -> str:
    """The rows of the table of MAVLink parameters, as the code has them."""
    return "".join(
        f"| `{parameter.name}` | `{file_key(parameter.field)}` | {parameter.unit} "
        f"| {parameter.lowest:g} to {parameter.highest:g} | {parameter.words} |\n"
        for parameter in GCS_PARAMETERS
    )


def parameter_rows_in(text: str) -> str:
    """The rows of the same table in a document."""
    (rows,) = _PARAMETER_ROWS.findall(text)
    return str(rows)


def main() -> None:
    text = REFERENCE.read_text(encoding="utf-8")
    REFERENCE.write_text(text.replace(parameter_rows_in(text), parameter_rows()), encoding="utf-8")


if __name__ == "__main__":
    main()
