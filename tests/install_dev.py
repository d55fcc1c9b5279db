"""Installs what pyproject.toml names (build requirements, dependencies, the dev extra) into the running environment.

The tests use the sources and the build folder directly, so the package itself is not installed.
"""

import subprocess
import sys
import tomllib
from pathlib import Path

project = tomllib.loads(Path(sys.argv[1]).read_text())
wanted = [
    *project["build-system"]["requires"],
    *project["project"]["dependencies"],
    *project["project"]["optional-dependencies"]["dev"],
]
subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", *wanted], check=True)
