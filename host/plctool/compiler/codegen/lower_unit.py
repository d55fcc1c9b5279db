"""What all functions of one compilation share: the module, the imports, the queue of what has to be lowered.

A function enters the queue the first time something refers to it, so what is not called is not in the image.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

from plctool.compiler.codegen.closed import Closed
from plctool.compiler.codegen.ir import Module, escape
from plctool.compiler.codegen.passes import Passes
from plctool.compiler.codegen.string_functions import LIBRARY_FUNCTIONS
from plctool.compiler.codegen.trail import Trail
from plctool.compiler.typed.nodes import Dispatch, External, Pos, Pou, PouKind, StructInit, Variable, runtime_function
from plctool.core import ffi, lib
from plctool.debug.bounds import BoundsCheck
from plctool.errors import UsageError
from plctool.iec.areas import Area
from plctool.iec.types import Elementary, Kind, PointerType, StructType, Type, base_of
from plctool.image.targets import FASTEST, Target

if TYPE_CHECKING:
    from plctool.compiler.codegen.firmware_stacks import FirmwareStacks
    from plctool.compiler.codegen.object_cache import ObjectCache

_ALWAYS = 'nounwind "no-builtins"'
_PROBES = ' "probe-stack"="inline-asm"'
_LARGE_FRAME, _LARGE_FRAME_OF_CONTROLLER = 4096, 256  # bytes of local variables
_INLINED = 225  # LLVM's measure of what it inlines when it does not have to save room
_INLINED_FOR_SPEED = 450  # where room is of no concern


class Check(Enum):
    """Run-time checks, by the name `--checks` uses."""

    DIV = "div"
    BOUNDS = "bounds"
    SUBRANGE = "subrange"
    NULL = "null"


ALL_CHECKS = frozenset(Check)


def parse_checks(text: str) -> frozenset[Check]:
    """'all', 'none' or a comma separated list such as 'div,bounds'. Raises UsageError."""
    if text == "all":
        return ALL_CHECKS
    if text == "none":
        return frozenset()
    try:
        return frozenset(Check(name.strip()) for name in text.split(","))
    except ValueError:
        names = ", ".join(c.value for c in Check)
        raise UsageError(f"'{text}' is not a choice of checks; use all, none or a list of {names}.", "checks") from None


@dataclass(frozen=True)
class Options:
    """How to compile. `debug`: keep the program closer to its source (no inlining across POUs); `size`: rather small
    than fast; `firmware`: what is known of the C functions that it will call; `passes`: which of them run; `cache`:
    where objects are kept; `device_id`: what the image is for, 0 for any device with this processor."""

    target: Target
    opt_level: int = 2
    checks: frozenset[Check] = ALL_CHECKS
    debug: bool = False
    size: bool = False
    firmware: FirmwareStacks | None = None
    passes: Passes = field(default_factory=Passes)
    cache: ObjectCache | None = field(default=None, compare=False)
    device_id: int = 0

    @property
    def steps(self) -> bool:
        """Whether a debugger can step from statement to statement, and see the variables on the stack."""
        return self.debug and self.opt_level == 0

    @property
    def watchable(self) -> bool:
        """Whether blocks keep in memory what no call needs from the previous one, so that it can be watched."""
        return self.debug or not (self.size or self.opt_level >= FASTEST)

    @property
    def compact(self) -> bool:
        """Whether blocks of the library are not inlined, unless they are as small as a call: where memory is small and
        level 3 does not ask for it."""
        return self.size or self.target.saves_room(self.opt_level)


class Form(Enum):
    """How a compiled function is called."""

    PLAIN = 0
    RAISING = 1  # it returns its exceptions
    MEASURED = 2  # a function of the library that is given the lengths of its strings
    RUN = 3  # a program with what its CONFIGURATION assigns before and after it, as its task runs it


def import_symbol(name: str) -> str:
    """The symbol by which the linker knows a C function."""
    return f"import.{name}"


RAISE = runtime_function("iecraise")


STUBS_REACH = 40  # slots; on Cortex-M0 there are 64, some of which are for compiler calls

REALS = ("float", "double")  # LLVM types


def value_type(t: Type) -> str:
    """The LLVM type of a scalar. A BOOL is an i8 that is 0 or 1: it goes to and from memory as it is."""
    base = base_of(t)
    if isinstance(base, PointerType):
        return "ptr"
    assert isinstance(base, Elementary), t
    if base.kind is Kind.REAL:
        return "float" if base.bits == 32 else "double"
    return f"i{base.bits}"


def function_attributes(target: Target) -> str:
    """The attributes that every function has."""
    return _ALWAYS + (_PROBES if target.probes else "")


class Unit:
    """One compilation."""

    def __init__(self, options: Options, area_sizes: dict[Area, int], defaults: dict[str, StructInit]) -> None:
        self.options = options
        self.target = options.target
        self.remembers = options.opt_level > 0 and options.passes.runs("memory")
        self.measures = options.passes.runs("lengths")
        self.module = Module(options.target.triple)
        self.area_sizes = area_sizes
        self.defaults = defaults
        self.imports: list[External] = []
        self.exchanges = False  # tasks exclude each other by Intrinsic.EXCHANGE
        self.sections: set[Pou] = set()  # parts of POUs
        self.handed: dict[Pou, list[Variable]] = {}  # inputs that function blocks get as parameters
        self.transient: dict[Pou, list[Variable]] = {}  # variables of function blocks that are not kept in memory
        self.closed: dict[Pou, Closed] = {}  # the blocks that are closed
        self.runs: dict[Pou, list[Pou]] = {}  # the programs that a CONFIGURATION connects, each with what that takes
        self.pous: dict[tuple[Pou, Form], str] = {}  # the symbol of every form of a POU
        self.structs: dict[str, StructType] = {}  # types whose default initialiser is needed, by symbol
        self.helpers: set[str] = set()
        self.dispatchers: dict[tuple[Dispatch, Form], str] = {}  # symbols of what chooses among targets
        self.files: dict[str, int] = {}
        self.bounds: list[BoundsCheck] = []  # that are in the code
        self.trail_variable: Variable | None = None  # where the way of an exception is left
        self.trail = Trail()
        self._import_slots: dict[str, int] = {}
        self._symbols: set[str] = set()
        self._locations: dict[tuple[int, str, int], str] = {}
        self._source_lines: dict[str, tuple[str, int]] = {}
        self._scopes: dict[tuple[int, str], int] = {}  # the parts of functions that come from a file
        self._struct_symbols: dict[StructType, str] = {}
        self._subroutine_type = -1
        self._compile_unit = -1
        module = self.module
        self.empty = module.metadata("!{}")
        tree = module.metadata('!{!"st"}')
        self._tag_root = module.metadata(f'!{{!"any", !{tree}, i64 0}}')
        self._tags: dict[object, tuple[str, int]] = {}
        # An access through NULL that is not checked is left to the processor, which faults.
        base = function_attributes(self.target)
        always = base if Check.NULL in options.checks else f"{base} null_pointer_is_valid"
        self.plain = module.attributes(f"{'optsize ' if options.compact else ''}{always}")
        self.strings = module.attributes(f"{'optsize ' if options.size else ''}{base}")
        self._program = self.plain
        if options.compact and not options.size:
            self._program = module.attributes(f'optsize {always} "function-inline-threshold"="{_INLINED}"')
        elif options.opt_level >= FASTEST and not options.target.small_flash:
            self._program = module.attributes(f'{always} "function-inline-threshold"="{_INLINED_FOR_SPEED}"')
        # LLVM's fast instruction selection (level 0) takes a call that only reads memory for dead.
        reads = " memory(read)" if options.opt_level > 0 else ""
        self.raising = module.attributes(f"cold noreturn nounwind nomerge{reads}")
        self.external_call = module.attributes("nounwind")

    def attributes(self, pou: Pou) -> str:
        """The attributes of a POU's function. Those of the string functions are worth more room, they are all loops."""
        if pou.no_init:
            return self.strings
        return self._program if pou.checks else self.plain

    def inlining(self, pou: Pou, form: Form) -> str:
        """The attributes for LLVM about inlining a POU: the standard library is made for it, if there is room. A task
        has no lines, so it takes in nothing."""
        is_called_by_task = pou.kind is PouKind.PROGRAM and not self._is_within_run(pou, form)
        if is_called_by_task or self.options.debug or pou in self.sections:
            return "noinline"
        if self.options.size and pou in self.closed and self.closed[pou].calls > 1:
            return "noinline"  # with its inputs and outputs in registers a call is smaller than any body
        large = _LARGE_FRAME_OF_CONTROLLER if self.options.compact else _LARGE_FRAME
        if sum(variable.type.size for variable in pou.locals) > large:
            return "noinline"  # or its caller would need that room, and probe it, also when it does not call
        return "inlinehint" if not pou.checks and (pou.no_init or not self.options.compact) else ""

    def _is_within_run(self, pou: Pou, form: Form) -> bool:
        return pou.connects is not None or (pou in self.runs and form is not Form.RUN)

    # ---- what is referred to ----

    def symbol(self, pou: Pou, form: Form = Form.PLAIN) -> str:
        """The symbol of a POU in this form; puts it in the queue."""
        if pou.no_init and pou.name in LIBRARY_FUNCTIONS:
            return self.helper(LIBRARY_FUNCTIONS[pou.name])
        name = self.pous.get((pou, form))
        if name is None:
            name = self.unique(f"st.{pou.name}")
            self.pous[pou, form] = name
        return name

    def section(self, part: Pou, form: Form) -> str:
        """The symbol of a part of a POU."""
        self.sections.add(part)
        return self.symbol(part, form)

    def target_of(self, pou: Pou, dispatch: Dispatch | None, form: Form) -> str:
        """The symbol that a call of `pou` goes to: of a function that looks at the class when that decides."""
        if dispatch is None:
            return self.symbol(pou, form)
        targets = set(dispatch.targets.values())
        if len(targets) == 1:
            return self.symbol(targets.pop(), form)
        name = self.dispatchers.get((dispatch, form))
        if name is None:
            name = self.unique(f"class.{pou.name}")
            self.dispatchers[dispatch, form] = name
        return name

    def unique(self, wanted: str) -> str:
        """A symbol name not used so far, safe to write without quotes."""
        clean = "".join(c if c.isascii() and (c.isalnum() or c in "._") else "_" for c in wanted)
        name, n = clean, 1
        while name in self._symbols:
            n += 1
            name = f"{clean}.{n}"
        self._symbols.add(name)
        return name

    def initialiser(self, struct: StructType) -> str:
        """The symbol of the function that gives a struct or FB in zeroed memory its defaults; puts it in the queue."""
        name = self._struct_symbols.get(struct)
        if name is None:
            name = self.unique(f"init.{struct.name}")
            self._struct_symbols[struct] = name
            self.structs[name] = struct
        return name

    def import_slot(self, external: External) -> int:
        """The index of an external function in the import table."""
        slot = self._import_slots.get(external.name)
        if slot is None:
            slot = len(self.imports)
            self._import_slots[external.name] = slot
            self.imports.append(external)
        if self.imports[slot] != external:
            raise UsageError(
                f"The C function {external.name} of the program has other parameters or another version than that of "
                "the library, which is called too; give yours another name.",
                "external",
            )
        return slot

    @property
    def external_convention(self) -> str:
        """What a call or declaration of a C function begins with."""
        convention = self.target.external_convention
        return f"{convention} " if convention else ""

    def imported(self, external: External, result: str, arguments: list[str]) -> str | None:
        """The symbol of a C function, where the linker makes a stub for it; None where its address has to be loaded,
        also of those that a stub does not reach on each processor when compiler calls come after them."""
        if not self.target.stubs or self.import_slot(external) >= STUBS_REACH:
            return None
        symbol = import_symbol(external.name)
        types = ", ".join(argument.split()[0] for argument in arguments)
        self.module.declare(symbol, f"declare {self.external_convention}{result} @{symbol}({types})")
        return f"@{symbol}"

    def helper(self, name: str) -> str:
        """The symbol of a function of `string_functions`, which is then put in the module."""
        self.helpers.add(name)
        return name

    # ---- context layout ----

    @property
    def area_offset(self) -> int:
        return int(ffi.offsetof("IEC_CONTEXT", "area"))

    @property
    def imports_offset(self) -> int:
        return self.area_offset + int(lib.APP_AREA_COUNT) * self.target.pointer_size

    # ---- metadata ----

    def tag(self, key: object) -> str:
        """Alias tag: accesses with different tags do not overlap; those without a tag may overlap all."""
        return self._tag(key, self._tag_root)[0]

    def members_tag(self, struct: StructType) -> str:
        """The alias tag of what accesses any members of a struct or FB."""
        return self._tag(struct.root.name, self._tag_root)[0]

    def member_tag(self, struct: StructType, offset: int) -> str:
        """The alias tag of one of them."""
        return self._tag((struct.root.name, offset), self._tag(struct.root.name, self._tag_root)[1])[0]

    def _tag(self, key: object, parent: int) -> tuple[str, int]:
        """A tag and its node. Accesses with a tag and with one of its parents may overlap."""
        known = self._tags.get(key)
        if known is None:
            name = escape(str(key).encode())
            node = self.module.metadata(f'!{{!"{name}", !{parent}, i64 0}}')
            known = f", !tbaa !{self.module.metadata(f'!{{!{node}, !{node}, i64 0}}')}", node
            self._tags[key] = known
        return known

    def file(self, path: str) -> int:
        """The DIFile of a source file."""
        node = self.files.get(path)
        if node is None:
            node = self.module.metadata(f'!DIFile(filename: "{escape(path.encode())}", directory: "")')
            self.files[path] = node
        return node

    def subprogram(self, name: str, pos: Pos) -> int:
        """Debug scope of a function."""
        module = self.module
        file = self.file(pos.file)
        if self._compile_unit < 0:
            self._subroutine_type = module.metadata(f"!DISubroutineType(types: !{self.empty})")
            self._compile_unit = module.add_compile_unit(file, variables=self.options.steps)
        scope = module.distinct_metadata(
            f'!DISubprogram(name: "{name}", scope: !{file}, file: !{file}, line: {pos.line}, scopeLine: {pos.line}, '
            f"type: !{self._subroutine_type}, spFlags: DISPFlagDefinition, unit: !{self._compile_unit})"
        )
        self._scopes[scope, pos.file] = scope
        return scope

    def forget_subprogram(self, scope: int) -> None:
        """Forgets the debug scope of a function that is written again."""
        self.module.forget_metadata(scope)
        self._scopes = {key: inner for key, inner in self._scopes.items() if key[0] != scope}
        self._locations = {key: text for key, text in self._locations.items() if key[2] != scope}

    def stack_variable(self, name: str, pos: Pos, scope: int) -> int:
        """The DILocalVariable of a name. Its type is in the symbol file."""
        metadata = self.module.metadata
        t = metadata('!DIBasicType(name: "iec", size: 8, encoding: DW_ATE_unsigned_char)')
        return metadata(
            f'!DILocalVariable(name: "{name}", scope: !{scope}, file: !{self.file(pos.file)}, line: {pos.line}, '
            f"type: !{t})"
        )

    def location(self, pos: Pos, scope: int) -> str:
        """The `, !dbg` suffix for instructions of a line, in the function with that scope."""
        key = (pos.line, pos.file, scope)
        text = self._locations.get(key)
        if text is None:
            inner = self._scope_in(pos.file, scope)
            text = f", !dbg !{self.module.metadata(f'!DILocation(line: {pos.line}, scope: !{inner})')}"
            self._locations[key] = text
            self._source_lines[text] = (pos.file, pos.line)
        return text

    def source_line(self, location: str) -> tuple[str, int] | None:
        """File and line of a `, !dbg` suffix; None for none, or the line 0."""
        found = self._source_lines.get(location)
        return found if found and found[1] else None

    def _scope_in(self, file: str, scope: int) -> int:
        """The part of a scope that comes from another file than the function: initial values come from everywhere."""
        inner = self._scopes.get((scope, file))
        if inner is None:
            text = f"!DILexicalBlockFile(scope: !{scope}, file: !{self.file(file)}, discriminator: 0)"
            inner = self._scopes[scope, file] = self.module.metadata(text)
        return inner
