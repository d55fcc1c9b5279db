"""Typed programs made by hand, compiled for this machine and run in this process."""

from __future__ import annotations

import ctypes
import functools
import mmap
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from plctool.compiler.codegen.lower_unit import ALL_CHECKS, Check, Options
from plctool.compiler.image.build import BuildResult, build_program
from plctool.compiler.typed.nodes import (
    Binary,
    BinaryOp,
    Const,
    Expr,
    Initial,
    Load,
    Place,
    Pos,
    Pou,
    PouKind,
    Statement,
    Storage,
    StructInit,
    Task,
    TaskKind,
    TypedProgram,
    Variable,
    VarPlace,
)
from plctool.core import lib
from plctool.iec.areas import Area
from plctool.iec.types import BOOL, INT, Type, align_up
from plctool.image.file import parse_image
from plctool.image.targets import find_target

POS = Pos("main.st", 1, 1)


def pos(line: int) -> Pos:
    return Pos("main.st", line, 1)


def const(value: int | float | str, t: Type = INT) -> Const:
    return Const(value, t, POS)


def place(var: Variable) -> VarPlace:
    return VarPlace(var, var.type, POS)


def load(what: Variable | Place) -> Load:
    target = place(what) if isinstance(what, Variable) else what
    return Load(target, target.type, POS)


def binary(op: BinaryOp, left: Expr, right: Expr) -> Binary:
    comparison = op in (BinaryOp.EQ, BinaryOp.NE, BinaryOp.LT, BinaryOp.LE, BinaryOp.GT, BinaryOp.GE)
    return Binary(op, left, right, BOOL if comparison else left.type, POS)


class ProgramBuilder:
    """One program Main with one task; `variable` allots memory in an area."""

    def __init__(self) -> None:
        self.sizes = dict.fromkeys(Area, 0)
        self.globals: list[Variable] = []
        self.pous: list[Pou] = []
        self.defaults: dict[str, StructInit] = {}
        self.locals: list[Variable] = []

    def variable(self, name: str, t: Type, initial: Initial | None = None, area: Area = Area.DATA) -> Variable:
        offset = align_up(self.sizes[area], t.align)
        self.sizes[area] = offset + t.size
        var = Variable(f"Main.{name}", t, Storage.AREA, POS, area, offset, initial)
        self.globals.append(var)
        return var

    def program(self, *body: Statement) -> TypedProgram:
        main = Pou("Main", PouKind.PROGRAM, POS, locals=self.locals, body=list(body))
        task = Task("task", TaskKind.CYCLIC, 0, 1000, [main])
        return TypedProgram([*self.pous, main], self.globals, [task], dict(self.sizes), self.defaults, {"Main": main})

    def run(self, *body: Statement, level: int = 2, checks: frozenset[Check] = ALL_CHECKS) -> Running:
        return Running(build(self.program(*body), level=level, checks=checks))


def build(
    program: TypedProgram, target: str = "x86_64-linux", level: int = 2, checks: frozenset[Check] = ALL_CHECKS
) -> BuildResult:
    return build_program(program, Options(find_target(target), level, checks))


HELPER = r"""
#include <setjmp.h>
#include <stdint.h>
static jmp_buf env;
static uint32_t raised;
static uintptr_t where;
void helper_raise(uint32_t code)
{
    raised = code;
    where = (uintptr_t)__builtin_return_address(0);
    longjmp(env, 1);
}
uint32_t helper_call(void (*fn)(const void *, uint32_t), const void *context, uint32_t argument)
{
    raised = 0;
    if (setjmp(env) == 0)
        fn(context, argument);
    return raised;
}
uintptr_t helper_where(void) { return where; }
double helper_twice(double x) { return 2 * x; }
int8_t helper_negate(int8_t x, uint8_t doit) { return doit ? -x : x; }
uint8_t helper_high_bits(int8_t x) { return x & 0xF0; }
"""


@functools.cache
def helper() -> ctypes.CDLL:
    """A few lines of C that catch what compiled code raises."""
    folder = Path(tempfile.mkdtemp(prefix="plctool-back-"))
    source, library = folder / "helper.c", folder / "helper.so"
    source.write_text(HELPER)
    subprocess.run(["cc", "-O1", "-shared", "-fPIC", "-o", library, source], check=True)
    lib = ctypes.CDLL(str(library))
    lib.helper_call.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32]
    lib.helper_call.restype = ctypes.c_uint32
    lib.helper_where.restype = ctypes.c_size_t
    return lib


class Context(ctypes.Structure):
    """IEC_CONTEXT on a 64-bit machine."""

    _fields_ = [
        ("time_ns", ctypes.c_int64),
        ("time_ms", ctypes.c_int32),
        ("reserved", ctypes.c_uint32),
        ("area", ctypes.c_void_p * 6),
        ("imports", ctypes.c_void_p),
    ]


class Running:
    """An application in memory of this process: initialised, its variables readable and writable by name."""

    def __init__(self, built: BuildResult) -> None:
        self.built = built
        self.image = parse_image(built.image)
        self._code = mmap.mmap(-1, len(self.image.code), prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
        self._code.write(self.image.code)
        self.base = ctypes.addressof(ctypes.c_char.from_buffer(self._code))
        self.areas = [ctypes.create_string_buffer(self.image.areas.get(i, 0) + 32) for i in range(5)]
        self.context = Context()
        for i, area in enumerate(self.areas):
            self.context.area[i] = align_up(ctypes.addressof(area), 16)
        self.context.area[5] = self.base
        table = (ctypes.c_void_p * max(len(self.image.externals), 1))()
        for i, external in enumerate(self.image.externals):
            name = external.name.removeprefix("iec")
            table[i] = ctypes.cast(helper()[f"helper_{name}"], ctypes.c_void_p).value
        self._table = table
        self.context.imports = ctypes.addressof(table)
        self.initialise()

    def initialise(self) -> None:
        """CodeInit and, if there is one, GlobalInit of a cold start."""
        for number in (lib.CDL_FUNCTION_CODE_INIT, lib.CDL_FUNCTION_GLOBAL_INIT):
            if number in self.image.functions:
                assert self._call(self.image.functions[number], 1) == 0

    def _call(self, offset: int, argument: int = 0) -> int:
        code: int = helper().helper_call(self.base + offset, ctypes.addressof(self.context), argument)
        return code

    def cycle(self, task: int = 0) -> int:
        """Runs a task once; returns the RTSEXCPT_* it raised, 0 for none."""
        return self._call(self.image.tasks[task].entry)

    @property
    def raised_at(self) -> int:
        """Code offset within the call that raised."""
        where: int = helper().helper_where()
        return where - 1 - self.base

    def memory(self, area: int, offset: int, size: int) -> bytes:
        return ctypes.string_at(self.context.area[area] + offset, size)

    def __getitem__(self, name: str) -> Any:
        symbol = self.built.symbols.resolve(f"Main.{name}")
        return symbol.decode(self.memory(symbol.area, symbol.offset, symbol.size))

    def __setitem__(self, name: str, value: Any) -> None:
        symbol = self.built.symbols.resolve(f"Main.{name}")
        change = symbol.change(value)
        place = symbol.offset + change.offset
        data = change.data
        if change.mask != 0xFF:
            data = bytes([(self.memory(symbol.area, place, 1)[0] & ~change.mask) | data[0]])
        ctypes.memmove(self.context.area[symbol.area] + place, data, len(data))
