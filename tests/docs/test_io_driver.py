"""docs/io-driver.md: what it lets a vendor type makes a driver that compiles."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

from prose import ROOT

TEXT = (ROOT / "docs" / "io-driver.md").read_text()
BLANK = ROOT / "firmware" / "port" / "baremetal" / "blank"


def test_the_blank_driver_becomes_one_that_compiles(tmp_path: Path) -> None:
    for name in ("IoDrvBlank.c", "IoDrvBlank.h"):
        shutil.copy(BLANK / name, tmp_path)
    for command in re.findall(r"^\$ (sed .*)$", TEXT, re.MULTILINE):
        subprocess.run(command, shell=True, cwd=tmp_path, check=True, timeout=60)
    driver = tmp_path / "IoDrvAcmeAdc.c"
    source = driver.read_text()
    assert "Blank" not in source
    for function, text in re.findall(r"^```c IoDrvAcmeAdc\.c (\w+)\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL):
        pattern = rf"^static RTS_RESULT {function}\(.*?^}}\n"
        source, count = re.subn(pattern, lambda _, text=text: text, source, flags=re.MULTILINE | re.DOTALL)
        assert count == 1, function
    driver.write_text(source.replace("/* ---- an app", "static RTS_UI16 acme_adc[2];\n\n/* ---- an app"))
    compiler = shutil.which("cc")
    assert compiler, "this test needs a C compiler: install gcc or clang"
    options = ["-std=c99", "-Wall", "-Wextra", "-Werror", f"-I{BLANK}", f"-I{ROOT / 'firmware' / 'include'}"]
    done = subprocess.run(
        [compiler, *options, "-c", driver, "-o", tmp_path / "driver.o"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
