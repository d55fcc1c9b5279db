"""`python -m plctool` is `plctool`."""

from __future__ import annotations

import sys

from plctool.cli.main import main

sys.exit(main())
