"""For all groups: names are asked for on loopback only; controllers, which are processes of a machine that may be busy,
get three times as long to reply; and how hypothesis works. What it measures by the clock is no failure, so that load
cannot decide. A property is tried with the same inputs at each run, so that a failure comes from the change that is
tested, and fewer than in `make test-whole`; `make properties` tries new ones (--hypothesis-profile=new)."""

import os

from hypothesis import HealthCheck, settings
from shares import WHOLE

os.environ.setdefault("PLCTOOL_PATIENCE", "3")
os.environ["PLCTOOL_MDNS"] = "127.0.0.1"  # no test asks a network
settings.register_profile(
    "new",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture],
)
settings.register_profile("same", settings.get_profile("new"), derandomize=True, max_examples=100 if WHOLE else 20)
settings.load_profile("same")
