"""The C functions of the runtime that programs call: which component has them, and how much stack they take.

Those that a vendor adds are not known here.
"""

from __future__ import annotations

from dataclasses import dataclass

_FUNCTIONS = {
    "CmpIecTask": "iecraise 64",
    "CmpRetain": "ieckept 288",
    "CmpMath": """
        sin 1120 cos 1120 tan 1120 asin 208 acos 208 atan 144 exp 160 log 176 log10 256 atan2 160 pow 240
        sinf 768 cosf 768 tanf 768 asinf 208 acosf 224 atanf 128 expf 144 logf 160 log10f 192 atan2f 144 powf 256""",
    "IoDrvModbus": """
        modbus_take 112 modbus_put 48 modbus_send 48 modbus_state 48 modbus_get 48 modbus_free 48""",
    "CmpIntCalls": """
        __divdi3 80 __udivdi3 80 __moddi3 80 __umoddi3 80 __muldi3 32 __ashldi3 32 __ashrdi3 32 __lshrdi3 32
        __divsi3 32 __udivsi3 32 __modsi3 32 __umodsi3 32 __clzsi2 32 __clzdi2 32""",
    "CmpRealCalls": """
        __fixsfdi 48 __fixunssfdi 32 __floatdisf 64 __floatundisf 64 sqrtf 128 __addsf3 32 __subsf3 32 __mulsf3 48
        __divsf3 48 __eqsf2 16 __nesf2 16 __ltsf2 16 __lesf2 16 __gtsf2 16 __gesf2 16 __unordsf2 16 __fixsfsi 16
        __fixunssfsi 16 __floatsisf 32 __floatunsisf 32""",
    "CmpLrealCalls": """
        __fixdfdi 80 __fixunsdfdi 64 sqrt 112 __adddf3 80 __subdf3 80 __muldf3 64 __divdf3 64 __eqdf2 16 __nedf2 16
        __ltdf2 16 __ledf2 16 __gtdf2 16 __gedf2 16 __unorddf2 16 __fixdfsi 16 __fixunsdfsi 16 __floatsidf 32
        __floatunsidf 32 __floatdidf 48 __floatundidf 48 __extendsfdf2 32 __truncdfsf2 16""",
}
"""By component: names, each with bytes of stack."""


@dataclass(frozen=True)
class CFunction:
    """`stack`: bytes that a call takes at most, with all that it calls, in any firmware of this repository, and about a
    fifth more, as other compilers and C libraries differ."""

    component: str
    stack: int


C_FUNCTIONS = {
    name: CFunction(component, int(stack))
    for component, text in _FUNCTIONS.items()
    for name, stack in zip(text.split()[::2], text.split()[1::2], strict=True)
}
"""By name."""
