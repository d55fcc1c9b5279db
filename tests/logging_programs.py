"""What a program adds to the log, on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from plctool.controller import Controller
from plctool.core import lib
from plctool.link.services import LogEntry
from plctool.testing.waiting import eventually

PROGRAM = """
PROGRAM Main
VAR step, before, flood : INT; result : UDINT; line : STRING(120); END_VAR
IF step <> before THEN
    before := step;
    CASE step OF
    1: result := LogAdd2(LogConstants.LOG_STD_LOGGER, 0, LogClass.LOG_WARNING, 5, 0, CONCAT('pump is ', 'dry'));
    2: result := LogAdd(0, 'Pumps', LogClass.LOG_EXCEPTION, 0, 0, 'a$Nb%s%d');
    3: result := CmpLog.LogAdd2(0, 0, LogClass.LOG_INFO, 0, 0, line);
    4: ADSLOGSTR(ADSLOG_MSGTYPE_LOG OR ADSLOG_MSGTYPE_ERROR, 'valve %s is shut', 'A');
       ADSLOGDINT(ADSLOG_MSGTYPE_HINT, 'speed %d', -5);
    END_CASE
END_IF
IF flood > 0 THEN
    flood := flood - 1;
    result := LogAdd2(0, 0, LogClass.LOG_INFO, 0, 0, 'again');
END_IF
END_PROGRAM
"""
MOST = 80  # characters of a message; a controller with short entries cuts it


class Logging:
    """The fixture `plc` is a controller that runs PROGRAM."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    def of_program(self, plc: Controller) -> list[LogEntry]:
        return [entry for entry in plc.log() if entry.component == "IecLog"]

    def step(self, plc: Controller, number: int, count: int) -> list[LogEntry]:
        """What the program adds in a step."""
        known = len(self.of_program(plc))
        plc.write({"Main.step": number})
        self.wait(plc, lambda: len(self.of_program(plc)) >= known + count)
        return self.of_program(plc)[known:]

    def test_message_has_its_class_error_and_text(self, plc: Controller) -> None:
        (entry,) = self.step(plc, 1, 1)
        assert (entry.log_class, entry.error, entry.text) == (lib.LOG_WARNING, 5, "pump is dry")
        assert plc.read("Main.result") == 0

    def test_message_is_one_line_and_no_exception_of_the_runtime(self, plc: Controller) -> None:
        (entry,) = self.step(plc, 2, 1)
        assert (entry.log_class, entry.text) == (lib.LOG_ERROR, "a b%s%d")

    def test_message_that_is_too_long_is_cut(self, plc: Controller) -> None:
        plc.write({"Main.line": "x" * 120})
        (entry,) = self.step(plc, 3, 1)
        assert MOST - 1 <= len(entry.text) <= MOST and set(entry.text) == {"x"}

    def test_messages_of_twincat_have_their_argument(self, plc: Controller) -> None:
        first, second = self.step(plc, 4, 2)
        assert (first.log_class, first.text) == (lib.LOG_ERROR, "valve A is shut")
        assert (second.log_class, second.text) == (lib.LOG_INFO, "speed -5")

    def test_program_that_logs_in_each_cycle_leaves_room_for_others(self, plc: Controller) -> None:
        first = plc.log()[0].handle
        plc.write({"Main.flood": 500})
        self.wait(plc, lambda: plc.read("Main.flood") == 0)
        assert plc.read("Main.result") == lib.ERR_OUT_OF_LIMITS
        assert plc.log()[0].handle == first  # nothing is lost of what was there
        known = len(self.of_program(plc))
        self.wait(plc, lambda: self.step_is_taken(plc))
        assert any("messages of the program left out" in e.text for e in self.of_program(plc)[known:])

    def step_is_taken(self, plc: Controller) -> bool:
        """True if a message comes into the log again."""
        plc.write({"Main.flood": 1})
        self.wait(plc, lambda: plc.read("Main.flood") == 0)
        return bool(plc.read("Main.result") == 0)
