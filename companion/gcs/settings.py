"""The configuration as it is now: what was configured, and what the operator has tuned since."""

from collections.abc import Mapping

from companion.avoidance import AvoidanceParams
from companion.control.state_machine import SupervisorParams
from companion.engine_config import EngineConfig, EngineParams
from companion.gcs.parameters import GcsParam, values_changed, with_values


class Settings:
    """Whoever goes by a setting that can be tuned asks here for it, each time.

    `saved` are values by name that a former run left; those that cannot be used any more are left out.
    """

    def __init__(self, configured: EngineConfig, saved: Mapping[str, float] | None = None) -> None:
        self._configured = configured
        self._config, _ = with_values(configured, saved or {})

    @property
    def config(self) -> EngineConfig:
        """All of it."""
        return self._config

    @property
    def engine(self) -> EngineParams:
        """Identity, ages, ceiling, words."""
        return self._config.engine

    @property
    def supervisor(self) -> SupervisorParams:
        """When the aircraft may be taken over."""
        return self._config.supervisor

    @property
    def avoidance(self) -> AvoidanceParams:
        """How it is flown around traffic."""
        return self._config.avoidance

    @property
    def changed(self) -> dict[str, float]:
        """What is set otherwise than configured, by name."""
        return values_changed(self._config, self._configured)

    def put(self, tunable: GcsParam, value: float | None) -> None:
        """Set one; `ValueError` says what is allowed, and nothing has changed."""
        self._config = tunable.put(self._config, value, self._configured)
