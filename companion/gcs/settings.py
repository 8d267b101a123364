"""The present configuration: as configured, with what the operator has changed since."""

from collections.abc import Mapping

from companion.avoidance import AvoidanceParams
from companion.control.state_machine import SupervisorParams
from companion.engine_config import EngineConfig, EngineParams
from companion.gcs.parameters import GcsParam, values_changed, with_values


class Settings:
    """Holds the settings that can be changed in flight; read them here each time.

    `saved` are the values of a former run by name; values that are not valid any more are left out.
    """

    def __init__(self, configured: EngineConfig, saved: Mapping[str, float] | None = None) -> None:
        self._configured = configured
        self._config, _ = with_values(configured, saved or {})

    @property
    def config(self) -> EngineConfig:
        """The whole configuration."""
        return self._config

    @property
    def engine(self) -> EngineParams:
        """Identity, ages, ceiling, units of texts."""
        return self._config.engine

    @property
    def supervisor(self) -> SupervisorParams:
        """When the aircraft may be taken over."""
        return self._config.supervisor

    @property
    def avoidance(self) -> AvoidanceParams:
        """How traffic is avoided."""
        return self._config.avoidance

    @property
    def changed(self) -> dict[str, float]:
        """The settings that differ from the configuration, by name."""
        return values_changed(self._config, self._configured)

    def put(self, parameter: GcsParam, value: float | None) -> None:
        """Change one setting; ValueError with the allowed range, and no change, when the value is refused."""
        self._config = parameter.put(self._config, value, self._configured)
