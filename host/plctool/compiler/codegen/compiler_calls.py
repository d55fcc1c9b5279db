"""Functions LLVM calls where the processor has no instruction (soft float, 64-bit division), reached as imports.

Names and meanings are those of the GNU compiler runtime, which libgcc and compiler-rt share.
"""

from __future__ import annotations

from plctool.compiler.codegen.lower_unit import interface_signature
from plctool.compiler.typed import External

_VERSION = 0x00010000

_INTERFACES = """
__addsf3(REAL,REAL):REAL __subsf3(REAL,REAL):REAL __mulsf3(REAL,REAL):REAL __divsf3(REAL,REAL):REAL
__adddf3(LREAL,LREAL):LREAL __subdf3(LREAL,LREAL):LREAL __muldf3(LREAL,LREAL):LREAL __divdf3(LREAL,LREAL):LREAL
__eqsf2(REAL,REAL):DINT __nesf2(REAL,REAL):DINT __ltsf2(REAL,REAL):DINT __lesf2(REAL,REAL):DINT
__gtsf2(REAL,REAL):DINT __gesf2(REAL,REAL):DINT __unordsf2(REAL,REAL):DINT
__eqdf2(LREAL,LREAL):DINT __nedf2(LREAL,LREAL):DINT __ltdf2(LREAL,LREAL):DINT __ledf2(LREAL,LREAL):DINT
__gtdf2(LREAL,LREAL):DINT __gedf2(LREAL,LREAL):DINT __unorddf2(LREAL,LREAL):DINT
__fixsfsi(REAL):DINT __fixunssfsi(REAL):UDINT __fixsfdi(REAL):LINT __fixunssfdi(REAL):ULINT
__fixdfsi(LREAL):DINT __fixunsdfsi(LREAL):UDINT __fixdfdi(LREAL):LINT __fixunsdfdi(LREAL):ULINT
__floatsisf(DINT):REAL __floatunsisf(UDINT):REAL __floatdisf(LINT):REAL __floatundisf(ULINT):REAL
__floatsidf(DINT):LREAL __floatunsidf(UDINT):LREAL __floatdidf(LINT):LREAL __floatundidf(ULINT):LREAL
__extendsfdf2(REAL):LREAL __truncdfsf2(LREAL):REAL sqrtf(REAL):REAL sqrt(LREAL):LREAL
__divsi3(DINT,DINT):DINT __udivsi3(UDINT,UDINT):UDINT __modsi3(DINT,DINT):DINT __umodsi3(UDINT,UDINT):UDINT
__divdi3(LINT,LINT):LINT __udivdi3(ULINT,ULINT):ULINT __moddi3(LINT,LINT):LINT __umoddi3(ULINT,ULINT):ULINT
__muldi3(LINT,LINT):LINT __ashldi3(LINT,DINT):LINT __ashrdi3(LINT,DINT):LINT __lshrdi3(LINT,DINT):LINT
__clzsi2(UDINT):DINT __clzdi2(ULINT):DINT
"""

COMPILER_CALLS: dict[str, External] = {
    text.partition("(")[0]: External(text.partition("(")[0], interface_signature(text), _VERSION)
    for text in _INTERFACES.split()
}
