"""Where variables are: the memory areas of an application."""

from __future__ import annotations

from enum import Enum


class Area(Enum):
    """Memory areas, numbered as in firmware/include/CompactDownload.h (APP_AREA_*)."""

    DATA = 0
    RETAIN = 1
    INPUT = 2
    OUTPUT = 3
    MEMORY = 4
    CODE = 5
