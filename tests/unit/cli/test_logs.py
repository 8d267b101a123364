"""The log of a flight: a line that cannot be written or formatted stops nothing."""

import io
import logging

import pytest

from companion.cli.logs import UnblockedHandler


def test_a_record_that_cannot_be_formatted_stops_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    stream = io.StringIO()
    handler = UnblockedHandler(stream)
    logger = logging.Logger("flight")  # noqa: LOG001 - not one of the process
    logger.addHandler(handler)
    logger.info("%d frames", "many")
    logger.info("%d frames", 3)
    handler.flush()
    assert stream.getvalue() == "3 frames\n"
    assert "Logging error" in capsys.readouterr().err
