"""The loops that all functions of strings are made of, in LLVM IR.

Strings are walked in chunks (a vector, or an integer) as long as a whole chunk is within the capacity, then character
by character. What is after a NUL is frozen, as it may never have been written.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from plctool.compiler.codegen.ir import Function, Value, number
from plctool.image.targets import Target

# Functions of stdlib/strings.st that have a faster body here, with the same meaning.
LIBRARY_FUNCTIONS = {
    "SPAN__": "str.span", "SEEK__": "str.seek", "COPY__": "str.copy",
    "WSPAN__": "str.wspan", "WSEEK__": "str.wseek", "WCOPY__": "str.wcopy",
}  # fmt: skip

_ZERO = number(0)


def string_function(name: str, target: Target, attributes: str) -> str:
    """The definition of one of the str.* functions for a target; those of WSTRING begin with str.w."""
    strings = _Strings(target, name.startswith("str.w"))
    kind = name.replace("str.w", "str.")
    fn = Function(f"i32 @{name}({_PARAMETERS[kind].format(character=strings.character)})", attributes)
    _BODIES[kind](fn, strings)
    return fn.definition("internal")


@dataclass(frozen=True)
class _Strings:
    """How strings are read on a target."""

    target: Target
    wide: bool

    @property
    def character(self) -> str:
        return "i16" if self.wide else "i8"

    @property
    def align(self) -> int:
        return 2 if self.wide else 1

    @property
    def chunk(self) -> int:
        """How many characters are looked at together; 0 for one by one."""
        if self.wide:
            return 0
        if self.target.vectors:
            return 16
        return self.target.pointer_size if self.target.unaligned else 0

    @property
    def _integer(self) -> str:
        return f"i{8 * self.chunk}"

    @property
    def _chunk_type(self) -> str:
        return f"<{self.chunk} x i8>" if self.target.vectors else self._integer

    @property
    def _marks_type(self) -> str:
        return f"i{self.chunk}" if self.target.vectors else self._integer

    # ---- addresses ----

    def index(self, fn: Function, value: str | Value) -> Value:
        """A number of characters, as wide as an address."""
        if self.target.pointer_size == 4:
            return Value(str(value))
        return fn.value(f"zext i32 {value} to i{8 * self.target.pointer_size}")

    def at(self, fn: Function, base: str | Value, index: Value) -> Value:
        """The address of a character."""
        return fn.value(f"getelementptr {self.character}, ptr {base}, i{8 * self.target.pointer_size} {index}")

    # ---- characters ----

    def load(self, fn: Function, address: Value) -> Value:
        character = fn.value(f"load {self.character}, ptr {address}, align {self.align}")
        return fn.value(f"freeze {self.character} {character}")

    def store(self, fn: Function, character: Value, address: Value) -> None:
        fn.do(f"store {self.character} {character}, ptr {address}, align {self.align}")

    # ---- chunks ----

    def load_chunk(self, fn: Function, address: Value) -> Value:
        chunk = fn.value(f"load {self._chunk_type}, ptr {address}, align 1")
        return fn.value(f"freeze {self._chunk_type} {chunk}")

    def store_chunk(self, fn: Function, chunk: Value, address: Value) -> None:
        fn.do(f"store {self._chunk_type} {chunk}, ptr {address}, align 1")

    def marks(self, fn: Function, chunk: Value) -> Value:
        """Which characters of a chunk are NUL; of integers the lowest mark only is sure."""
        if self.target.vectors:
            return self._like(fn, chunk, "zeroinitializer")
        ones, highs = (int.from_bytes(bytes([byte]) * self.chunk, "little") for byte in (0x01, 0x80))
        less = fn.value(f"sub {self._integer} {chunk}, {ones}")
        inverted = fn.value(f"xor {self._integer} {chunk}, -1")
        under = fn.value(f"and {self._integer} {less}, {inverted}")
        return fn.value(f"and {self._integer} {under}, {highs}")

    def marks_of(self, fn: Function, chunk: Value, first: Value, second: Value) -> Value:
        """The first characters of a chunk that are NUL, or that the pattern `first` is made of. Of a vector only those
        that the one of `second` may follow, which is any if it is 0."""
        if self.target.vectors:
            found = self._pairs(fn, chunk, first, second)
        else:
            found = self.marks(fn, fn.value(f"xor {self._chunk_type} {chunk}, {first}"))
        return fn.value(f"or {self._marks_type} {self.marks(fn, chunk)}, {found}")

    def _pairs(self, fn: Function, chunk: Value, first: Value, second: Value) -> Value:
        """Where the first of two characters is in a vector and the second one may follow: that is not known of the
        last."""
        any_follows = self._like(fn, second, "zeroinitializer")
        follow = fn.value(f"or {self._marks_type} {self._like(fn, chunk, second)}, {any_follows}")
        before = fn.value(f"lshr {self._marks_type} {follow}, 1")
        before = fn.value(f"or {self._marks_type} {before}, {1 << (self.chunk - 1)}")
        return fn.value(f"and {self._marks_type} {self._like(fn, chunk, first)}, {before}")

    def _like(self, fn: Function, chunk: Value, other: Value | str) -> Value:
        """Which characters of two vectors are the same."""
        same = fn.value(f"icmp eq {self._chunk_type} {chunk}, {other}")
        return fn.value(f"bitcast <{self.chunk} x i1> {same} to {self._marks_type}")

    def pattern(self, fn: Function, character: str) -> Value:
        """A chunk of one character."""
        if self.target.vectors:
            first = fn.value(f"insertelement {self._chunk_type} poison, i8 {character}, i32 0")
            return fn.value(
                f"shufflevector {self._chunk_type} {first}, {self._chunk_type} poison, "
                f"<{self.chunk} x i32> zeroinitializer"
            )
        wide = fn.value(f"zext i8 {character} to {self._integer}")
        ones = int.from_bytes(bytes([1]) * self.chunk, "little")
        return fn.value(f"mul {self._integer} {wide}, {ones}")

    def has_mark(self, fn: Function, marks: Value) -> Value:
        return fn.value(f"icmp ne {self._marks_type} {marks}, 0")

    def first(self, fn: Function, marks: Value) -> Value:
        """The index of the first mark, which is there."""
        if self.target.vectors:
            wide = fn.value(f"zext i{self.chunk} {marks} to i32")
            return fn.value(f"call i32 @llvm.cttz.i32(i32 {wide}, i1 true)")
        bit = fn.value(f"call {self._integer} @llvm.cttz.{self._integer}({self._integer} {marks}, i1 true)")
        byte = fn.value(f"lshr {self._integer} {bit}, 3")
        return byte if self.chunk == 4 else fn.value(f"trunc {self._integer} {byte} to i32")

    def cut(self, fn: Function, chunk: Value, length: Value) -> Value:
        """A vector with zeros from a character on."""
        lanes = ", ".join(f"i8 {lane}" for lane in range(self.chunk))
        ends = self.pattern(fn, str(fn.value(f"trunc i32 {length} to i8")))
        kept = fn.value(f"icmp ult {self._chunk_type} <{lanes}>, {ends}")
        return fn.value(
            f"select <{self.chunk} x i1> {kept}, {self._chunk_type} {chunk}, {self._chunk_type} zeroinitializer"
        )

    def unlike(self, fn: Function, one: Value, other: Value) -> Value:
        """Whether two chunks differ."""
        differ = fn.value(f"icmp ne {self._chunk_type} {one}, {other}")
        if not self.target.vectors:
            return differ
        marks = fn.value(f"bitcast <{self.chunk} x i1> {differ} to i{self.chunk}")
        return fn.value(f"icmp ne i{self.chunk} {marks}, 0")


def _least(fn: Function, one: str | Value, other: str | Value) -> Value:
    return fn.value(f"call i32 @llvm.umin.i32(i32 {one}, i32 {other})")


# ---- walking up to a NUL or a number of characters ----


def _walk_chunks(
    fn: Function, strings: _Strings, room: Value, count: Value, visit: Callable[[Value], Value]
) -> tuple[Value, Value]:
    """From the entry on, over the chunks within `room` characters. `visit` gets the index of a chunk, and gives the
    marks of where the walk ends.

    Leads to the block `loop` from `short`, with the first result as the index to go on at; or on, in the block `full`,
    with the second one as the number of characters, at most `count`.
    """
    inner = fn.value(f"call i32 @llvm.usub.sat.i32(i32 {room}, i32 {strings.chunk - 1})")
    bound = _least(fn, inner, count)
    fn.branch_if(fn.value(f"icmp eq i32 {bound}, 0"), "loop", "chunk")
    fn.begin_detached("chunk")
    at = fn.phi("i32", (_ZERO, "entry"))
    after = fn.value(f"add i32 {at}, {strings.chunk}")
    marks = visit(strings.index(fn, at))
    fn.branch_if(strings.has_mark(fn, marks), "found", "clear")
    fn.begin_detached("clear")
    fn.add_incoming(at, after, "clear")
    fn.branch_if(fn.value(f"icmp ult i32 {after}, {bound}"), "chunk", "short")
    fn.begin_detached("short")
    fn.branch_if(fn.value(f"icmp uge i32 {after}, {count}"), "full", "loop")
    fn.begin_detached("found")
    end = fn.value(f"add i32 {at}, {strings.first(fn, marks)}")
    fn.begin("full")
    length = fn.phi("i32", (after, "short"), (end, "found"))
    return after, _least(fn, length, count)


def _walk_characters(
    fn: Function, strings: _Strings, base: Value, count: Value, start: Value | None
) -> tuple[Value, Value, Value]:
    """The block `loop`: character by character, from the entry, and from `short` with the index `start`.

    Leads to `done` from `loop` and `test`, or on, in the block `next`, from where `_next_character` goes on. Results:
    the index, also as wide as an address, and the character.
    """
    fn.begin_detached("loop")
    i = fn.phi("i32", (_ZERO, "entry"), *([] if start is None else [(start, "short")]))
    fn.branch_if(fn.value(f"icmp ult i32 {i}, {count}"), "test", "done")
    fn.begin_detached("test")
    index = strings.index(fn, i)
    character = strings.load(fn, strings.at(fn, base, index))
    fn.branch_if(fn.value(f"icmp eq {strings.character} {character}, 0"), "done", "next")
    fn.begin_detached("next")
    return i, index, character


def _next_character(fn: Function, i: Value) -> None:
    """Back to `loop`."""
    fn.add_incoming(i, fn.value(f"add i32 {i}, 1"), fn.block)
    fn.branch("loop")


def _span(fn: Function, strings: _Strings) -> None:
    """SPAN__ of stdlib/strings.st: the index at most `want` characters after `start` where the string ends."""
    left = fn.value("sub i32 %cap, %start")
    _scan(fn, strings, left, _least(fn, "%want", left), None)


def _seek(fn: Function, strings: _Strings) -> None:
    """SEEK__ of stdlib/strings.st: the index of the first character %c from `start` on that %d may follow, or of the
    end."""
    left = fn.value("sub i32 %cap, %start")
    _scan(fn, strings, left, left, ("%c", "%d"))


def _scan(fn: Function, strings: _Strings, left: Value, count: Value, sought: tuple[str, str] | None) -> None:
    """Returns the index at most `count` of the `left` characters after `start`, of the end or the first one `sought`,
    which the second one may follow."""
    room = fn.value(f"add i32 {left}, 1")
    base = strings.at(fn, "%s", strings.index(fn, "%start"))
    start = None
    if strings.chunk:
        patterns = [strings.pattern(fn, character) for character in sought or ()]

        def marks(index: Value) -> Value:
            chunk = strings.load_chunk(fn, strings.at(fn, base, index))
            return strings.marks_of(fn, chunk, *patterns) if patterns else strings.marks(fn, chunk)

        start, length = _walk_chunks(fn, strings, room, count, marks)
        fn.terminate(f"ret i32 {fn.value(f'add i32 %start, {length}')}")
    else:
        fn.branch("loop")
    i, _, character = _walk_characters(fn, strings, base, count, start)
    if sought is not None:
        fn.branch_if(fn.value(f"icmp eq {strings.character} {character}, {sought[0]}"), "done", "other")
        fn.begin_detached("other")
    _next_character(fn, i)
    fn.begin_detached("done")
    fn.terminate(f"ret i32 {fn.value(f'add i32 %start, {i}')}")


def _copy(fn: Function, strings: _Strings) -> None:
    """COPY__ of stdlib/strings.st: copies at most `want` characters of a string from `start` on to another one at
    `pos`, ends that there and returns its new length. With `pos` and `start` 0 it is the assignment of strings. Both
    may be the same string when `pos` is not above `start`."""
    target_left, source_left = fn.value("sub i32 %dcap, %pos"), fn.value("sub i32 %scap, %start")
    left = _least(fn, target_left, source_left)
    count = _least(fn, "%want", left)
    room = fn.value(f"add i32 {left}, 1")
    target = strings.at(fn, "%d", strings.index(fn, "%pos"))
    source = strings.at(fn, "%s", strings.index(fn, "%start"))

    def visit(index: Value) -> Value:
        chunk = strings.load_chunk(fn, strings.at(fn, source, index))
        strings.store_chunk(fn, chunk, strings.at(fn, target, index))
        return strings.marks(fn, chunk)

    start, whole = None, list[tuple[Value, str]]()
    if strings.chunk and strings.target.vectors:
        start = _copy_vectors(fn, strings, room, count, source, target)
    elif strings.chunk:
        start, length = _walk_chunks(fn, strings, room, count, visit)
        whole = [(length, "full")]
        fn.branch("done")
    else:
        fn.branch("loop")
    i, index, character = _walk_characters(fn, strings, source, count, start)
    strings.store(fn, character, strings.at(fn, target, index))
    _next_character(fn, i)
    fn.begin_detached("done")
    copied = fn.phi("i32", *whole, (i, "loop"), (i, "test"))
    strings.store(fn, _ZERO, strings.at(fn, target, strings.index(fn, copied)))
    fn.terminate(f"ret i32 {fn.value(f'add i32 %pos, {copied}')}")


def _copy_vectors(fn: Function, strings: _Strings, room: Value, count: Value, source: Value, target: Value) -> Value:
    """From the entry on, over the vectors within `room` characters. The last one is stored with zeros from the end on:
    a NUL that is stored by itself would make the next load of the vector wait for both to be in the cache.

    Returns from the function when the end is in a vector; leads to the block `loop` from `short`, with the result as
    the index to go on at.
    """
    inner = fn.value(f"call i32 @llvm.usub.sat.i32(i32 {room}, i32 {strings.chunk - 1})")
    bound = _least(fn, inner, count)
    fn.branch_if(fn.value(f"icmp eq i32 {bound}, 0"), "loop", "chunk")
    fn.begin_detached("chunk")
    at = fn.phi("i32", (_ZERO, "entry"))
    index = strings.index(fn, at)
    chunk = strings.load_chunk(fn, strings.at(fn, source, index))
    place = strings.at(fn, target, index)
    # The end is at the first NUL, or where `count` is.
    marks = fn.value(f"zext i{strings.chunk} {strings.marks(fn, chunk)} to i32")
    limit = fn.value(f"shl i32 1, {_least(fn, fn.value(f'sub i32 {count}, {at}'), '31')}")
    ends = fn.value(f"or i32 {marks}, {limit}")
    here = fn.value(f"and i32 {ends}, {(2 << strings.chunk) - 1}")
    fn.branch_if(fn.value(f"icmp ne i32 {here}, 0"), "found", "clear")
    fn.begin_detached("clear")
    strings.store_chunk(fn, chunk, place)
    after = fn.value(f"add i32 {at}, {strings.chunk}")
    fn.add_incoming(at, after, "clear")
    fn.branch_if(fn.value(f"icmp ult i32 {after}, {bound}"), "chunk", "short")
    fn.begin_detached("short")
    fn.branch("loop")
    fn.begin_detached("found")
    length = fn.value(f"call i32 @llvm.cttz.i32(i32 {here}, i1 true)")
    strings.store_chunk(fn, strings.cut(fn, chunk, length), place)
    end = fn.value(f"add i32 {at}, {length}")
    fn.branch_if(fn.value(f"icmp eq i32 {length}, {strings.chunk}"), "after", "ended")
    fn.begin_detached("after")
    strings.store(fn, _ZERO, strings.at(fn, target, strings.index(fn, end)))
    fn.branch("ended")
    fn.begin_detached("ended")
    fn.terminate(f"ret i32 {fn.value(f'add i32 %pos, {end}')}")
    return after


def _move(fn: Function, strings: _Strings) -> None:
    """COPY__ of characters that are known to be there: `want` from `start` on, none of them a NUL."""
    target_left = fn.value("sub i32 %dcap, %pos")
    count = _least(fn, "%want", target_left)
    target = strings.at(fn, "%d", strings.index(fn, "%pos"))
    source = strings.at(fn, "%s", strings.index(fn, "%start"))
    start = _move_chunks(fn, strings, target_left, count, source, target) if strings.chunk else None
    if start is None:
        fn.branch("loop")
    fn.begin_detached("loop")
    i = fn.phi("i32", (_ZERO, "entry"), *([] if start is None else [(start, "short")]))
    fn.branch_if(fn.value(f"icmp ult i32 {i}, {count}"), "next", "done")
    fn.begin_detached("next")
    index = strings.index(fn, i)
    strings.store(fn, strings.load(fn, strings.at(fn, source, index)), strings.at(fn, target, index))
    _next_character(fn, i)
    fn.begin_detached("done")
    strings.store(fn, _ZERO, strings.at(fn, target, strings.index(fn, count)))
    fn.terminate(f"ret i32 {fn.value(f'add i32 %pos, {count}')}")


def _move_chunks(
    fn: Function, strings: _Strings, target_left: Value, count: Value, source: Value, target: Value
) -> Value:
    """From the entry on, over the chunks that both strings have room for. A vector with the end is stored with zeros
    from there on, as in `_copy_vectors`.

    Returns from the function after that; leads to the block `loop` from `short`, with the result as the index to go on
    at.
    """
    left = _least(fn, target_left, fn.value("sub i32 %scap, %start"))
    inner = fn.value(f"call i32 @llvm.usub.sat.i32(i32 {left}, i32 {strings.chunk - 2})")
    bound = _least(fn, inner, count)
    fn.branch_if(fn.value(f"icmp eq i32 {bound}, 0"), "loop", "chunk")
    fn.begin_detached("chunk")
    at = fn.phi("i32", (_ZERO, "entry"))
    after = fn.value(f"add i32 {at}, {strings.chunk}")
    index = strings.index(fn, at)
    chunk = strings.load_chunk(fn, strings.at(fn, source, index))
    if strings.target.vectors:
        fn.branch_if(fn.value(f"icmp ult i32 {count}, {after}"), "last", "clear")
        fn.begin_detached("last")
        length = fn.value(f"sub i32 {count}, {at}")
        strings.store_chunk(fn, strings.cut(fn, chunk, length), strings.at(fn, target, index))
        fn.terminate(f"ret i32 {fn.value(f'add i32 %pos, {count}')}")
        fn.begin_detached("clear")
    strings.store_chunk(fn, chunk, strings.at(fn, target, index))
    fn.add_incoming(at, after, fn.block)
    fn.branch_if(fn.value(f"icmp ult i32 {after}, {bound}"), "chunk", "short")
    fn.begin_detached("short")
    fn.branch("loop")
    return after


def _splice(fn: Function, strings: _Strings) -> None:
    """Puts `len` characters of another string into one at `pos`, and after them `count` of its own from `start` on. In
    %tail, which has room for them, they wait; a few of them in a vector, where there is room for one."""
    move = "@str.wmove" if strings.wide else "@str.move"

    def moved(target: str, pos: str | Value, source: str, cap: str, start: str, want: str) -> Value:
        target, source = f"ptr {target}, i32 %dcap, i32 {pos}", f"ptr {source}, i32 {cap}, i32 {start}"
        return fn.value(f"call i32 {move}(ptr null, {target}, {source}, i32 {want})")

    if strings.chunk and strings.target.vectors:
        inner = fn.value(f"call i32 @llvm.usub.sat.i32(i32 %dcap, i32 {strings.chunk - 2})")
        put = fn.value("add i32 %pos, %len")
        few = fn.value(f"icmp ult i32 %count, {strings.chunk}")
        room = fn.value(f"icmp ult i32 {fn.value(f'call i32 @llvm.umax.i32(i32 %start, i32 {put})')}, {inner}")
        fn.branch_if(fn.value(f"and i1 {few}, {room}"), "few", "many")
        fn.begin_detached("few")
        tail = strings.load_chunk(fn, strings.at(fn, "%d", strings.index(fn, Value("%start"))))
        end = moved("%d", "%pos", "%s", "%scap", "0", "%len")
        strings.store_chunk(fn, strings.cut(fn, tail, Value("%count")), strings.at(fn, "%d", strings.index(fn, end)))
        fn.terminate(f"ret i32 {fn.value(f'add i32 {end}, %count')}")
        fn.begin_detached("many")
    moved("%tail", "0", "%d", "%dcap", "%start", "%count")
    end = moved("%d", "%pos", "%s", "%scap", "0", "%len")
    fn.terminate(f"ret i32 {moved('%d', end, '%tail', '%dcap', '0', '%count')}")


# ---- comparing ----


def _compare_chunks(fn: Function, strings: _Strings, room: Value) -> Value:
    """From the entry on, over the chunks within `room` characters that are the same and have no NUL.

    Leads to the block `loop` from `wide` and `chunk`, with the result as the index to go on at.
    """
    chunks = fn.value(f"and i32 {room}, -{strings.chunk}")
    fn.begin("wide")
    at = fn.phi("i32", (_ZERO, "entry"))
    fn.add_incoming(at, fn.value(f"add i32 {at}, {strings.chunk}"), "skip")
    fn.branch_if(fn.value(f"icmp eq i32 {at}, {chunks}"), "loop", "chunk")
    fn.begin_detached("skip")
    fn.branch("wide")
    fn.begin_detached("chunk")
    index = strings.index(fn, at)
    one, other = (strings.load_chunk(fn, strings.at(fn, base, index)) for base in ("%a", "%b"))
    marks = strings.marks(fn, one)
    unlike = strings.unlike(fn, one, other)
    ends = strings.has_mark(fn, marks)
    fn.branch_if(fn.value(f"or i1 {ends}, {unlike}"), "loop", "skip")
    return at


def _character_or_end(fn: Function, strings: _Strings, base: str, i: Value, index: Value, before: str) -> Value:
    """A character of `base` (%a or %b), 0 past its capacity. `before`: the block that this goes on in."""
    name = base.removeprefix("%")
    fn.branch_if(fn.value(f"icmp ult i32 {i}, {base}cap"), f"{name}.load", f"{name}.done")
    fn.begin_detached(f"{name}.load")
    character = strings.load(fn, strings.at(fn, base, index))
    fn.begin(f"{name}.done")
    return fn.phi(strings.character, (_ZERO, before), (character, f"{name}.load"))


def _compare(fn: Function, strings: _Strings) -> None:
    """Less than, equal to or greater than 0 as the first string is less than, equal to or greater than the second."""
    limit = _least(fn, "%acap", "%bcap")
    room = fn.value(f"add i32 {limit}, 1")
    if strings.chunk:
        at = _compare_chunks(fn, strings, room)
        starts = [(at, "wide"), (at, "chunk")]
    else:
        fn.branch("loop")
        starts = [(_ZERO, "entry")]
    fn.begin_detached("loop")
    i = fn.phi("i32", *starts)
    index = strings.index(fn, i)
    one = _character_or_end(fn, strings, "%a", i, index, "loop")
    other = _character_or_end(fn, strings, "%b", i, index, "a.done")
    same = fn.value(f"icmp eq {strings.character} {one}, {other}")
    live = fn.value(f"icmp ne {strings.character} {one}, 0")
    fn.branch_if(fn.value(f"and i1 {same}, {live}"), "next", "done")
    fn.begin_detached("next")
    _next_character(fn, i)
    fn.begin_detached("done")
    left, right = (fn.value(f"zext {strings.character} {c} to i32") for c in (one, other))
    fn.terminate(f"ret i32 {fn.value(f'sub i32 {left}, {right}')}")


_BODIES = {
    "str.span": _span, "str.seek": _seek, "str.copy": _copy, "str.move": _move, "str.splice": _splice,
    "str.compare": _compare,
}  # fmt: skip
_PARAMETERS = {
    "str.span": "ptr %ctx, ptr %s, i32 %cap, i32 %start, i32 %want",
    "str.seek": "ptr %ctx, ptr %s, i32 %cap, i32 %start, {character} %c, {character} %d",
    "str.copy": "ptr %ctx, ptr %d, i32 %dcap, i32 %pos, ptr %s, i32 %scap, i32 %start, i32 %want",
    "str.move": "ptr %ctx, ptr %d, i32 %dcap, i32 %pos, ptr %s, i32 %scap, i32 %start, i32 %want",
    "str.splice": "ptr %ctx, ptr %d, i32 %dcap, i32 %pos, ptr %s, i32 %scap, i32 %len, i32 %start, i32 %count, "
    "ptr %tail",
    "str.compare": "ptr %a, i32 %acap, ptr %b, i32 %bcap",
}
