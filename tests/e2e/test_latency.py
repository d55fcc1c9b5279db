"""`plctool latency` on a real plcrt: each cycle is counted once."""

from __future__ import annotations


def test_each_cycle_is_counted_by_how_late_it_began(tool, plcrt, counter, eventually):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    eventually(lambda: tool.ok("tasks", "--port", plcrt.port)["tasks"][0]["cycles"] > 20)
    tool.ok("stop", "--port", plcrt.port)
    (task,) = tool.ok("latency", "--port", plcrt.port)["tasks"]
    assert task["starts"] == tool.ok("tasks", "--port", plcrt.port)["tasks"][0]["cycles"]
    assert task["latest_us"] <= task["histogram"][-1]["below_us"]
