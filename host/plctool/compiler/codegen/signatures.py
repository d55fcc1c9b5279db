"""Parameters of compiled functions: the context, the instance, room for a result in memory, then what the program
declares; of a function block its first input comes first.

A function block finds its inputs in its instance. Those that every call of the block gives, it is passed as parameters,
as far as there are registers for them, and stores them itself: that is smaller and faster than to store them before
each call and to load them in the block. Inputs that are not kept in memory are passed in any case. The first output of
a closed block (`closed.py`) comes back as its result, beside its value in the instance: most are used right after the
call.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TypeVar

from plctool.compiler.codegen.closed import Closed, closed_block
from plctool.compiler.codegen.ir import FixedPointer, Value
from plctool.compiler.codegen.lengths import length_variable
from plctool.compiler.codegen.lower_arith import is_real, is_signed
from plctool.compiler.codegen.lower_frame import RAISED
from plctool.compiler.codegen.lower_unit import Form, Options, value_type
from plctool.compiler.codegen.transient import TransientVariables, transient_variables
from plctool.compiler.typed.nodes import Call, FbCall, Parameter, Pou, PouKind, Storage, TypedProgram, Variable
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import StringType, Type, is_scalar
from plctool.image.targets import Target
from plctool.records import dataclass

CONTEXT = "ptr %ctx"  # the argument that hands the context on
_CONTEXT_IS = "noalias nonnull readonly"
CONTEXT_PARAMETER = f"ptr {_CONTEXT_IS} %ctx"
SELF = FixedPointer("%self")  # the instance
RESULT = FixedPointer("%result")  # where a result goes that comes back in memory
RESULT_CAPACITY = Value("%result.capacity")

Passed = TypeVar("Passed")
HandedInputs = dict[Pou, list[Variable]]
ClosedBlocks = dict[Pou, Closed]


def parameter_value(number: int) -> Value:
    """Parameter `number` of those that the program declares."""
    return FixedPointer(f"%p{number}")


def parameter_capacity(number: int) -> Value:
    """The capacity that comes with it when it is a string."""
    return Value(f"%p{number}.capacity")


def parameter_length(number: int) -> Value:
    """Its length, in the form of a function that is given lengths."""
    return Value(f"%p{number}.length")


def parameter_types(pou: Pou, parameter: Parameter, form: Form) -> list[str]:
    """The LLVM parameters that carry one IEC parameter."""
    t = parameter.variable.type
    if isinstance(t, StringType):
        return ["ptr", "i32", "i32"] if form is Form.MEASURED else ["ptr", "i32"]
    if parameter.by_reference or not is_scalar(t):
        return ["ptr"]
    return [passed_type(t)]


def passed_type(t: Type) -> str:
    """The LLVM type of a parameter; of a structure its address is passed. What is short fills its register: constants
    and what is loaded do so anyway."""
    return f"{value_type(t)} {extension(t)}".rstrip() if is_scalar(t) else "ptr"


def extension(t: Type) -> str:
    """How a scalar parameter or result fills its register, as an attribute; "" for none."""
    if value_type(t) in ("i8", "i16"):
        return "signext" if is_signed(t) else "zeroext"
    return ""


def result_in_memory(pou: Pou) -> bool:
    """Whether the result comes back through a hidden pointer, the first argument after the context."""
    return pou.result is not None and not is_scalar(pou.result.type)


@dataclass(frozen=True)
class Formal:
    """A parameter of a compiled function: its LLVM type, what is promised of it, and the value it has inside."""

    type: str
    value: Value
    attributes: str = ""

    @property
    def definition(self) -> str:
        """As it stands in the define line."""
        return " ".join(filter(None, (self.type, self.attributes, str(self.value))))

    @property
    def argument(self) -> str:
        """As an argument that hands it on."""
        return f"{self.type} {self.value}"


def formals(pou: Pou, handed: HandedInputs, form: Form, closed: Closed | None = None) -> list[Formal]:
    """The parameters of the function of a unit."""
    found = []
    if closed is None or closed.has_context:
        found.append(Formal("ptr", Value("%ctx"), _CONTEXT_IS))
    if form is Form.RAISING:
        found.append(Formal("ptr", RAISED, "noalias nonnull"))
    if pou.kind in (PouKind.FUNCTION_BLOCK, PouKind.METHOD):
        found.append(Formal("ptr", SELF, "nonnull"))
    if result_in_memory(pou):
        found.append(Formal("ptr", RESULT, "nonnull" if pou.in_place else "noalias nonnull"))
        found += [Formal("i32", RESULT_CAPACITY)] if pou.cuts_result else []
    if pou.kind in (PouKind.FUNCTION, PouKind.METHOD):
        for number, parameter in enumerate(pou.parameters):
            values = (parameter_value(number), parameter_capacity(number), parameter_length(number))
            types = parameter_types(pou, parameter, form)
            found += [Formal(text, value) for text, value in zip(types, values, strict=False)]
    inputs = [Formal(passed_type(v.type), parameter_value(n)) for n, v in enumerate(handed.get(pou, ()))]
    return in_order(inputs, found)


def in_order(inputs: list[Passed], others: list[Passed]) -> list[Passed]:
    """What a function block is passed. The first input is in the register in which results come: most often it is the
    output of another block."""
    return [*inputs[:1], *others, *inputs[1:]]


def parameter_list(pou: Pou, handed: HandedInputs, form: Form, closed: Closed | None = None) -> str:
    """The parameters of the define line."""
    return ", ".join(formal.definition for formal in formals(pou, handed, form, closed))


@dataclass(frozen=True)
class Signatures:
    """What is special about function blocks. `handed`: the inputs that they are passed as parameters; `transient`:
    their variables that are not kept in memory; `closed`: those that are closed."""

    handed: HandedInputs
    transient: TransientVariables
    closed: ClosedBlocks


def block_signatures(program: TypedProgram, options: Options) -> Signatures:
    """Of all function blocks that the program reaches."""
    target, passes = options.target, options.passes
    given, calls, reached = _inputs_of_all_calls(program)
    kept_all = options.watchable or not passes.runs("transient")
    transient = {} if kept_all else transient_variables(program, reached, given)
    tried = {block: closed_block(block, target, calls[block]) for block, inputs in given.items() if inputs}
    closed = {block: found for block, found in tried.items() if found is not None and passes.runs("closed")}
    handed = {}
    for block, inputs in given.items():
        unkept = [variable for variable in transient.get(block, ()) if variable in inputs]
        kept = [variable for variable in inputs if variable not in unkept]
        handed[block] = unkept
        if passes.runs("registers"):
            handed[block] += _in_registers(kept, target, closed.get(block), len(unkept))
    found = Signatures({block: inputs for block, inputs in handed.items() if inputs}, transient, closed)
    passes.left(("transient",), lambda: _listed(found.transient))
    passes.left(("closed",), lambda: _closed_listed(found.closed))
    passes.left(("registers",), lambda: _listed(found.handed))
    return found


def _listed(variables: Mapping[Pou, Sequence[Variable]]) -> str:
    """A line for each block: its name, and these variables of it."""
    return "\n".join(f"{block.name}: {', '.join(v.name for v in found)}" for block, found in variables.items() if found)


def _closed_listed(closed: ClosedBlocks) -> str:
    lines = []
    for block, found in closed.items():
        returned = "nothing" if found.returned is None else found.returned.name
        lines.append(f"{block.name}: returns {returned}{', gets the context' if found.has_context else ''}")
    return "\n".join(lines)


def _inputs_of_all_calls(program: TypedProgram) -> tuple[HandedInputs, Counter[Pou], list[Pou]]:
    """For each function block the inputs that every call gives, none for those that only the class decides about; how
    many calls there are; and all units."""
    extra = (pou for pou in (program.startup, program.startup_of_new, program.shutdown) if pou is not None)
    reached = dict.fromkeys([*program.pous, *program.programs.values(), *extra])  # and perhaps some that never run
    given: HandedInputs = {}
    calls: Counter[Pou] = Counter()
    todo = list(reached)
    while todo:
        for call in walk(todo.pop().body):
            if isinstance(call, Call | FbCall):
                others = list(call.dispatch.targets.values()) if call.dispatch is not None else []
                called = [call.function if isinstance(call, Call) else call.block, *others]
                todo += [pou for pou in called if pou not in reached]
                reached.update(dict.fromkeys(called))
                if isinstance(call, FbCall):
                    calls[call.block] += 1
                    _restrict(given, call, others)
    return given, calls, list(reached)


def returned_variable(pou: Pou, closed: Closed | None) -> Variable | None:
    """The variable whose value the function of a unit returns."""
    if pou.result is not None and is_scalar(pou.result.type):
        return pou.result
    return length_variable(pou) or (closed.returned if closed is not None else None)


def returned_type(variable: Variable | None) -> str:
    """What the function returns, as it stands in its define line and in calls of it."""
    return "void" if variable is None else f"{extension(variable.type)} {value_type(variable.type)}".lstrip()


def _restrict(given: HandedInputs, call: FbCall, others: list[Pou]) -> None:
    """Takes out what a call of a block does not give. The blocks of which only the class decides which is called have
    one signature."""
    if call.dispatch is not None or call.block.external:
        given.update((block, []) for block in (call.block, *others))
    else:
        here = [variable for variable, _ in call.inputs]
        given[call.block] = [variable for variable in given.get(call.block, here) if variable in here]


def _in_registers(inputs: list[Variable], target: Target, closed: Closed | None, taken: int) -> list[Variable]:
    """The first inputs, as many as fit; the context, if it is passed, and the instance take registers for integers.
    `taken`: registers, of either kind."""
    found = []
    integers, reals = target.registers
    left = {False: integers - taken - (2 if closed is None or closed.has_context else 1), True: reals - taken}
    for variable in sorted(inputs, key=lambda v: v.offset):
        t, in_memory = variable.type, variable.storage is Storage.SELF
        if in_memory and is_scalar(t) and t.size <= target.pointer_size:
            kind = reals > 0 and is_real(t)
            if left[kind] > 0:
                left[kind] -= 1
                found.append(variable)
    return found
