"""For all groups: what hypothesis measures by the clock is no failure, so that load cannot decide."""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "plctool",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture],
)
settings.load_profile("plctool")
