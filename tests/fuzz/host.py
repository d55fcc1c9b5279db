"""Fuzzes what plctool reads, by atheris: libFuzzer for Python, which sees what an input reaches.

usage: host.py TARGET FOLDER [OPTION OF LIBFUZZER | FOLDER]...

First inputs of the target are written to FOLDER.
"""

from __future__ import annotations

import sys
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["plctool"]):
    from host_targets import TARGETS


def main() -> None:
    _, name, folder, *options = sys.argv
    target = TARGETS[name]
    for number, data in enumerate(target.first()):
        (Path(folder) / f"first-{number}").write_bytes(data)
    atheris.Setup([sys.argv[0], *options], target.run)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
