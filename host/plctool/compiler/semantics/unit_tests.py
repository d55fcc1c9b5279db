"""Unit tests in ST: TEST blocks become a program that runs one of them at a time.

The program is like any other; only its tasks are replaced by one, which finds the number of the test in a hidden
variable. All that the host has to do for a test is a cold start, writing the number, one cycle, and reading what came
out:

- The variables of a test live on the stack, those of SETUP in the data area, so all are fresh at every start. A PROGRAM
  is instantiated as a function block; a variable with an address (AT) is a plain member of it then.
- An assert that does not hold stores its number and both values in hidden variables and returns. TEARDOWN follows in
  any case; after a run-time exception, which ends the program, the host runs it by a number of its own.
- TIME() reads a hidden variable instead of the time of the cycle, and ADVANCE_TIME adds to it: so time goes on within
  one call, and optimisation knows of it.

The notation is that of OpenPLC's compiler STruC++: TEST, SETUP, TEARDOWN, ASSERT_..., ADVANCE_TIME, MOCK....

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from plctool.compiler.base.source import Source
from plctool.compiler.semantics.assertions import NUMBER, Assertion, Bench
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.configuration import Application, configure, default_programs
from plctool.compiler.semantics.conversions import load, whole
from plctool.compiler.semantics.declarations.type_declarations import May
from plctool.compiler.semantics.mocks import Mocks, raising
from plctool.compiler.semantics.participants import Files, Participant
from plctool.compiler.semantics.program import Program
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.statement_marks import StatementMarks
from plctool.compiler.semantics.symbols import ERROR, NOTHING, PouSymbol, Role, VarSymbol
from plctool.compiler.semantics.unit_test_devices import TestDevices, faults_of, host_function
from plctool.compiler.semantics.unit_test_forces import Forces
from plctool.compiler.semantics.unit_test_statements import TestBody
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    Assign,
    Call,
    CallStatement,
    Case,
    ComputedInit,
    If,
    Initial,
    Pos,
    Pou,
    PouKind,
    Statement,
    Storage,
    Task,
    TaskKind,
    Variable,
)  # fmt: skip
from plctool.iec.types import Keep
from plctool.io.faults import Fault

_LARGEST_ON_STACK = 0x4000  # bytes; what is larger lives in the data area


@dataclass(frozen=True)
class TestCase:
    """A TEST; its number is its index in `TestSuite.cases`."""

    name: str
    pos: Pos
    faults: tuple[Fault, ...] = ()  # of simulated devices, from its beginning on


@dataclass
class _File:
    """What the tests of one file share. `forces`: those of its SETUP."""

    forces: Forces
    setup: Pou | None = None
    teardown: Pou | None = None
    names: dict[str, VarSymbol] = field(default_factory=dict)


class TestSuite:
    """The tests of one program; filled by `check_sources`. `marks`: takes the statements, for coverage."""

    def __init__(self, marks: StatementMarks | None = None) -> None:
        self.marks = marks
        self.cases: list[TestCase] = []
        self.asserts: list[Assertion] = []  # the first one has number 1
        self.teardowns: dict[str, int] = {}  # by file

    def teardown_of(self, case: TestCase) -> int | None:
        """The number that runs just the TEARDOWN after a test."""
        return self.teardowns.get(case.pos.file)

    def begin(self, program: Program) -> TestProgram:
        """The tests of this program are wanted."""
        return TestProgram(self, program)


class TestProgram(Participant):
    """Makes the tests a part of a program that is being checked, and notes in `suite` what they are."""

    def __init__(self, suite: TestSuite, program: Program) -> None:
        self._suite = suite
        self._program = program
        self._world = program.world
        self._bench = Bench(program.world, suite.asserts)
        self._devices = TestDevices(self._bench)
        self._branches: list[tuple[list[tuple[int, int]], list[Statement]]] = []
        self._blocks: dict[str, PouSymbol] = {}  # PROGRAMs as function blocks

    # ---- the steps of the check ----

    def after_parse(self, files: Files) -> Files:
        """Adds to the syntax tree what MOCK and the coverage need."""
        names = self._world.names
        names.register([raising()], library=True)
        everything = [decl for _, declarations in files for decl in declarations]
        self._devices.wanted = any(d.faults for d in everything if isinstance(d, ast.TestDecl))
        if self._devices.wanted:
            names.register([host_function()], library=True)
        mocks = Mocks((d for d in everything if isinstance(d, ast.TestDecl)), self._world.diagnostics)
        names.rewrite(mocks.rewritten)
        marks = self._suite.marks
        if marks is not None:
            files = [(source, marks.marked(declarations)) for source, declarations in files]
            names.register_globals([marks.variable(Source("", ""))], Source("", ""))
        return [(source, mocks.rewritten(declarations)) for source, declarations in files]

    def after_declare(self) -> Application:
        """Adds the tests, and the task that runs one of them."""
        application = self._configure()
        self._add()
        return application

    def _configure(self) -> Application:
        """The programs as the CONFIGURATION has them, so that their names are known; no task runs them. Without a
        CONFIGURATION there may be any number."""
        alone = len(default_programs(self._world)) == 1
        wanted = alone or self._world.names.configurations
        application = configure(self._world, self._program.config) if wanted else Application()
        self._devices.take_copies(application.tasks)
        return Application([self._task()], of_tests=True)

    def _task(self) -> Task:
        pos = next((t.source.pos(t.pos) for t in self._world.names.tests), Pos("", 1, 1))
        runner = Pou("Tests", PouKind.PROGRAM, pos)
        runner.body = [Case(load(self._bench.place(NUMBER, pos)), self._branches, [], pos)]
        return Task("Tests", TaskKind.CYCLIC, 1, 10_000, [runner])

    def _add(self) -> None:
        self._blocks = {p.decl.name.casefold(): _as_block(p) for p in self._world.names.program_symbols()}
        for symbol in self._blocks.values():
            self._world.declared.block(symbol)
        files: dict[str, _File] = {}
        for decl in (t for t in self._world.names.tests if t.keyword is ast.TestUnit.SETUP):
            self._setup(decl, self._file(files, decl))
        for decl in (t for t in self._world.names.tests if t.keyword is ast.TestUnit.TEARDOWN):
            self._teardown(decl, self._file(files, decl))
        for decl in (t for t in self._world.names.tests if t.keyword is ast.TestUnit.TEST):
            self._test(decl, self._file(files, decl))
        for path, file in files.items():
            if file.teardown is not None:
                number = self._suite.teardowns[path] = len(self._suite.cases) + len(self._suite.teardowns)
                self._branches.append(([(number, number)], [_call(file.teardown)]))

    def _file(self, files: dict[str, _File], decl: ast.TestDecl) -> _File:
        return files.setdefault(decl.source.path, _File(Forces(self._bench)))

    # ---- blocks ----

    def _setup(self, decl: ast.TestDecl, file: _File) -> None:
        scope = self._begin(decl, file, "SETUP")
        if file.setup is not None:
            scope.error(decl.pos, "duplicate", "there is a SETUP in this file already")
            return
        file.setup = scope.pou
        self._declare(decl, scope, file)
        file.names = {k: s for k, s in scope.names.items() if isinstance(s, VarSymbol)}
        for symbol in file.names.values():
            symbol.used = True
        self._write(decl, scope, file.forces)

    def _teardown(self, decl: ast.TestDecl, file: _File) -> None:
        scope = self._begin(decl, file, "TEARDOWN")
        if file.teardown is not None:
            scope.error(decl.pos, "duplicate", "there is a TEARDOWN in this file already")
            return
        file.teardown = scope.pou
        self._declare(decl, scope, None)
        self._write(decl, scope, Forces(self._bench), cleaning=True)

    def _test(self, decl: ast.TestDecl, file: _File) -> None:
        number, pos = len(self._suite.cases), decl.source.pos(decl.pos)
        if any(case.name == decl.name and case.pos.file == pos.file for case in self._suite.cases):
            self._world.scope(decl.source).error(
                decl.pos,
                "duplicate",
                f"there is a TEST '{decl.name}' in this file already; give each a name of its own",
            )
        faults = faults_of(decl, self._world.io.description, self._world.diagnostics)
        self._suite.cases.append(TestCase(decl.name, pos, faults))
        scope = self._begin(decl, file, f"TEST_{number}")
        self._declare(decl, scope, None)
        self._write(decl, scope, Forces(self._bench, file.forces))
        assert scope.pou is not None
        body = [_call(scope.pou)]
        if file.setup is not None:
            body = [_call(file.setup), If([(self._bench.passed(pos), body)], [], pos)]
        if file.teardown is not None:
            body.append(_call(file.teardown))
        if faults:
            body = [*self._devices.start(Checker(self._world, scope), decl.pos), *body]
        self._branches.append(([(number, number)], body))

    def _begin(self, decl: ast.TestDecl, file: _File, name: str) -> Scope:
        scope = self._world.scope(decl.source)
        scope.enter(decl.namespace)
        scope.pou = Pou(name, PouKind.PROGRAM, decl.source.pos(decl.pos))
        scope.programs = self._blocks
        scope.names.update(file.names)
        return scope

    def _write(self, decl: ast.TestDecl, scope: Scope, forces: Forces, *, cleaning: bool = False) -> None:
        TestBody(self._world, scope, self._bench, self._devices, forces, cleaning=cleaning).write(decl)

    def _declare(self, decl: ast.TestDecl, scope: Scope, shared: _File | None) -> None:
        """The variables: of SETUP (`shared`) in the data area, others on the stack."""
        pou = scope.pou
        assert pou is not None
        for name in {name.casefold() for b in decl.blocks for line in b.decls for _, name in line.names}:
            if isinstance(scope.names.get(name), VarSymbol):
                del scope.names[name]  # hides one of SETUP
        # Bounds may need constants.
        blocks = sorted(decl.blocks, key=lambda b: ast.Modifier.CONSTANT not in b.qualifiers)
        for block in blocks:
            if block.keyword not in (ast.Section.VAR, ast.Section.VAR_TEMP, ast.Section.VAR_EXTERNAL):
                scope.error(block.pos, "unsupported", f"a {decl.keyword} has VAR, not {block.keyword}")
            elif block.keyword is not ast.Section.VAR_EXTERNAL:  # globals are known anyway
                for line in block.decls:
                    if ast.Modifier.CONSTANT in block.qualifiers:
                        self._constant(line, scope, pou.name)
                    else:
                        self._line(line, scope, shared)

    def _line(self, line: ast.VarDecl, scope: Scope, shared: _File | None) -> None:
        variables, pou = self._program.variables, scope.pou
        assert pou is not None
        t, default = self._program.types.declared_type(line, scope, May.HAVE_ADDRESS)
        computed = default.value if isinstance(default, ComputedInit) else None
        default = None if computed is not None else default
        for offset, name in line.names:
            symbol = VarSymbol(name, scope.pos(offset), t, Role.LOCAL)
            if t is not ERROR:
                if line.location is not None:
                    symbol.variable = variables.area_variable(
                        name, t, default, line.location, Keep.UNSAID, scope, offset
                    )
                else:
                    symbol.variable = self._instance(symbol, default, pou, shared is not None)
            variable = symbol.variable
            if variable is not None and variable.storage is Storage.AREA:
                self._world.allocation.add(variable)
            elif variable is not None:
                pou.locals.append(variable)
            if variable is not None and computed is not None:
                scope.prologue.append(Assign(whole(variable, variable.pos), computed, variable.pos))
            scope.declare(symbol, offset)

    def _constant(self, line: ast.VarDecl, scope: Scope, owner: str) -> None:
        t, init = self._program.types.declared_type(line, scope)
        for offset, name in line.names:
            symbol = self._program.variables.constant_symbol(offset, name, t, init, scope, owner, Role.LOCAL)
            scope.declare(symbol, offset)

    def _instance(self, symbol: VarSymbol, default: Initial | None, pou: Pou, shared: bool) -> Variable:
        t = symbol.type
        if shared or t.size > _LARGEST_ON_STACK:
            name = f"{pou.pos.file}:{pou.pos.line}.{symbol.name}"
            return Variable(name, t, Storage.AREA, symbol.pos, initial=default)
        return Variable(symbol.name, t, Storage.LOCAL, symbol.pos, initial=default)


def _as_block(program: PouSymbol) -> PouSymbol:
    """A PROGRAM as a type with instances. Addresses are dropped: each instance has its own inputs and outputs."""
    decl = program.decl
    blocks = [replace(b, decls=[replace(line, location=None) for line in b.decls]) for b in decl.blocks]
    return PouSymbol(replace(decl, keyword=ast.Unit.FUNCTION_BLOCK, blocks=blocks), library=False)


def _call(pou: Pou) -> Statement:
    return CallStatement(Call(pou, [], NOTHING, pou.pos), pou.pos)
