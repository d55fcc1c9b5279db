"""`plctool port-check`: does a port keep what the runtime expects of it? A conformance run over the normal protocol.

What the controller had before is replaced, and nothing is left on it at the end.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from plctool.device import Plc
from plctool.errors import UsageError
from plctool.link.services import AppState
from plctool.link.transports import Link
from plctool.port_check.bench import Bench, target_of
from plctool.port_check.checks import MAX_DRIFT, Checks
from plctool.port_check.report import Outcome, Report, judge, outcome_text, summary_text
from plctool.port_check.wires import Wire, Wires, check_wires, parse_wire

__all__ = ["MAX_DRIFT", "Outcome", "Report", "Wire", "outcome_text", "parse_wire", "run_port_check", "summary_text"]


def run_port_check(
    connect: Callable[[], Plc],
    *,
    link: Link,
    replace: bool = False,
    max_drift: float = MAX_DRIFT,
    power_cycle: Callable[[], None] | None = None,
    wires: Sequence[Wire] = (),
    device: Path | None = None,
    show: Callable[[Outcome], None] = lambda outcome: None,
) -> Report:
    """Runs all checks and returns their report; `show` gets each outcome when it is known.

    `replace`: also when there is an application on the controller, which is lost. `power_cycle` returns when the
    controller was without power and is on again; without it that check is left out. `max_drift`: share by which the
    controller's clock may differ from the host's. `wires` are between outputs and inputs of the board, which its file
    `device` names, or its port. Raises UsageError when the application may not be replaced, the controller has a
    processor plctool does not compile for or wires contradict each other, LinkError if no device answers.
    """
    check_wires(wires)
    plc = connect()
    try:
        identity, status = plc.identity(), plc.status()
        if status.state is not AppState.NONE and not replace:
            raise UsageError(
                f"There is an application on {identity.node_name} that the check would replace; say --yes.", "occupied"
            )
        with tempfile.TemporaryDirectory(prefix="port-check-") as folder:
            bench = Bench(connect, plc, target_of(identity, device), Path(folder), link, identity.target_id)
            checks = Checks(bench, power_cycle, max_drift, Wires(bench, wires, device).checks())
            outcomes = []
            for check in checks.all():
                outcomes.append(judge(check))
                show(outcomes[-1])
            plc = bench.plc
        return Report(identity, bench.target, link, outcomes)
    finally:
        plc.close()
