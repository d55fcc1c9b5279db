"""Recipes on a board; the rest of the promise is in tests/recipes.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from recipes import PROGRAM, Recipes

from plctool.device import Plc
from plctool.link.connection import Connection


class TestBoard(Recipes):
    @pytest.fixture
    def plc(self, make_board, build):
        with make_board("full") as board, Plc(Connection(board.line())) as plc:
            plc.flash(build(PROGRAM).path)
            yield plc
