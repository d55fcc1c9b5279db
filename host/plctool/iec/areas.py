"""Where variables are: the memory areas of an application."""

from __future__ import annotations

from enum import Enum

from plctool.core import lib


class Area(Enum):
    """Memory areas, by their numbers in an image."""

    DATA = int(lib.APP_AREA_DATA)
    RETAIN = int(lib.APP_AREA_RETAIN)
    INPUT = int(lib.APP_AREA_INPUT)
    OUTPUT = int(lib.APP_AREA_OUTPUT)
    MEMORY = int(lib.APP_AREA_MEMORY)
    CODE = int(lib.APP_AREA_CODE)


EXCLUSIVE_AREAS = frozenset((Area.DATA, Area.RETAIN))  # in the others variables may overlap (%MW0, %MX0.3)
