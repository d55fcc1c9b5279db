"""Where variables are.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.typed import Variable
from plctool.iec.areas import Area
from plctool.iec.types import align_up


class Allocation:
    """Gives variables their place in the areas."""

    def __init__(self) -> None:
        self.sizes: dict[Area, int] = {area: 0 for area in Area if area is not Area.CODE}
        self.variables: list[Variable] = []

    def add(self, variable: Variable) -> None:
        """Places a variable at the end of its area, or notes one that has an address. Inputs and outputs without one
        get it in the end (`io_channels.py`)."""
        t, area = variable.type, variable.area
        if variable.offset < 0 and area in (Area.INPUT, Area.OUTPUT):
            self.variables.append(variable)
            return
        if variable.offset < 0:
            variable.offset = align_up(self.sizes[area], t.align)
        self.sizes[area] = max(self.sizes[area], variable.offset + t.size)
        self.variables.append(variable)
