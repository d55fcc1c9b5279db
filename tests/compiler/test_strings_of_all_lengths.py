"""Strings of all lengths in strings of all capacities: nothing is lost, nothing beyond the end is touched."""

from __future__ import annotations

from pathlib import Path

from plctool import Simulator

LONGEST = 50  # three vectors, and some characters
SIZES = range(1, LONGEST + 1)


def test_copies_and_parts_and_appended_strings(tmp_path: Path) -> None:
    """Targets follow each other in memory, and the last one is written first."""
    variables = "".join(f"c{n}, l{n}, a{n} : STRING[{n}];\n" for n in SIZES)
    body = "".join(
        f"a{n} := CONCAT(s, 'ABCDEFGHIJKLMNOPQR');\nl{n} := LEFT(s, {n // 2});\nc{n} := s;\n" for n in reversed(SIZES)
    )
    (tmp_path / "main.st").write_text(
        f"PROGRAM Main VAR s : STRING[{LONGEST}]; {variables} moved : STRING[{LONGEST}]; END_VAR\n"
        f"{body} moved := s; moved := DELETE(moved, 3, 2);\nEND_PROGRAM"
    )
    with Simulator.from_sources(tmp_path / "main.st") as plc:
        for length in range(LONGEST + 1):
            text = "".join(chr(ord("a") + i % 26) for i in range(length))
            plc.write({"Main.s": text})
            plc.run_cycles(1)
            for n in SIZES:
                assert plc.read(f"Main.c{n}") == text[:n]
                assert plc.read(f"Main.l{n}") == text[: n // 2]
                assert plc.read(f"Main.a{n}") == (text + "ABCDEFGHIJKLMNOPQR")[:n]
            assert plc.read("Main.moved") == text[:1] + text[4:]
