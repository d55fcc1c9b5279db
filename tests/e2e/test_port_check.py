"""`plctool port-check` against the runtime on this machine."""

from __future__ import annotations

import signal

from plctool import connect
from plctool.link.transports import parse_link
from plctool.port_check import run_port_check
from plctool.testing.plcrt import Plcrt

EXCEPTIONS = {"division by zero", "array bounds", "null reference", "endless loop", "stack overflow"}


def failures(report):
    return [(o["name"], o["text"]) for o in report["checks"] if o["verdict"] == "failed"]


def test_this_machine_keeps_what_the_runtime_expects(tool, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    plc = Plcrt(tmp_path / "plc.flash")

    def power_cycle():
        plc.stop(signal.SIGKILL)
        plc.start()

    with plc:
        link = parse_link(f"serial:{plc.port}")
        report = run_port_check(lambda: connect(link), link=link, power_cycle=power_cycle)
        document = report.document()
        assert failures(document) == []
        assert document["device"]["target"] == "x86_64-linux"
        names = [o["name"] for o in document["checks"]]
        assert {name.removeprefix("exception: ") for name in names} >= EXCEPTIONS
        assert "power cycle" in names
        assert document["passed"] == len(names)


def test_an_application_is_not_replaced_without_a_yes(tool, plcrt):
    image = tool.build("keep", "PROGRAM Main\nVAR n : DINT; END_VAR\nn := n + 1;\nEND_PROGRAM\n")
    tool.ok("flash", "--port", plcrt.port, str(image))
    done = tool("port-check", "--port", plcrt.port, "--json")
    assert (done.status, done.json["error"]["code"]) == (2, "occupied")
    assert tool.ok("status", "--port", plcrt.port)["state"] == "run"
