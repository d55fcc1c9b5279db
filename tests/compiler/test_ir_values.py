"""Operands of the IR say what they are: an integer, a pointer that holds in the whole function. And a function of the
IR knows the functions it calls."""

from __future__ import annotations

from plctool.compiler.codegen.ir import Function, Value, number
from plctool.compiler.codegen.lower_arith import constant, resize
from plctool.compiler.codegen.lower_frame import Frame, Ref
from plctool.compiler.codegen.lower_unit import Options, Unit
from plctool.compiler.codegen.signatures import SELF
from plctool.iec.areas import Area
from plctool.iec.types import BOOL, DINT, INT, LREAL, REAL
from plctool.image.targets import find_target


def frame() -> Frame:
    unit = Unit(Options(find_target("x86_64-linux")), dict.fromkeys(Area, 100), {})
    return Frame(unit, Function("void @f(ptr %ctx, ptr %self)", ""), None)


def test_only_integers_are_constants_of_the_lowering() -> None:
    assert (constant(-5, INT).constant, constant(1, BOOL).constant) == (-5, 1)
    assert [constant(1.0, t).constant for t in (REAL, LREAL)] == [None, None]
    assert str(number(-5)) == "-5"


def test_a_constant_is_not_converted() -> None:
    f = frame()
    assert resize(f, number(-5), INT, 64) == number(-5)
    assert f.fn.size == 0
    assert resize(f, Value("%x"), INT, 64).constant is None
    assert "sext i16 %x to i64" in f.fn.definition("")


def test_offsets_from_memory_of_the_whole_function_stay_inside() -> None:
    f = frame()
    fixed = (SELF, f.fn.alloca(8, 4), f.fn.slot("i32"), f.area_base(Area.DATA))
    assert all(pointer.fixed for pointer in fixed)
    for pointer in fixed:
        f.address(Ref(pointer, 4, DINT))
    assert f.fn.definition("").count(f"getelementptr inbounds i8, ptr {SELF}, i64 4") == 1
    assert "getelementptr i8" not in f.fn.definition("")


def test_offsets_from_a_pointer_of_the_program_may_lead_anywhere() -> None:
    f = frame()
    pointer = f.fn.value("load ptr, ptr %self")
    f.address(Ref(pointer, 4, DINT))
    assert not pointer.fixed
    assert f"getelementptr i8, ptr {pointer}, i64 4" in f.fn.definition("")


def test_a_function_knows_every_function_it_calls() -> None:
    fn = Function("void @f(ptr %ctx)", "")
    fn.call("st.one", ["ptr %ctx"])
    result = fn.call_value("i32", "st.two", ["ptr %ctx", "i32 5"], tail=True)
    fn.call("st.one", [], " noinline")
    assert fn.callees == ["st.one", "st.two", "st.one"]
    text = fn.definition("")
    assert "call void @st.one() noinline" in text
    assert f"{result} = tail call i32 @st.two(ptr %ctx, i32 5)" in text
