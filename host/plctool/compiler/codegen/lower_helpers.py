"""Functions in LLVM IR: the loops all string functions are made of.

Templates. Strings are walked in chunks of CHUNK bytes (a vector, or an integer) as long as a whole chunk is within
the capacity, then byte by byte. PTR stands for the integer type of an address, START for the index at which the byte
loop takes over (0 when the target has no chunks). Bytes after a NUL are frozen, as they may never have been written.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from plctool.image.targets import Target

# The chunk loop of a function that stops at a NUL or after %count characters: %w runs over the chunks within %room
# bytes; %x is %w as an address. VISIT loads the chunk as %v. It ends in %full with %n, the number of characters, or
# goes on in the byte loop.
_COUNTED = """  %inner = call i32 @llvm.usub.sat.i32(i32 %room, i32 LAST)
  %bound = call i32 @llvm.umin.i32(i32 %inner, i32 %count)
  %none = icmp eq i32 %bound, 0
  br i1 %none, label %loop, label %chunk
chunk:
  %w = phi i32 [ 0, %entry ], [ %w.next, %clear ]
  %w.next = add i32 %w, CHUNK
  %x = zext i32 %w to PTR
VISITMARKS  %hit = icmp ne MARK %marks, 0
  br i1 %hit, label %found, label %clear
clear:
  %on = icmp ult i32 %w.next, %bound
  br i1 %on, label %chunk, label %short
short:
  %enough = icmp uge i32 %w.next, %count
  br i1 %enough, label %full, label %loop
found:
FIRST  %at = add i32 %w, %k
  br label %full
full:
  %end = phi i32 [ %w.next, %short ], [ %at, %found ]
  %n = call i32 @llvm.umin.i32(i32 %end, i32 %count)
"""

# The chunk loop of a comparison.
_CHUNKS = """  %chunks = and i32 %room, -CHUNK
  br label %wide
wide:
  %w = phi i32 [ 0, %entry ], [ %w.next, %skip ]
  %w.next = add i32 %w, CHUNK
  %end = icmp eq i32 %w, %chunks
  br i1 %end, label %loop, label %chunk
skip:
  br label %wide
chunk:
  %x = zext i32 %w to PTR
"""


def _load(name: str, address: str) -> str:
    return f"""  %{name}.a = getelementptr i8, ptr {address}, PTR %x
  %{name}.l = load VEC, ptr %{name}.a, align 1
  %{name} = freeze VEC %{name}.l
"""


@dataclass(frozen=True)
class _Walk:
    """A function that walks a string. `head`: up to the loops, sets %room (and %count); `chunks`: the loop over chunks,
    which leads to the byte loop with index START; `rest`: the byte loop and the end. `extra`: what the loop over chunks
    adds to the phi marked EXTRA."""

    head: str
    chunks: str
    rest: str
    start: str
    extra: str = ""


# Which bytes of the chunk %v are NUL: %marks is not zero when there is one.
_VECTOR_MARKS = """  %m = icmp eq VEC %v, zeroinitializer
  %marks = bitcast <CHUNK x i1> %m to iCHUNK
"""
_INTEGER_MARKS = """  %less = sub VEC %v, ONES
  %not = xor VEC %v, -1
  %under = and VEC %less, %not
  %marks = and VEC %under, HIGHS
"""

# The index of the first NUL, which is there, as i32 %k.
_VECTOR_FIRST = """  %marks.wide = zext iCHUNK %marks to i32
  %k = call i32 @llvm.cttz.i32(i32 %marks.wide, i1 true)
"""
_INTEGER_FIRST = """  %k.bit = call VEC @llvm.cttz.VEC(VEC %marks, i1 true)
  %k.byte = lshr VEC %k.bit, 3
  %k = trunc VEC %k.byte to i32
"""

_VECTOR_UNLIKE = """  %u = icmp ne VEC %v, %o
  %u.marks = bitcast <CHUNK x i1> %u to iCHUNK
  %unlike = icmp ne iCHUNK %u.marks, 0
"""
_INTEGER_UNLIKE = "  %unlike = icmp ne VEC %v, %o\n"

_STORE = """  %to.a = getelementptr i8, ptr %to, PTR %x
  store VEC %v, ptr %to.a, align 1
"""

# The rest, byte by byte, up to COUNT of them or the end of the string. What is done with each follows.
_BYTES = """loop:
  %i = phi i32 START, [ %i.next, %next ]
  %inside = icmp ult i32 %i, %count
  br i1 %inside, label %test, label %done
test:
  %i.x = zext i32 %i to PTR
  %p = getelementptr i8, ptr BASE, PTR %i.x
  %c.l = load i8, ptr %p, align 1
  %c = freeze i8 %c.l
  %z = icmp eq i8 %c, 0
  br i1 %z, label %done, label %next
next:
"""

# SPAN__ of stdlib/strings.st: the index at most COUNT characters after START where the string ends.
_SPAN = _Walk(
    head="""define internal i32 @str.span(ptr %ctx, ptr %s, i32 %cap, i32 %start, i32 %want) ATTRIBUTES {
entry:
  %left = sub i32 %cap, %start
  %count = call i32 @llvm.umin.i32(i32 %want, i32 %left)
  %room = add i32 %left, 1
  %start.x = zext i32 %start to PTR
  %base = getelementptr i8, ptr %s, PTR %start.x
""",
    chunks=_COUNTED.replace("VISIT", _load("v", "%base"))
    + """  %r = add i32 %start, %n
  ret i32 %r
""",
    start="[ 0, %entry ], [ %w.next, %short ]",
    rest=_BYTES.replace("BASE", "%base")
    + """  %i.next = add i32 %i, 1
  br label %loop
done:
  %q = add i32 %start, %i
  ret i32 %q
}
""",
)

# COPY__ of stdlib/strings.st: copies at most COUNT characters of a string from START on to another one at POS, ends
# that there and returns its new length. With POS and START 0 it is the assignment of strings. Both may be the same
# string when POS is not above START.
_COPY = _Walk(
    head="""define internal i32 @str.copy(ptr %ctx, ptr %d, i32 %dcap, i32 %pos,
                              ptr %s, i32 %scap, i32 %start, i32 %want) ATTRIBUTES {
entry:
  %d.left = sub i32 %dcap, %pos
  %s.left = sub i32 %scap, %start
  %left = call i32 @llvm.umin.i32(i32 %d.left, i32 %s.left)
  %count = call i32 @llvm.umin.i32(i32 %want, i32 %left)
  %room = add i32 %left, 1
  %pos.x = zext i32 %pos to PTR
  %to = getelementptr i8, ptr %d, PTR %pos.x
  %start.x = zext i32 %start to PTR
  %from = getelementptr i8, ptr %s, PTR %start.x
""",
    chunks=_COUNTED.replace("VISIT", _load("v", "%from") + _STORE) + "  br label %done\n",
    start="[ 0, %entry ], [ %w.next, %short ]",
    rest=_BYTES.replace("BASE", "%from")
    + """  %q = getelementptr i8, ptr %to, PTR %i.x
  store i8 %c, ptr %q, align 1
  %i.next = add i32 %i, 1
  br label %loop
done:
  %length = phi i32 EXTRA[ %i, %loop ], [ %i, %test ]
  %length.x = zext i32 %length to PTR
  %last = getelementptr i8, ptr %to, PTR %length.x
  store i8 0, ptr %last, align 1
  %r = add i32 %pos, %length
  ret i32 %r
}
""",
    extra="[ %n, %full ], ",
)

# Less than, equal to or greater than 0 as the first string is less than, equal to or greater than the second.
_COMPARE = _Walk(
    head="""define internal i32 @str.compare(ptr %a, i32 %acap, ptr %b, i32 %bcap) ATTRIBUTES {
entry:
  %limit = call i32 @llvm.umin.i32(i32 %acap, i32 %bcap)
  %room = add i32 %limit, 1
""",
    chunks=_CHUNKS
    + _load("v", "%a")
    + _load("o", "%b")
    + """MARKSUNLIKE  %any = icmp ne MARK %marks, 0
  %stop = or i1 %any, %unlike
  br i1 %stop, label %loop, label %skip
""",
    start="[ %w, %wide ]",
    rest="""loop:
  %i = phi i32 START, EXTRA[ %i.next, %next ]
  %i.x = zext i32 %i to PTR
  %a.in = icmp ult i32 %i, %acap
  br i1 %a.in, label %a.load, label %a.done
a.load:
  %pa = getelementptr i8, ptr %a, PTR %i.x
  %ca.l = load i8, ptr %pa, align 1
  %ca.f = freeze i8 %ca.l
  br label %a.done
a.done:
  %ca = phi i8 [ 0, %loop ], [ %ca.f, %a.load ]
  %b.in = icmp ult i32 %i, %bcap
  br i1 %b.in, label %b.load, label %b.done
b.load:
  %pb = getelementptr i8, ptr %b, PTR %i.x
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
  %i.next = add i32 %i, 1
  br label %loop
done:
  %xa = zext i8 %ca to i32
  %xb = zext i8 %cb to i32
  %r = sub i32 %xa, %xb
  ret i32 %r
}
""",
    extra="[ %w, %chunk ], ",
)

_STRINGS = {"str.span": _SPAN, "str.copy": _COPY, "str.compare": _COMPARE}

# Functions of stdlib/strings.st that have a faster body here, with the same meaning.
LIBRARY_FUNCTIONS = {"SPAN__": "str.span", "COPY__": "str.copy", "WSPAN__": "str.wspan", "WCOPY__": "str.wcopy"}


def string_helper(name: str, target: Target, attributes: str) -> str:
    """The definition of one of the str.* functions for a target."""
    wide = name.startswith("str.w")
    walk, chunk = _STRINGS[name.replace("str.w", "str.")], 0 if wide else _chunk(target)
    if not chunk:
        text = walk.head + "  br label %loop\n" + walk.rest
        if wide:
            text = re.sub(r"\bi8\b", "i16", text).replace("align 1", "align 2").replace("@str.", "@str.w", 1)
        return _finish(text.replace("START", "[ 0, %entry ]").replace("EXTRA", ""), target, attributes)
    text = walk.head + walk.chunks + walk.rest
    integer, vector = f"i{8 * chunk}", target.vectors
    parts = {
        "START": walk.start,
        "EXTRA": walk.extra,
        "MARKS": _VECTOR_MARKS if vector else _INTEGER_MARKS,
        "FIRST": _VECTOR_FIRST if vector else _INTEGER_FIRST,
        "UNLIKE": _VECTOR_UNLIKE if vector else _INTEGER_UNLIKE,
        "MARK": f"i{chunk}" if vector else integer,
        "cttz.VEC": f"cttz.{integer}",
        "VEC": f"<{chunk} x i8>" if vector else integer,
        "CHUNK": str(chunk),
        "LAST": str(chunk - 1),
        "ONES": str(int.from_bytes(b"\x01" * chunk, "little")),
        "HIGHS": str(int.from_bytes(b"\x80" * chunk, "little")),
    }
    for word, replacement in parts.items():
        text = text.replace(word, replacement)
    return _finish(text, target, attributes)


def _chunk(target: Target) -> int:
    """How many characters are looked at together; 0 for one by one."""
    if target.vectors:
        return 16
    return target.pointer_size if target.unaligned else 0


def _finish(body: str, target: Target, attributes: str) -> str:
    body = body.replace("PTR", f"i{8 * target.pointer_size}").replace("ATTRIBUTES", attributes)
    return re.sub(r"= (zext|trunc) i32 (\S+) to i32", r"= add i32 \2, 0", body)  # there is no cast to the same type
