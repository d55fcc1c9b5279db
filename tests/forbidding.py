"""What a program forbids, on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from plctool.controller import OPERATIONS, Controller
from plctool.core import lib
from plctool.errors import DeviceError
from plctool.testing.waiting import eventually

PROGRAM = """
PROGRAM Main
VAR lock : ARRAY[0..7] OF BOOL; n, zero : INT; trip : BOOL; END_VAR
PlcOperationControlInstance.xDisableApplicationOnlineChange := lock[0];
PlcOperationControlInstance.xDisableApplicationDownload := lock[1];
PlcOperationControlInstance.xDisableApplicationStop := lock[2];
PlcOperationControlInstance.xDisableApplicationBP := lock[3];
PlcOperationControlInstance.xDisableApplicationWrite := lock[4];
PlcOperationControlInstance.xDisableApplicationForce := lock[5];
PlcOperationControlInstance.xDisableApplicationReset := lock[6];
PlcOperationControlInstance.xDisableAll := lock[7];
n := n + 1;
IF trip THEN n := n / zero; END_IF
END_PROGRAM
"""
ALL = 7


class Forbidding:
    """The fixture `plc` is a controller that runs PROGRAM, whose image is the fixture `image`."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    def forbid(self, plc: Controller, number: int) -> None:
        plc.write({f"Main.lock[{number}]": True})
        self.wait(plc, lambda: plc.status().forbidden)

    def operations(self, plc: Controller, image: Any) -> dict[str, Callable[[], object]]:
        return {
            "download": lambda: plc.flash(image, force=True),
            "stop": plc.stop,
            "force": lambda: plc.force({"Main.n": 5}),
            "reset": plc.reset,
        }

    def test_each_operation_is_forbidden_by_its_own_member(self, plc: Controller, image: Any) -> None:
        for number, name in enumerate(OPERATIONS):
            self.forbid(plc, number)
            assert plc.status().forbidden == [name]
            for other, operate in self.operations(plc, image).items():
                if other == name:
                    with pytest.raises(DeviceError, match="program forbids it") as caught:
                        operate()
                    assert caught.value.result == lib.ERR_OPERATION_DENIED
                    assert str(plc.status().state) == "run"
            plc.reset("origin")
            plc.flash(image)

    def test_what_is_not_forbidden_goes_on(self, plc: Controller, image: Any) -> None:
        self.forbid(plc, OPERATIONS.index("breakpoint"))
        for operate in self.operations(plc, image).values():
            operate()
            plc.start()

    def test_all_forbids_each_of_them(self, plc: Controller, image: Any) -> None:
        self.forbid(plc, ALL)
        assert plc.status().forbidden == list(OPERATIONS)

    def test_a_program_that_failed_forbids_nothing(self, plc: Controller, image: Any) -> None:
        plc.write({f"Main.lock[{ALL}]": True, "Main.trip": True})
        self.wait(plc, lambda: str(plc.status().state) == "exception")
        assert plc.status().forbidden == []
        plc.reset("warm")
        assert plc.status().forbidden == []

    def test_a_reset_to_the_origin_is_always_a_way_out(self, plc: Controller, image: Any) -> None:
        self.forbid(plc, ALL)
        plc.reset("origin")
        assert str(plc.status().state) == "none"
