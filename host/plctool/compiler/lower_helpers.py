"""Functions in LLVM IR that every image may need: string loops, and the memory functions LLVM calls by name.

PTR stands for the integer type of an address, START for the index at which a byte loop takes over from the 16-byte loop
in front of it (0 when the target has none). No loop leaves the capacity; bytes behind a NUL are frozen, as they may
never have been written.
"""

from __future__ import annotations

import re

from plctool.compiler.targets import Target

# Loads 16 bytes at %w of ADDRESS into %NAME.
_WIDE_LOAD = """  %NAME.a = getelementptr i8, ptr ADDRESS, PTR %x
  %NAME.l = load <16 x i8>, ptr %NAME.a, align 1
  %NAME = freeze <16 x i8> %NAME.l
"""

# %w runs over the 16-byte blocks that lie within LIMIT + 1 bytes.
_WIDE_LOOP = """  %room = add i32 LIMIT, 1
  %chunks = and i32 %room, -16
  br label %wide
wide:
  %w = phi i32 [ 0, %entry ], [ %w.next, %skip ]
  %full = icmp eq i32 %w, %chunks
  br i1 %full, label %loop, label %chunk
chunk:
  %x = zext i32 %w to PTR
"""

_WIDE_NEXT = """skip:
  %w.next = add i32 %w, 16
  br label %wide
"""

_WIDE_LENGTH = (
    _WIDE_LOOP.replace("LIMIT", "%cap")
    + _WIDE_LOAD.replace("NAME", "v").replace("ADDRESS", "%s")
    + """  %m = icmp eq <16 x i8> %v, zeroinitializer
  %b = bitcast <16 x i1> %m to i16
  %any = icmp ne i16 %b, 0
  br i1 %any, label %found, label %skip
found:
  %k = call i16 @llvm.cttz.i16(i16 %b, i1 true)
  %k.wide = zext i16 %k to i32
  %r = add i32 %w, %k.wide
  ret i32 %r
"""
    + _WIDE_NEXT
)

_LENGTH = """define internal i32 @str.length(ptr %s, i32 %cap) ATTRIBUTES {
entry:
WIDE  br label %loop
loop:
  %i = phi i32 [ START ], [ %n, %next ]
  %more = icmp ult i32 %i, %cap
  br i1 %more, label %test, label %done
test:
  %ix = zext i32 %i to PTR
  %p = getelementptr i8, ptr %s, PTR %ix
  %c.l = load i8, ptr %p, align 1
  %c = freeze i8 %c.l
  %z = icmp eq i8 %c, 0
  br i1 %z, label %done, label %next
next:
  %n = add i32 %i, 1
  br label %loop
done:
  ret i32 %i
}
"""

_WIDE_COPY = (
    _WIDE_LOOP.replace("LIMIT", "%limit")
    + _WIDE_LOAD.replace("NAME", "v").replace("ADDRESS", "%src")
    + """  %to = getelementptr i8, ptr %dst, PTR %x
  store <16 x i8> %v, ptr %to, align 1
  %m = icmp eq <16 x i8> %v, zeroinitializer
  %b = bitcast <16 x i1> %m to i16
  %any = icmp ne i16 %b, 0
  br i1 %any, label %found, label %skip
found:
  ret void
"""
    + _WIDE_NEXT
)

_COPY = """define internal void @str.copy(ptr %dst, i32 %dcap, ptr %src, i32 %scap) ATTRIBUTES {
entry:
  %limit = call i32 @llvm.umin.i32(i32 %dcap, i32 %scap)
WIDE  br label %loop
loop:
  %i = phi i32 [ START ], [ %n, %next ]
  %ix = zext i32 %i to PTR
  %d = getelementptr i8, ptr %dst, PTR %ix
  %more = icmp ult i32 %i, %limit
  br i1 %more, label %test, label %done
test:
  %p = getelementptr i8, ptr %src, PTR %ix
  %c.l = load i8, ptr %p, align 1
  %c = freeze i8 %c.l
  %z = icmp eq i8 %c, 0
  br i1 %z, label %done, label %next
next:
  store i8 %c, ptr %d, align 1
  %n = add i32 %i, 1
  br label %loop
done:
  store i8 0, ptr %d, align 1
  ret void
}
"""

_WIDE_COMPARE = (
    _WIDE_LOOP.replace("LIMIT", "%limit")
    + _WIDE_LOAD.replace("NAME", "va").replace("ADDRESS", "%a")
    + _WIDE_LOAD.replace("NAME", "vb").replace("ADDRESS", "%b")
    + """  %differ = icmp ne <16 x i8> %va, %vb
  %end = icmp eq <16 x i8> %va, zeroinitializer
  %stop = or <16 x i1> %differ, %end
  %bits = bitcast <16 x i1> %stop to i16
  %any = icmp ne i16 %bits, 0
  br i1 %any, label %found, label %skip
found:
  %k = call i16 @llvm.cttz.i16(i16 %bits, i1 true)
  %k.wide = zext i16 %k to i32
  %at = add i32 %w, %k.wide
  br label %loop
"""
    + _WIDE_NEXT
)

_COMPARE = """define internal i32 @str.compare(ptr %a, i32 %acap, ptr %b, i32 %bcap) ATTRIBUTES {
entry:
  %limit = call i32 @llvm.umin.i32(i32 %acap, i32 %bcap)
WIDE  br label %loop
loop:
  %i = phi i32 [ START ], [ %n, %next ]
  %ix = zext i32 %i to PTR
  %a.in = icmp ult i32 %i, %acap
  br i1 %a.in, label %a.load, label %a.done
a.load:
  %pa = getelementptr i8, ptr %a, PTR %ix
  %ca.l = load i8, ptr %pa, align 1
  %ca.f = freeze i8 %ca.l
  br label %a.done
a.done:
  %ca = phi i8 [ 0, %loop ], [ %ca.f, %a.load ]
  %b.in = icmp ult i32 %i, %bcap
  br i1 %b.in, label %b.load, label %b.done
b.load:
  %pb = getelementptr i8, ptr %b, PTR %ix
  %cb.l = load i8, ptr %pb, align 1
  %cb.f = freeze i8 %cb.l
  br label %b.done
b.done:
  %cb = phi i8 [ 0, %a.done ], [ %cb.f, %b.load ]
  %same = icmp eq i8 %ca, %cb
  %live = icmp ne i8 %ca, 0
  %go = and i1 %same, %live
  br i1 %go, label %next, label %done
next:
  %n = add i32 %i, 1
  br label %loop
done:
  %xa = zext i8 %ca to i32
  %xb = zext i8 %cb to i32
  %r = sub i32 %xa, %xb
  ret i32 %r
}
"""

_BODIES = {
    "str.length": (_LENGTH, _WIDE_LENGTH, "%w, %wide"),
    "str.copy": (_COPY, _WIDE_COPY, "%w, %wide"),
    "str.compare": (_COMPARE, _WIDE_COMPARE, "%w, %wide ], [ %at, %found"),
}

_MEMORY = """define internal ptr @memcpy(ptr %d, ptr %s, PTR %n) ATTRIBUTES section ".text.memcpy" {
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

define internal ptr @memset(ptr %d, i32 %c, PTR %n) ATTRIBUTES section ".text.memset" {
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

define internal ptr @memmove(ptr %d, ptr %s, PTR %n) ATTRIBUTES section ".text.memmove" {
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

MEMORY_FUNCTIONS = ("memcpy", "memset", "memmove")


def string_helper(name: str, target: Target, attributes: str) -> str:
    """The definition of one of the str.* functions for a target."""
    body, wide, start = _BODIES[name]
    if target.vectors:
        body = body.replace("WIDE  br label %loop\n", wide).replace("START", start)
    else:
        body = body.replace("WIDE", "").replace("START", "0, %entry")
    return finish(body, target, attributes)


def memory_functions(target: Target, attributes: str) -> str:
    """memcpy, memset and memmove, each in a section of its own so that the linker takes only what is called."""
    word = 16 if target.vectors else target.pointer_size if target.unaligned else 1
    return finish(_MEMORY.replace("VECTOR", f"<{word} x i8>").replace("WORD", str(word)), target, attributes)


def finish(body: str, target: Target, attributes: str) -> str:
    body = body.replace("PTR", f"i{8 * target.pointer_size}").replace("ATTRIBUTES", attributes)
    return re.sub(r"= zext i32 (\S+) to i32", r"= add i32 \1, 0", body)  # there is no cast to the same type


# ---- the two loops all string functions of the standard library are made of -----------------------------------------

_WIDE_SPAN = """define internal i32 @NAME(PARAMETERS) ATTRIBUTES {
entry:
  %left = sub i32 %p0.capacity, %p1
  %count = call i32 @llvm.umin.i32(i32 %p2, i32 %left)
  %stop = add i32 %p1, %count
  %room = add i32 %left, 1
  %chunks = and i32 %room, -16
  %from = zext i32 %p1 to PTR
  %base = getelementptr i8, ptr %p0, PTR %from
  br label %wide
wide:
  %w = phi i32 [ 0, %entry ], [ %w.next, %skip ]
  %enough = icmp uge i32 %w, %count
  br i1 %enough, label %full, label %more
full:
  ret i32 %stop
more:
  %end = icmp eq i32 %w, %chunks
  br i1 %end, label %loop, label %chunk
chunk:
  %x = zext i32 %w to PTR
  %a = getelementptr i8, ptr %base, PTR %x
  %l = load <16 x i8>, ptr %a, align 1
  %v = freeze <16 x i8> %l
  %m = icmp eq <16 x i8> %v, zeroinitializer
  %b = bitcast <16 x i1> %m to i16
  %any = icmp ne i16 %b, 0
  br i1 %any, label %found, label %skip
found:
  %k = call i16 @llvm.cttz.i16(i16 %b, i1 true)
  %k.wide = zext i16 %k to i32
  %at = add i32 %w, %k.wide
  %n = call i32 @llvm.umin.i32(i32 %at, i32 %count)
  %r = add i32 %p1, %n
  ret i32 %r
skip:
  %w.next = add i32 %w, 16
  br label %wide
loop:
  %i = phi i32 [ %w, %more ], [ %i.next, %next ]
  %inside = icmp ult i32 %i, %count
  br i1 %inside, label %test, label %done
test:
  %ix = zext i32 %i to PTR
  %p = getelementptr i8, ptr %base, PTR %ix
  %c.l = load i8, ptr %p, align 1
  %c = freeze i8 %c.l
  %z = icmp eq i8 %c, 0
  br i1 %z, label %done, label %next
next:
  %i.next = add i32 %i, 1
  br label %loop
done:
  %q = add i32 %p1, %i
  ret i32 %q
}
"""

_WIDE_PART = """define internal i32 @NAME(PARAMETERS) ATTRIBUTES {
entry:
  %to.left = sub i32 %p0.capacity, %p1
  %from.left = sub i32 %p2.capacity, %p3
  %left = call i32 @llvm.umin.i32(i32 %to.left, i32 %from.left)
  %count = call i32 @llvm.umin.i32(i32 %p4, i32 %left)
  %room = add i32 %left, 1
  %chunks = and i32 %room, -16
  %to.x = zext i32 %p1 to PTR
  %to = getelementptr i8, ptr %p0, PTR %to.x
  %from.x = zext i32 %p3 to PTR
  %from = getelementptr i8, ptr %p2, PTR %from.x
  br label %wide
wide:
  %w = phi i32 [ 0, %entry ], [ %w.next, %skip ]
  %end = icmp eq i32 %w, %chunks
  br i1 %end, label %loop, label %chunk
chunk:
  %x = zext i32 %w to PTR
  %a = getelementptr i8, ptr %from, PTR %x
  %l = load <16 x i8>, ptr %a, align 1
  %v = freeze <16 x i8> %l
  %d = getelementptr i8, ptr %to, PTR %x
  store <16 x i8> %v, ptr %d, align 1
  %m = icmp eq <16 x i8> %v, zeroinitializer
  %b = bitcast <16 x i1> %m to i16
  %b.wide = zext i16 %b to i32
  %b.end = or i32 %b.wide, 65536
  %k = call i32 @llvm.cttz.i32(i32 %b.end, i1 true)
  %at = add i32 %w, %k
  %w.next = add i32 %w, 16
  %n = call i32 @llvm.umin.i32(i32 %at, i32 %count)
  %on = icmp uge i32 %n, %w.next
  br i1 %on, label %skip, label %done
skip:
  br label %wide
loop:
  %i = phi i32 [ %w, %wide ], [ %i.next, %next ]
  %inside = icmp ult i32 %i, %count
  br i1 %inside, label %test, label %done
test:
  %ix = zext i32 %i to PTR
  %p = getelementptr i8, ptr %from, PTR %ix
  %c.l = load i8, ptr %p, align 1
  %c = freeze i8 %c.l
  %z = icmp eq i8 %c, 0
  br i1 %z, label %done, label %next
next:
  %dp = getelementptr i8, ptr %to, PTR %ix
  store i8 %c, ptr %dp, align 1
  %i.next = add i32 %i, 1
  br label %loop
done:
  %length = phi i32 [ %n, %chunk ], [ %i, %loop ], [ %i, %test ]
  %length.x = zext i32 %length to PTR
  %last = getelementptr i8, ptr %to, PTR %length.x
  store i8 0, ptr %last, align 1
  %r = add i32 %p1, %length
  ret i32 %r
}
"""

_LIBRARY = {"SPAN__": _WIDE_SPAN, "COPY__": _WIDE_PART}


def library_function(name: str, target: Target) -> str | None:
    """A faster body for a function of stdlib/strings.st with the same meaning, or None: NAME, PARAMETERS and ATTRIBUTES
    are to be replaced."""
    return _LIBRARY.get(name) if target.vectors else None
