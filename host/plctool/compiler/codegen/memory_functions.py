"""memcpy, memset and memmove, which LLVM calls by name: an object of its own, linked when a program needs one of them.

They are the same in every program, and LLVM takes longer for their loops than for a small program, so they are compiled
once in a process.
"""

from __future__ import annotations

from functools import cache

from plctool.compiler.codegen.emit import emit_object
from plctool.compiler.codegen.ir import Module
from plctool.compiler.codegen.lower_unit import function_attributes
from plctool.image.targets import Target

MEMORY_FUNCTIONS = frozenset(("memcpy", "memset", "memmove"))

_MEMORY = """define hidden ptr @memcpy(ptr %d, ptr %s, PTR %n) #0 section ".text.memcpy" {
entry:
  br label %wide
wide:
  %w = phi PTR [ 0, %entry ], [ %w.next, %wide.body ]
  %w.next = add PTR %w, WORD
  %fits = icmp ule PTR %w.next, %n
  br i1 %fits, label %wide.body, label %loop
wide.body:
  %ws = getelementptr i8, ptr %s, PTR %w
  %wd = getelementptr i8, ptr %d, PTR %w
  %wv = load VECTOR, ptr %ws, align 1
  store VECTOR %wv, ptr %wd, align 1
  br label %wide
loop:
  %i = phi PTR [ %w, %wide ], [ %i.next, %body ]
  %more = icmp ult PTR %i, %n
  br i1 %more, label %body, label %done
body:
  %ps = getelementptr i8, ptr %s, PTR %i
  %pd = getelementptr i8, ptr %d, PTR %i
  %v = load i8, ptr %ps, align 1
  store i8 %v, ptr %pd, align 1
  %i.next = add PTR %i, 1
  br label %loop
done:
  ret ptr %d
}

define hidden ptr @memset(ptr %d, i32 %c, PTR %n) #0 section ".text.memset" {
entry:
  %b = trunc i32 %c to i8
  %lane = insertelement <WORD x i8> poison, i8 %b, i32 0
  %lanes = shufflevector <WORD x i8> %lane, <WORD x i8> poison, <WORD x i32> zeroinitializer
  br label %wide
wide:
  %w = phi PTR [ 0, %entry ], [ %w.next, %wide.body ]
  %w.next = add PTR %w, WORD
  %fits = icmp ule PTR %w.next, %n
  br i1 %fits, label %wide.body, label %loop
wide.body:
  %wd = getelementptr i8, ptr %d, PTR %w
  store <WORD x i8> %lanes, ptr %wd, align 1
  br label %wide
loop:
  %i = phi PTR [ %w, %wide ], [ %i.next, %body ]
  %more = icmp ult PTR %i, %n
  br i1 %more, label %body, label %done
body:
  %pd = getelementptr i8, ptr %d, PTR %i
  store i8 %b, ptr %pd, align 1
  %i.next = add PTR %i, 1
  br label %loop
done:
  ret ptr %d
}

define hidden ptr @memmove(ptr %d, ptr %s, PTR %n) #0 section ".text.memmove" {
entry:
  %da = ptrtoint ptr %d to PTR
  %sa = ptrtoint ptr %s to PTR
  %gap = sub PTR %da, %sa
  %forward = icmp uge PTR %gap, %n
  br i1 %forward, label %up, label %down
up:
  %i = phi PTR [ 0, %entry ], [ %i.next, %up.body ]
  %up.more = icmp ult PTR %i, %n
  br i1 %up.more, label %up.body, label %done
up.body:
  %us = getelementptr i8, ptr %s, PTR %i
  %ud = getelementptr i8, ptr %d, PTR %i
  %uv = load i8, ptr %us, align 1
  store i8 %uv, ptr %ud, align 1
  %i.next = add PTR %i, 1
  br label %up
down:
  %k = phi PTR [ %n, %entry ], [ %k.next, %down.body ]
  %down.more = icmp ne PTR %k, 0
  br i1 %down.more, label %down.body, label %done
down.body:
  %k.next = sub PTR %k, 1
  %ds = getelementptr i8, ptr %s, PTR %k.next
  %dd = getelementptr i8, ptr %d, PTR %k.next
  %dv = load i8, ptr %ds, align 1
  store i8 %dv, ptr %dd, align 1
  br label %down
done:
  ret ptr %d
}
"""


@cache
def memory_object(target: Target) -> bytes:
    """The ELF object with the three functions, each in a section of its own so that the linker takes only what is
    called. It says how their frames look (.debug_frame), for the call stack of an exception in one of them."""
    module = Module(target.triple)
    module.attributes(f"minsize optsize {function_attributes(target)}")
    module.add_compile_unit(module.metadata('!DIFile(filename: "memory", directory: "")'))
    word = 16 if target.vectors else target.pointer_size if target.unaligned else 1
    definitions = _MEMORY.replace("VECTOR", f"<{word} x i8>").replace("WORD", str(word))
    module.add_helper(definitions.replace("PTR", f"i{8 * target.pointer_size}"))
    return emit_object(module.text([]), target, 2)
