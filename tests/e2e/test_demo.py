"""The demo is the product's first impression: it has to end by itself, with success."""

import os
import subprocess
import sys


def test_the_demo_runs_to_its_end(tmp_path):
    env = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-m", "plctool", "demo"], env=env, capture_output=True, text=True, timeout=180
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for word in ("refused", "the boot project comes back", "whole story"):
        assert word in done.stdout
