"""What all tests share."""

from hypothesis import HealthCheck, settings

# A busy machine must not fail a test: no deadlines in wall time.
settings.register_profile("any-machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any-machine")
