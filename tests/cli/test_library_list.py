"""`plctool symbols --library`: what the standard library has."""

from __future__ import annotations

from plctool.compiler.syntax.library import standard_library


def test_list_has_name_kind_and_what_it_does(tool) -> None:
    done = tool("symbols", "--library", "crc32", "FILE.Open", "TON")
    assert [line.split(maxsplit=2) for line in done.out.splitlines()] == [
        ["name", "kind", "about"],
        ["CRC32", "function", "That of Ethernet and .zip files"],
        ["FILE.Open", "block", "Opens a file"],
        ["TON", "block", "On-delay"],
    ]


def test_all_functions_and_blocks_are_listed_and_nothing_internal(tool) -> None:
    rows = tool("symbols", "--library", "--json").json["library"]
    names = {row["name"] for row in rows}
    assert {"SIN", "LEN", "CTU_DINT", "PID", "LogAdd2", "FILE.Read", "SysTimeRtcGet", "MODBUS_READ"} <= names
    assert not any("__" in name for name in names)
    assert len(names) == len(rows) == len(set(standard_library().names("FUNCTION", "FUNCTION_BLOCK")))


def test_comments_are_cut_after_their_first_sentence(tool) -> None:
    rows = {row["name"]: row["about"] for row in tool("symbols", "--library", "--json").json["library"]}
    assert rows["LogAdd2"] == "Adds a message to the log"
    assert rows["MODBUS_READ"] == "Reads once, at a rising edge of Execute"


def test_name_that_the_library_lacks_is_refused(tool) -> None:
    done = tool("symbols", "--library", "TONNE")
    assert done.status == 2
    assert done.err == "plctool: The library has no function or block TONNE; write for example 'CRC*'.\n"
