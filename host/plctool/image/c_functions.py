"""The C functions of the runtime that programs call: which component has them, and how much stack they take.

Those that a vendor adds are not known here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from plctool.image.targets import Machine

_FUNCTIONS = {
    "CmpIecTask": "iecraise 48 80",
    "CmpRetain": "ieckept 304 288",
    "CmpMath": """
        sin 1008 1856  cos 1008 1856  tan 1008 1856  asin 128 672  acos 112 688  atan 80 384  exp 112 384
        log 112 672  log10 160 784  atan2 128 480  pow 208 1424  sinf 640 768  cosf 640 768  tanf 640 768
        asinf 96 208  acosf 80 224  atanf 80 128  expf 96 144  logf 96 176  log10f 128 192  atan2f 112 144
        powf 224 1456""",
    "IoDrvModbus": """
        modbus_take 112 160  modbus_put 48 64  modbus_send 32 48  modbus_state 32 48  modbus_get 48 64
        modbus_free 32 48""",
    "CmpIntCalls": """
        __divdi3 80 32  __udivdi3 80 32  __moddi3 80 32  __umoddi3 80 32  __muldi3 32 32  __ashldi3 32 32
        __ashrdi3 32 32  __lshrdi3 32 32  __divsi3 32 32  __udivsi3 32 32  __modsi3 32 32  __umodsi3 32 32
        __clzsi2 32 32  __clzdi2 32 32""",
    "CmpRealCalls": """
        __fixsfdi 32 48  __fixunssfdi 16 32  __floatdisf 32 80  __floatundisf 32 80  sqrtf 48 128
        __addsf3 16 32  __subsf3 16 32  __mulsf3 16 48  __divsf3 16 48  __eqsf2 16 16  __nesf2 16 16
        __ltsf2 16 16  __lesf2 16 16  __gtsf2 16 16  __gesf2 16 16  __unordsf2 16 16  __fixsfsi 16 16
        __fixunssfsi 16 16  __floatsisf 16 32  __floatunsisf 16 32""",
    "CmpLrealCalls": """
        __fixdfdi 80 48  __fixunsdfdi 64 48  sqrt 64 224  __adddf3 80 48  __subdf3 80 48  __muldf3 32 80
        __divdf3 32 80  __eqdf2 16 16  __nedf2 16 16  __ltdf2 16 16  __ledf2 16 16  __gtdf2 16 16
        __gedf2 16 16  __unorddf2 16 16  __fixdfsi 16 16  __fixunsdfsi 16 16  __floatsidf 32 48
        __floatunsidf 32 32  __floatdidf 32 80  __floatundidf 32 48  __extendsfdf2 32 48  __truncdfsf2 16 16""",
}
"""By component: names, each with bytes of stack on Cortex-M and on RISC-V."""


@dataclass(frozen=True)
class CFunction:
    """`cortex_m`, `riscv`: bytes of stack that a call takes at most, with all that it calls, in any firmware of this
    repository by the compilers of Debian 12 and 13, and a fifth more."""

    component: str
    cortex_m: int
    riscv: int

    def stack(self, machine: Machine) -> int:
        """Bytes on a processor."""
        return self.riscv if machine is Machine.RISCV32 else self.cortex_m


def _functions() -> Iterator[tuple[str, CFunction]]:
    for component, text in _FUNCTIONS.items():
        words = iter(text.split())
        for name, cortex_m, riscv in zip(words, words, words, strict=True):
            yield name, CFunction(component, int(cortex_m), int(riscv))


C_FUNCTIONS = dict(_functions())
"""By name."""
