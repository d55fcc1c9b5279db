"""An application made by hand, with symbols, for tests of what is above the services."""

from __future__ import annotations

from plctool.core import lib
from plctool.debug.symbols import CodeUnit, SymbolTable
from plctool.debug.variables import Symbol
from plctool.iec.types import BOOL, DINT, INT, REAL, TIME, ArrayType, StringType
from plctool.image.file import ApplicationInfo, Image, ImageTask, build_image

RETURN = b"\xc3"
DATA, CODE = int(lib.APP_AREA_DATA), int(lib.APP_AREA_CODE)


def make_application(version: str = "1", code_size: int = 64) -> tuple[bytes, SymbolTable]:
    """An image whose code does nothing (on x86-64), and the symbols that belong to it."""
    image = build_image(
        Image(
            device_id=int(lib.TARGET_ID_X86_64_LINUX),
            code=RETURN * code_size,
            areas={DATA: 256},
            functions={int(lib.CDL_FUNCTION_GLOBAL_INIT): 0},
            externals=[],
            tasks=[ImageTask("Main", 0, 1, 10_000, 0)],
            info=ApplicationInfo(project="small", version=version),
        )
    )
    variables = [
        Symbol("Main.count", DATA, 0, DINT),
        Symbol("Main.ok", DATA, 4, BOOL),
        Symbol("Main.level", DATA, 8, REAL),
        Symbol("Main.pause", DATA, 12, TIME),
        Symbol("Main.name", DATA, 16, StringType(10)),
        Symbol("Main.list", DATA, 28, ArrayType(INT, ((1, 3),))),
        Symbol("Main.limit", CODE, 0, DINT),
    ]
    table = SymbolTable(
        image_crc=int.from_bytes(image[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4], "little"),
        target="x86_64-linux",
        project="small",
        tasks=["Main"],
        variables={v.name: v for v in variables},
        pous=[CodeUnit("Main", 0, 64, "main.st", 1)],
        lines=[(0, 0, 7), (0x20, 0, 8)],
        files=["main.st"],
    )
    return image, table
