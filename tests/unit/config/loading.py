"""Configuration files of a test, loaded or refused."""

from pathlib import Path

import pytest

from companion.config import Config, load_config
from companion.errors import ConfigError

LINKS = "links: ['udpin:0.0.0.0:14550']\n"


def load(tmp_path: Path, text: str | bytes) -> Config:
    path = tmp_path / "c.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_config(path)


def refusal(tmp_path: Path, text: str | bytes) -> str:
    """The error of a refused file, without the folder."""
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{tmp_path}/c.yaml:")
    return message.removeprefix(f"{tmp_path}/")
