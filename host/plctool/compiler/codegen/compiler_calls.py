"""Functions LLVM calls where the processor has no instruction (soft float, 64-bit division), reached as imports."""

from __future__ import annotations

from plctool.compiler.typed.nodes import runtime_function
from plctool.image.c_functions import C_FUNCTIONS, COMPILER_COMPONENTS

COMPILER_CALLS = {
    function.name: runtime_function(function.name)
    for function in C_FUNCTIONS.values()
    if function.component in COMPILER_COMPONENTS
}
