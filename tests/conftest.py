"""For all groups: names are asked for on loopback only; controllers, which are processes of a machine that may be busy,
get three times as long to reply; reports say what each test took of processors; and how hypothesis works. What it
measures by the clock is no failure, so that load cannot decide. A property is tried with the same inputs at each run,
so that a failure comes from the change that is tested, and with a fifth of those in `make test-whole`; `make
properties` tries new ones (--hypothesis-profile=new)."""

import os

import pytest
from hypothesis import HealthCheck, settings
from shares import fewer

os.environ.setdefault("PLCTOOL_PATIENCE", "3")
os.environ["PLCTOOL_MDNS"] = "127.0.0.1"  # no test asks a network
settings.register_profile(
    "new",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture],
)
settings.register_profile("same", settings.get_profile("new"), derandomize=True, max_examples=fewer(100))
settings.load_profile("same")

BEGIN = pytest.StashKey[float]()


def processor_time() -> float:
    """Returns the processor time of this process and of those it has waited for [s]."""
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> object:
    item.stash[BEGIN] = processor_time()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> object:
    """Puts it into the report, which tests/run_all.py reads; a fixture belongs to the first test that asks for it."""
    if call.when == "teardown":
        item.user_properties.append(("processors", f"{processor_time() - item.stash[BEGIN]:.2f}"))
    return (yield)
