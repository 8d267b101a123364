"""The settings of the display in the browser, as configuration and command line give them."""

import logging
from dataclasses import replace
from pathlib import Path

from companion.address import host_and_port
from companion.config import Config, WebParams
from companion.errors import ConfigError
from companion.web.settings import SHORTEST_TOKEN, Settings


def display_settings(config: Config) -> Settings:
    """Where the display listens, and the token that allows commands; `ConfigError` for a bad token file."""
    host, port = host_and_port(config.web.listen)
    token_file, token = config.web.token_file, None
    if token_file is not None:
        try:
            token = token_file.read_text(encoding="utf-8").partition("\n")[0].strip()
        except OSError as error:
            raise ConfigError(f"web.token_file {token_file}: cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise ConfigError(f"web.token_file {token_file}: is not UTF-8 text") from error
        if len(token) < SHORTEST_TOKEN:
            raise ConfigError(f"web.token_file {token_file}: must have at least {SHORTEST_TOKEN} characters")
    in_feet = config.engine.text_units == "aviation"
    return Settings(host, port, token, config.web.origins, feet=in_feet)


def display_settings_in_flight(config: Config) -> Settings:
    """The same, but read-only if the token file is bad: a restart in flight must not fail because of it."""
    try:
        return display_settings(config)
    except ConfigError as error:
        logging.getLogger("companion").error("%s; the display is read-only", error)
        return display_settings(replace(config, web=replace(config.web, token_file=None)))


def replay_display_settings(log: Path, config: Config | None, listen: str | None) -> Settings:
    """Where a replay is shown: at `listen`, or where the configuration says."""
    address = listen or (WebParams() if config is None else config.web).listen
    try:
        host, port = host_and_port(address)
    except ValueError as error:
        raise ConfigError(f"--listen {address}: {error}") from error
    return Settings(host, port, title=log.name)
