"""memcpy, memset and memmove, which LLVM calls by name: an object of its own, linked when a program needs one of them.

They are the same in every program, and LLVM takes longer for their loops than for a small program, so they are compiled
once in a process, or come from the cache.
"""

from __future__ import annotations

from plctool.compiler.codegen.ir import Function, Module, Value, number
from plctool.compiler.codegen.lower_unit import Options, function_attributes
from plctool.compiler.codegen.object_cache import ObjectCache
from plctool.compiler.codegen.objects import emit_objects
from plctool.compiler.codegen.partition import Part
from plctool.image.targets import Target

_ZERO = number(0)


_made: dict[str, bytes] = {}  # by the name of the target


def memory_object(target: Target, cache: ObjectCache | None = None) -> bytes:
    """The ELF object with the three functions, each in a section of its own so that the linker takes only what is
    called. It says how their frames look (.debug_frame), for the call stack of an exception in one of them."""
    if target.name not in _made:
        _made[target.name] = _memory_object(target, cache)
    return _made[target.name]


def _memory_object(target: Target, cache: ObjectCache | None) -> bytes:
    module = Module(target.triple)
    attributes = module.attributes(f"minsize optsize {function_attributes(target)}")
    module.add_compile_unit(module.metadata('!DIFile(filename: "memory", directory: "")'))
    memory = _Memory(target)
    bodies = {
        f"memcpy(ptr %d, ptr %s, {memory.size} %n)": memory.copy,
        f"memset(ptr %d, i32 %c, {memory.size} %n)": memory.fill,
        f"memmove(ptr %d, ptr %s, {memory.size} %n)": memory.move,
    }
    definitions = []
    for signature, write in bodies.items():
        name = signature.partition("(")[0]
        fn = Function(f"ptr @{signature}", f'{attributes} section ".text.{name}"')
        write(fn)
        definitions.append(fn.definition("hidden"))
    return emit_objects([Part(module.text(definitions))], Options(target, cache=cache))[0]


MEMORY_FUNCTIONS = frozenset(("memcpy", "memset", "memmove"))


class _Memory:
    """Writes the bodies for a target: whole words, or vectors, first, then bytes."""

    def __init__(self, target: Target) -> None:
        self.size = f"i{8 * target.pointer_size}"
        self._word = 16 if target.vectors else target.pointer_size if target.unaligned else 1
        self._vector = f"<{self._word} x i8>"

    def copy(self, fn: Function) -> None:
        words = self._words(fn)
        value = fn.value(f"load {self._vector}, ptr {self._at(fn, '%s', words)}, align 1")
        fn.do(f"store {self._vector} {value}, ptr {self._at(fn, '%d', words)}, align 1")
        fn.branch("wide")
        i = self._bytes(fn, words)
        value = fn.value(f"load i8, ptr {self._at(fn, '%s', i)}, align 1")
        fn.do(f"store i8 {value}, ptr {self._at(fn, '%d', i)}, align 1")
        self._end(fn, i)

    def fill(self, fn: Function) -> None:
        byte = fn.value("trunc i32 %c to i8")
        lane = fn.value(f"insertelement {self._vector} poison, i8 {byte}, i32 0")
        lanes = fn.value(
            f"shufflevector {self._vector} {lane}, {self._vector} poison, <{self._word} x i32> zeroinitializer"
        )
        words = self._words(fn)
        fn.do(f"store {self._vector} {lanes}, ptr {self._at(fn, '%d', words)}, align 1")
        fn.branch("wide")
        i = self._bytes(fn, words)
        fn.do(f"store i8 {byte}, ptr {self._at(fn, '%d', i)}, align 1")
        self._end(fn, i)

    def move(self, fn: Function) -> None:
        """Byte by byte: upwards, unless the target begins within the source."""
        target, source = (fn.value(f"ptrtoint ptr {name} to {self.size}") for name in ("%d", "%s"))
        gap = fn.value(f"sub {self.size} {target}, {source}")
        fn.branch_if(fn.value(f"icmp uge {self.size} {gap}, %n"), "up", "down")
        fn.begin_detached("up")
        i = fn.phi(self.size, (_ZERO, "entry"))
        fn.branch_if(fn.value(f"icmp ult {self.size} {i}, %n"), "up.body", "done")
        fn.begin_detached("up.body")
        self._move_byte(fn, i)
        fn.add_incoming(i, fn.value(f"add {self.size} {i}, 1"), "up.body")
        fn.branch("up")
        fn.begin_detached("down")
        left = fn.phi(self.size, (Value("%n"), "entry"))
        fn.branch_if(fn.value(f"icmp ne {self.size} {left}, 0"), "down.body", "done")
        fn.begin_detached("down.body")
        last = fn.value(f"sub {self.size} {left}, 1")
        self._move_byte(fn, last)
        fn.add_incoming(left, last, "down.body")
        fn.branch("down")
        self._return(fn)

    def _move_byte(self, fn: Function, i: Value) -> None:
        source, target = self._at(fn, "%s", i), self._at(fn, "%d", i)
        fn.do(f"store i8 {fn.value(f'load i8, ptr {source}, align 1')}, ptr {target}, align 1")

    def _at(self, fn: Function, base: str, index: Value) -> Value:
        return fn.value(f"getelementptr i8, ptr {base}, {self.size} {index}")

    def _words(self, fn: Function) -> Value:
        """The loop `wide` over whole words, of which the body follows; the index of a word."""
        fn.begin("wide")
        at = fn.phi(self.size, (_ZERO, "entry"))
        after = fn.value(f"add {self.size} {at}, {self._word}")
        fn.add_incoming(at, after, "wide.body")
        fn.branch_if(fn.value(f"icmp ule {self.size} {after}, %n"), "wide.body", "loop")
        fn.begin_detached("wide.body")
        return at

    def _bytes(self, fn: Function, words: Value) -> Value:
        """The loop over what is left, of which the body follows; the index of a byte."""
        fn.begin_detached("loop")
        i = fn.phi(self.size, (words, "wide"))
        fn.branch_if(fn.value(f"icmp ult {self.size} {i}, %n"), "body", "done")
        fn.begin_detached("body")
        return i

    def _end(self, fn: Function, i: Value) -> None:
        fn.add_incoming(i, fn.value(f"add {self.size} {i}, 1"), "body")
        fn.branch("loop")
        self._return(fn)

    @staticmethod
    def _return(fn: Function) -> None:
        fn.begin_detached("done")
        fn.terminate("ret ptr %d")
