"""Calls whose target depends on the class of the instance: one small function each, that looks at the class number and
goes on to the right method. Only direct calls result: LLVM can inline them, and the image needs no table of addresses.
"""

from __future__ import annotations

from plctool.compiler.codegen.ir import FALSE, Function
from plctool.compiler.codegen.lower_frame import ACCESS_VIOLATION, Frame
from plctool.compiler.codegen.lower_unit import Form, Unit, value_type
from plctool.compiler.codegen.signatures import SELF, formals, parameter_list, returned_type, returned_variable
from plctool.compiler.typed.nodes import Dispatch
from plctool.iec.types import CLASS_NUMBER


def write_dispatcher(unit: Unit, name: str, dispatch: Dispatch, form: Form) -> None:
    """The function `name`, which has the parameters of its targets. An instance of another class was reached through a
    wrong pointer."""
    pou = dispatch.function
    returned = returned_variable(pou, None)
    fn = Function(f"{returned_type(returned)} @{name}({parameter_list(pou, unit.handed, form)})", unit.plain)
    frame = Frame(unit, fn, None, form)
    frame.open_scope(pou.name, pou.pos)
    arguments = [formal.argument for formal in formals(pou, unit.handed, form)]
    by_symbol: dict[str, list[int]] = {}
    for number, target in dispatch.targets.items():
        by_symbol.setdefault(unit.symbol(target, form), []).append(number)
    loaded = fn.value(f"load i32, ptr {SELF}, align 4{unit.tag(CLASS_NUMBER)}")
    labels = {symbol: fn.label("class") for symbol in by_symbol}
    unknown = fn.label("unknown")
    cases = " ".join(f"i32 {n}, label %{labels[s]}" for s, numbers in by_symbol.items() for n in numbers)
    fn.terminate(f"switch i32 {loaded}, label %{unknown} [ {cases} ]")
    for symbol, label in labels.items():
        fn.begin_detached(label)
        if returned is None:
            fn.call(symbol, arguments, tail=True)
            fn.terminate("ret void")
        else:
            value = fn.call_value(returned_type(returned), symbol, arguments, tail=True)
            fn.terminate(f"ret {value_type(returned.type)} {value}")
    fn.begin_detached(unknown)
    frame.require(FALSE, ACCESS_VIOLATION, pou.pos)
    fn.terminate("unreachable")
    frame.write_raises()
    frame.write_given_up(returned)
    unit.module.add(name, fn)
