"""For all groups, how hypothesis works. What it measures by the clock is no failure, so that load cannot decide. A
property is tried with the same inputs at each run, so that a failure comes from the change that is tested;
`make properties` tries new ones (--hypothesis-profile=new)."""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "new",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture],
)
settings.register_profile("same", settings.get_profile("new"), derandomize=True)
settings.load_profile("same")
