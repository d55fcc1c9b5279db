"""A program that stores VALUE at ADDRESS, which is no memory, in its fourth cycle."""

from __future__ import annotations

ADDRESS = 0x10
VALUE = 0x1234ABCD

PROGRAM = """
TYPE Place : UNION number : LWORD; pointer : POINTER TO DWORD; END_UNION END_TYPE
PROGRAM Main
VAR place : Place; value : DWORD := 16#1234ABCD; n : INT; END_VAR
n := n + 1;
IF n > 3 THEN place.number := 16#10; END_IF
IF place.number <> 0 THEN place.pointer^ := value; END_IF
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""
LINE = 7  # of the store
