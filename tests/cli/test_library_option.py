"""`--library`: libraries on the command line, beside those of the project."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "compiler"))

from library_support import library, manifest, zipped

GET = "FUNCTION Get : INT\nGet := 7;\nEND_FUNCTION\n"
USE = "PROGRAM Main\nVAR n : INT; END_VAR\nn := Lib.Get();\nEND_PROGRAM\n"


def test_library_is_given_to_build_check_and_test(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(USE + "TEST 'get'\nASSERT_EQ(Lib.Get(), 7);\nEND_TEST\n")
    library(scratch / "libs", "Lib", {"get.st": GET})
    zipped(scratch / "lib.zip", {"library.toml": manifest("Lib"), "get.st": GET})
    for given in ("libs/Lib", "libs", "lib.zip"):
        assert tool("check", "main.st", "--library", given).status == 0
        assert tool("test", "main.st", "--library", given).status == 0
        assert tool("build", "main.st", "--library", given).status == 0
        assert "Main.n = 7" in tool("run", "app.cdl", "--get", "Main.n").out
    assert "There are two libraries Lib" in tool("check", "main.st", "--library", "libs", "--library", "lib.zip").err


def test_libraries_of_the_command_line_are_added_to_those_of_the_project(tool: Any, scratch: Path) -> None:
    (scratch / "src").mkdir()
    (scratch / "src/main.st").write_text(USE.replace("Lib.Get()", "Lib.Get() + Other.Got()"))
    library(scratch, "Lib", {"get.st": GET})
    library(scratch, "Other", {"got.st": GET.replace("Get", "Got")})
    (scratch / "plc.toml").write_text('sources = ["src"]\nlibraries = ["Lib"]\n')
    assert tool("check").status == 2
    assert tool("check", "--library", "Other").status == 0


def test_mistake_in_library_toml_is_reported_with_its_line(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(USE)
    home = library(scratch, "Lib", {"get.st": GET}, Base="1.0")
    done = tool("check", "main.st", "--library", "Lib", "--json")
    assert done.status == 2
    assert (done.json["diagnostics"][0]["file"], done.json["diagnostics"][0]["line"]) == ("Lib/library.toml", 4)
    (home / "library.toml").unlink()
    done = tool("check", "main.st", "--library", "Lib")
    assert done.status == 2 and "Lib is not a library: it has no library.toml" in done.err
