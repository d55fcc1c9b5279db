"""Installs what pyproject.toml names (build requirements, dependencies, all extras) into the running environment.

The tests use the sources and the build folder directly, so the package itself is not installed.
"""

import subprocess
import sys
import tomllib
from itertools import chain
from pathlib import Path

project = tomllib.loads(Path(sys.argv[1]).read_text())
wanted = [
    *project["build-system"]["requires"],
    *project["project"]["dependencies"],
    *chain.from_iterable(project["project"]["optional-dependencies"].values()),
]
subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", *wanted], check=True)
