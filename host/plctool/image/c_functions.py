"""The C functions of the runtime that programs call: which component has them, and how much stack they take.

Those that a vendor adds are not known here.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from plctool.image.targets import Machine, Target

_FUNCTIONS = {
    "CmpIecTask": """
        iecraise(UDINT)                                     48    96""",
    "CmpRetain": """
        ieckept(POINTER TO BYTE,UDINT):BOOL                 32    16""",
    "CmpOperationControl": """
        operation_control(POINTER TO BYTE):BOOL             64    80""",
    "IecLog": """
        log_add(UDINT,UDINT,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD):BOOL  352  480""",
    "IecEvents": """
        event_answer(BOOL):BOOL                             32    48
        event_current():UDINT                               16    16
        event_register(UDINT,UDINT,BOOL):BOOL               64    80
        event_reason(LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD):BOOL  160  192""",
    "CmpAppCalls": """
        call_put(DINT,UDINT,LWORD,LWORD,LWORD,LWORD):BOOL  112   160
        call_send(DINT,UDINT):BOOL                          48    64
        call_state(DINT):DINT                               48    64
        call_result(DINT):UDINT                             32    48
        call_get(DINT,UDINT):LWORD                          48    64
        call_free(DINT):BOOL                                32    48
        call_room():UDINT                                   16    16
        call_wait(DINT):BOOL                                48    64""",
    "IecFile": """
        file_call(UDINT,UDINT,UDINT):DINT                   80   112""",
    "IecSocket": """
        socket_call(UDINT,UDINT,UDINT):DINT                 80   112
        socket_session():UDINT                              16    16""",
    "IecCom": """
        com_call(UDINT,UDINT,UDINT):DINT                    80   112""",
    "IecCan": """
        can_send(USINT,DWORD,USINT,USINT,LWORD):DINT            160   208
        can_sent(DINT):DINT                                     64   80
        can_take(USINT,DWORD,DWORD,BOOL):DINT                   64   80
        can_next(DINT):DINT                                     64   80
        can_head(DINT):LWORD                                    64   80
        can_data(DINT):LWORD                                    64   80
        can_time(DINT):UDINT                                    64   80
        can_lost(DINT):UDINT                                    64   80
        can_free(DINT):BOOL                                     64   80""",
    "IoDrvCanopen": """
        canopen_take(USINT,USINT,WORD,BYTE,BYTE,UDINT,UDINT):DINT  160  208
        canopen_put(DINT,UDINT,LWORD):BOOL                      80   96
        canopen_send(DINT):BOOL                                 64   80
        canopen_state(DINT):DINT                                64   80
        canopen_result(DINT):LWORD                              64   80
        canopen_get(DINT,UDINT):LWORD                           80   96
        canopen_free(DINT):BOOL                                 64   80
        canopen_status(USINT,USINT):DWORD                       80  112
        canopen_emcy(USINT,USINT):DINT                          96  128
        canopen_emcy_data(DINT):LWORD                           80   96""",
    "IecClock": """
        clock_get():LINT                                    32    48
        clock_set(LINT):UDINT                               16    32
        clock_now():LINT                                    32    48""",
    "IecTaskCalls": """
        task_value(UDINT,UDINT):UDINT                      224   240
        task_name(UDINT,UDINT):LWORD                       192   192
        task_watchdog(UDINT,BOOL):BOOL                      64    64
        task_schedule(UDINT,BOOL):BOOL                      64    64""",
    "IecTaskHandler": """
        task_answer(UDINT,BOOL):BOOL                        64    64""",
    "CmpMath": """
        sin(LREAL):LREAL                                  1008  1856
        cos(LREAL):LREAL                                  1008  1856
        tan(LREAL):LREAL                                  1008  1856
        asin(LREAL):LREAL                                  128   672
        acos(LREAL):LREAL                                  112   688
        atan(LREAL):LREAL                                   80   384
        exp(LREAL):LREAL                                   112   384
        log(LREAL):LREAL                                   112   672
        log10(LREAL):LREAL                                 160   784
        atan2(LREAL,LREAL):LREAL                           128   480
        pow(LREAL,LREAL):LREAL                             208  1424
        sinf(REAL):REAL                                    640   768
        cosf(REAL):REAL                                    640   768
        tanf(REAL):REAL                                    640   768
        asinf(REAL):REAL                                    96   208
        acosf(REAL):REAL                                    80   224
        atanf(REAL):REAL                                    80   128
        expf(REAL):REAL                                     96   144
        logf(REAL):REAL                                     96   176
        log10f(REAL):REAL                                  128   192
        atan2f(REAL,REAL):REAL                             112   144
        powf(REAL,REAL):REAL                               224  1456""",
    "IoDrvModbus": """
        modbus_take(POINTER TO BYTE,USINT,UINT,UINT):DINT   112   160
        modbus_put(DINT,UINT,WORD):BOOL                     48    64
        modbus_send(DINT):BOOL                              32    48
        modbus_state(DINT):DINT                             32    48
        modbus_get(DINT,UINT):WORD                          48    64
        modbus_free(DINT):BOOL                              32    48""",
    "CmpIntCalls": """
        __divdi3(LINT,LINT):LINT                            80    64
        __udivdi3(ULINT,ULINT):ULINT                        80    64
        __moddi3(LINT,LINT):LINT                            80    64
        __umoddi3(ULINT,ULINT):ULINT                        80    64
        __muldi3(LINT,LINT):LINT                            32    32
        __ashldi3(LINT,DINT):LINT                           32    32
        __ashrdi3(LINT,DINT):LINT                           32    32
        __lshrdi3(LINT,DINT):LINT                           32    32
        __divsi3(DINT,DINT):DINT                            32    32
        __udivsi3(UDINT,UDINT):UDINT                        32    32
        __modsi3(DINT,DINT):DINT                            32    32
        __umodsi3(UDINT,UDINT):UDINT                        32    32
        __clzsi2(UDINT):DINT                                32    32
        __clzdi2(ULINT):DINT                                32    32""",
    "CmpRealCalls": """
        __fixsfdi(REAL):LINT                                32    48
        __fixunssfdi(REAL):ULINT                            16    32
        __floatdisf(LINT):REAL                              32    80
        __floatundisf(ULINT):REAL                           32    80
        sqrtf(REAL):REAL                                    48   128
        __addsf3(REAL,REAL):REAL                            16    32
        __subsf3(REAL,REAL):REAL                            16    32
        __mulsf3(REAL,REAL):REAL                            16    48
        __divsf3(REAL,REAL):REAL                            16    48
        __eqsf2(REAL,REAL):DINT                             16    16
        __nesf2(REAL,REAL):DINT                             16    16
        __ltsf2(REAL,REAL):DINT                             16    16
        __lesf2(REAL,REAL):DINT                             16    16
        __gtsf2(REAL,REAL):DINT                             16    16
        __gesf2(REAL,REAL):DINT                             16    16
        __unordsf2(REAL,REAL):DINT                          16    16
        __fixsfsi(REAL):DINT                                16    16
        __fixunssfsi(REAL):UDINT                            16    16
        __floatsisf(DINT):REAL                              16    32
        __floatunsisf(UDINT):REAL                           16    32""",
    "CmpLrealCalls": """
        __fixdfdi(LREAL):LINT                               80    48
        __fixunsdfdi(LREAL):ULINT                           64    48
        sqrt(LREAL):LREAL                                   64   224
        __adddf3(LREAL,LREAL):LREAL                         80    48
        __subdf3(LREAL,LREAL):LREAL                         80    48
        __muldf3(LREAL,LREAL):LREAL                         32    80
        __divdf3(LREAL,LREAL):LREAL                         32    80
        __eqdf2(LREAL,LREAL):DINT                           16    16
        __nedf2(LREAL,LREAL):DINT                           16    16
        __ltdf2(LREAL,LREAL):DINT                           16    16
        __ledf2(LREAL,LREAL):DINT                           16    16
        __gtdf2(LREAL,LREAL):DINT                           16    16
        __gedf2(LREAL,LREAL):DINT                           16    16
        __unorddf2(LREAL,LREAL):DINT                        16    16
        __fixdfsi(LREAL):DINT                               16    16
        __fixunsdfsi(LREAL):UDINT                           16    16
        __floatsidf(DINT):LREAL                             32    48
        __floatunsidf(UDINT):LREAL                          32    32
        __floatdidf(LINT):LREAL                             32    80
        __floatundidf(ULINT):LREAL                          32    48
        __extendsfdf2(REAL):LREAL                           32    48
        __truncdfsf2(LREAL):REAL                            48    16""",
}
"""By component: the interface of each function, and the bytes of stack that a call takes on Cortex-M and on RISC-V.
Those of the last three are for LLVM, and have the names of the GNU compiler runtime, which libgcc and compiler-rt
share. Cortex-M0 is taken for one like the others: there is no firmware here to measure."""

COMPILER_COMPONENTS = {
    "CmpIntCalls": "LINT and division",
    "CmpRealCalls": "REAL",
    "CmpLrealCalls": "LREAL",
}
"""The last three, and what their functions are for."""

_ON_CORTEX_M0 = frozenset(("__muldi3", "__ashldi3", "__ashrdi3", "__lshrdi3", "__clzsi2", "__clzdi2"))
"""Other processors have instructions for it, so their firmware does not register these."""

_DIVISIONS = frozenset(("__divsi3", "__udivsi3", "__modsi3", "__umodsi3"))
"""The firmware of a processor that divides words itself does not register these."""

_WITHOUT_FPU = frozenset(
    (
        "sqrtf", "__addsf3", "__subsf3", "__mulsf3", "__divsf3", "__eqsf2", "__nesf2", "__ltsf2", "__lesf2",
        "__gtsf2", "__gesf2", "__unordsf2", "__fixsfsi", "__fixunssfsi", "__floatsisf", "__floatunsisf",
    )
)  # fmt: skip
"""The firmware of a processor that computes with REAL itself does not register these."""

VERSION = 0x00010000
"""Of the library of all of them."""


_VERSION = re.compile(r"(\d{1,3})\.(\d{1,3})(?:\.(\d{1,3})\.(\d{1,3}))?")


def parse_version(text: str) -> int | None:
    """The number of a version '1.0' (major << 16 | minor) or '1.0.0.0' (a byte each, the first one not 0), which are
    apart by the uppermost byte. Of both the device compares the upper half, and wants no less in the lower one."""
    found = _VERSION.fullmatch(text)
    parts = [int(part) for part in found.groups() if part is not None] if found else []
    if not parts or max(parts) > 255 or (len(parts) == 4 and parts[0] == 0):
        return None
    return parts[0] << 16 | parts[1] if len(parts) == 2 else int.from_bytes(bytes(parts), "big")


def version_text(version: int) -> str:
    """The version as it is written."""
    if version >> 24:
        return ".".join(str(part) for part in version.to_bytes(4, "big"))
    return f"{version >> 16}.{version & 0xFFFF}"


@dataclass(frozen=True)
class CFunction:
    """`interface`: what the signature is made of, e.g. 'sin(LREAL):LREAL'. `cortex_m`, `riscv`: bytes of stack that a
    call takes at most, with all that it calls, in any firmware of this repository by the compilers of Debian 12 and 13,
    and a fifth more."""

    component: str
    interface: str
    cortex_m: int
    riscv: int

    @property
    def name(self) -> str:
        return self.interface.partition("(")[0]

    @property
    def signature(self) -> int:
        return interface_signature(self.interface)

    def is_registered(self, target: Target) -> bool:
        """Whether its component registers it on a processor."""
        if self.name in _ON_CORTEX_M0:
            return target.machine is Machine.THUMB_V6M
        if self.name in _DIVISIONS:
            return not target.divides
        return self.name not in _WITHOUT_FPU or not target.has_fpu

    def stack(self, machine: Machine) -> int:
        """Bytes on a processor."""
        return self.riscv if machine is Machine.RISCV32 else self.cortex_m


def interface_signature(text: str) -> int:
    """The signature id of a C function: CRC-32 of its interface text."""
    return zlib.crc32(text.encode("latin-1", "replace"))


def _functions() -> Iterator[CFunction]:
    for component, text in _FUNCTIONS.items():
        for line in text.split("\n")[1:]:
            interface, cortex_m, riscv = line.strip().rsplit(maxsplit=2)
            yield CFunction(component, interface, int(cortex_m), int(riscv))


C_FUNCTIONS = {function.name: function for function in _functions()}
"""By name."""


def find_c_function(name: str, signature: int) -> CFunction | None:
    """The function of the runtime that an image calls; None for another one, perhaps of the same name."""
    function = C_FUNCTIONS.get(name)
    return function if function is not None and function.signature == signature else None
