"""`plctool debug`, a debugger in the terminal, and `plctool dap`, the same for editors."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.arguments import add_link
from plctool.cli.connections import connect
from plctool.cli.links import link_of
from plctool.cli.output import say
from plctool.cli.parser import Parser
from plctool.errors import PlcError, UsageError

if TYPE_CHECKING:
    from plctool.controller import Controller
    from plctool.debug.breakpoints import Debugger, Halt

_PLACE = re.compile(r"(?:(?P<file>.+):)?(?P<line>\d{1,9})")
_OPTIONS = re.compile(r"\s+(if|hits|log)\s+")
_SLICE = 0.1  # seconds that the program runs between two looks for Ctrl-C

HELP = """\
b [FILE:]LINE [if EXPRESSION] [hits N] [log TEXT]  halt at a line; log writes TEXT with {EXPRESSION} instead
v NAME [if EXPRESSION] [hits N]  halt when a variable has changed
d N | d all      end a breakpoint
i                list the breakpoints
c [SECONDS]      go on until a halt, or so long; Ctrl-C pauses
n, s, o          step over, into, out of a call
u [FILE:]LINE    go on to a line
y                go on to the next cycle of this task
w                where: the calls
l                the variables of this call
f N              choose call N of 'w', for l, p and set
p EXPRESSION     print a value
set NAME := VALUE  write a variable
force NAME := VALUE, unforce NAME
q                quit: breakpoints end, the program goes on"""


def debug_arguments(command: Parser) -> None:
    command.json_line_for_each("halt")
    command.add_argument(
        "sources", type=Path, nargs="*", metavar="SOURCE|PROJECT",
        help="a program that runs in this process, on a virtual clock; without one, that of a device",
    )  # fmt: skip
    add_link(command, symbols=True)
    command.set_defaults(action=_debug)


def dap_arguments(command: Parser) -> None:
    command.add_argument(
        "--listen", type=int, metavar="PORT", help="at a port of this machine instead, 0 for a free one, until Ctrl-C"
    )
    command.set_defaults(action=_dap)


def _dap(args: argparse.Namespace) -> int:
    """Serves an editor."""
    from plctool.dap.server import listen, serve_standard_streams

    if args.listen is None:
        serve_standard_streams()
        return output.EXIT_OK
    if not 0 <= args.listen <= 65535:
        raise UsageError(f"{args.listen} is not a port; write a number from 0 to 65535.", "usage")

    def ready(port: int) -> None:
        output.show(args, {"port": port}, lambda d: f"listening at 127.0.0.1, port {d['port']}")

    with suppress(KeyboardInterrupt):
        listen(args.listen, ready)
    return output.EXIT_OK


def _debug(args: argparse.Namespace) -> int:
    """Reads commands until the end of the input."""
    with _debuggee(args) as plc:
        Terminal(plc, as_json=args.json).run()
    return output.EXIT_OK


@contextmanager
def _debuggee(args: argparse.Namespace) -> Iterator[Controller]:
    if not args.sources:
        link_of(args)
        with connect(args) as plc:
            yield plc
        return
    from plctool.compiler import compile_sources
    from plctool.image.targets import host_target
    from plctool.sim import Simulator

    built = compile_sources(args.sources, target=host_target(), level=0, debug=True)
    with Simulator(built.image, built.symbols) as plc:
        yield plc


class Terminal:
    """A debugger for a person, or for a script."""

    def __init__(self, plc: Controller, *, as_json: bool) -> None:
        self._plc = plc
        self._json = as_json
        self._asks = sys.stdin.isatty()
        self._debugger: Debugger = plc.breakpoints
        self._debugger.output = say
        self._call = 0
        self._file = ""
        self._last = ""

    def run(self) -> None:
        """Until `q`, or the end of the input."""
        if self._asks:
            say("h lists the commands.")
        for _ in count():
            try:
                line = input("(debug) " if self._asks else "").strip()
            except (EOFError, KeyboardInterrupt):
                return
            line = line or (self._last if self._asks else "")
            self._last = line
            if line == "q":
                return
            try:
                self._do(line)
            except PlcError as error:
                say(str(error))

    def _do(self, line: str) -> None:
        if not line or line.startswith("#"):
            return
        word, _, rest = line.partition(" ")
        action = _COMMANDS.get(word)
        if action is None:
            raise UsageError(f"There is no command {word}; h lists them.", "usage")
        action(self, rest.strip())
        sys.stdout.flush()

    # ---- breakpoints ----

    def _place(self, text: str) -> tuple[str, int]:
        match = _PLACE.fullmatch(text.strip())
        if match is None:
            raise UsageError(f"'{text}' is not a line; write for example main.st:12.", "usage")
        return match["file"] or self._default_file(), int(match["line"])

    def _default_file(self) -> str:
        if self._debugger.halt is not None and self._debugger.halt.calls:
            return self._debugger.halt.calls[self._call].file
        files = sorted({row.file for row in self._debugger.statements.rows})
        if len(files) != 1:
            raise UsageError(f"Name the file, such as {files[0] if files else 'main.st'}:12.", "usage")
        return files[0]

    def _break(self, text: str) -> None:
        place, *options = _OPTIONS.split(text)
        given = dict(zip(options[::2], options[1::2], strict=True))
        hits = given.get("hits", "1")
        if not hits.isdigit():
            raise UsageError(f"'{hits}' is not a number of hits.", "usage")
        file, line = self._place(place)
        made = self._debugger.set(file, line, condition=given.get("if", ""), hits=int(hits), log=given.get("log", ""))
        say(f"breakpoint {made.number}: {Path(made.file).name}:{made.line}")

    def _watch(self, text: str) -> None:
        name, *options = _OPTIONS.split(text)
        given = dict(zip(options[::2], options[1::2], strict=True))
        hits = given.get("hits", "1")
        if not name or not hits.isdigit() or "log" in given:
            raise UsageError("Write for example: v Main.speed if Main.speed > 5 hits 2", "usage")
        halt = self._debugger.halt
        call = halt.calls[self._call] if halt and halt.calls else None
        symbol = halt.halted.in_area(name, call) if halt else self._debugger.table.resolve(name)
        made = self._debugger.watch(symbol, condition=given.get("if", ""), hits=int(hits))
        say(f"breakpoint {made.number}: {made.name}, compared before {self._debugger.granularity}")

    def _delete(self, text: str) -> None:
        if text == "all":
            self._debugger.clear_all()
        elif text.isdigit():
            self._debugger.clear(int(text))
        else:
            raise UsageError("Write d with the number of a breakpoint, or d all.", "usage")

    def _list(self, text: str) -> None:
        for b, hits in self._debugger.list():
            options = [f"if {b.condition}"] * bool(b.condition) + [f"log {b.log}"] * bool(b.log)
            say(" ".join([f"{b.number}: {Path(b.file).name}:{b.line}", *options, f"({hits} hits)"]))
        for watch, changes in self._debugger.watched():
            options = [f"if {watch.condition}"] * bool(watch.condition)
            say(" ".join([f"{watch.number}: {watch.name}", *options, f"({changes} changes)"]))

    # ---- going on ----

    def _continue(self, text: str) -> None:
        try:
            seconds = float(text) if text else None
        except ValueError:
            raise UsageError(f"'{text}' is not a number of seconds.", "usage") from None
        if self._debugger.halt is not None:
            self._debugger.go()
        self._wait(seconds)

    def _wait(self, seconds: float | None) -> None:
        """Until a halt; Ctrl-C pauses."""
        self._call = 0
        halt = None
        try:
            while halt is None and (seconds is None or seconds > 0):
                part = _SLICE if seconds is None else min(_SLICE, seconds)
                halt = self._debugger.wait(part)
                self._plc.check_running()
                seconds = None if seconds is None else seconds - part
        except KeyboardInterrupt:
            self._debugger.pause()
            halt = self._debugger.wait(5)
        if halt is None:
            say("still running")
        else:
            self._show(halt)

    def _step(self, action: Callable[[Debugger], object]) -> Callable[[str], None]:
        def stepped(text: str) -> None:
            action(self._debugger)
            self._wait(None)

        return stepped

    def _until(self, text: str) -> None:
        file, line = self._place(text)
        self._debugger.run_to(file, line)
        self._wait(None)

    def _show(self, halt: Halt) -> None:
        if self._json:
            calls = [{"pou": c.pou, "file": c.file, "line": c.line} for c in halt.calls]
            say(json.dumps({"reason": halt.reason, "task": halt.task, "exception": halt.exception, "calls": calls}))
            return
        say(str(halt))
        if halt.calls:
            say(_source_line(halt.calls[0].file, halt.calls[0].line))

    # ---- looking ----

    def _halt(self) -> Halt:
        if self._debugger.halt is None:
            raise UsageError("The program runs; set a breakpoint, and go on with c.", "not-halted")
        return self._debugger.halt

    def _where(self, text: str) -> None:
        for i, call in enumerate(self._halt().calls):
            say(f"{'*' if i == self._call else ' '} {i}  {call.pou}, {call.file}:{call.line}")

    def _frame(self, text: str) -> None:
        if not text.isdigit() or int(text) >= len(self._halt().calls):
            raise UsageError("Write f with the number of a call; w lists them.", "usage")
        self._call = int(text)
        self._where("")

    def _locals(self, text: str) -> None:
        halt = self._halt()
        if not halt.calls:
            return
        call = halt.calls[self._call]
        for name, symbol in (halt.halted.locals(call) | halt.halted.instance(call)).items():
            say(f"{name} = {halt.halted.text(symbol)}")

    def _print(self, text: str) -> None:
        from plctool.debug.expressions import NAME

        if self._debugger.halt is None:
            say(self._plc.sample([text]).texts[text])
            return
        halted = self._halt().halted
        call = self._halt().calls[self._call] if self._halt().calls else None
        if NAME.fullmatch(text):
            say(halted.text(halted.resolve(text, call)))
            return
        value: Any = halted.evaluate(text, call)
        say(str(value).upper() if isinstance(value, bool) else str(value))

    def _set(self, text: str) -> None:
        name, sign, value = (part.strip() for part in text.partition(":="))
        if not sign:
            raise UsageError("Write for example: set Main.speed := 5", "usage")
        halt = self._debugger.halt
        if halt is None:
            self._plc.write({name: self._plc.symbols().resolve(name).parse(value)})
            return
        halt.halted.write(name, value, halt.calls[self._call] if halt.calls else None)

    def _force(self, text: str) -> None:
        name, sign, value = (part.strip() for part in text.partition(":="))
        if not sign:
            raise UsageError("Write for example: force Main.speed := 5", "usage")
        self._plc.force({name: self._plc.symbols().resolve(name).parse(value)})

    def _unforce(self, text: str) -> None:
        self._plc.unforce([text] if text else None)

    def _help(self, text: str) -> None:
        say(HELP)


def _source_line(file: str, line: int) -> str:
    try:
        with Path(file).open(encoding="utf-8", errors="replace") as lines:
            found = next((text for i, text in enumerate(lines, 1) if i == line), "")
    except OSError:
        return ""
    return f"{line:5}  {found.rstrip()}"


_COMMANDS: dict[str, Callable[[Terminal, str], None]] = {
    "b": Terminal._break,
    "v": Terminal._watch,
    "d": Terminal._delete,
    "i": Terminal._list,
    "c": Terminal._continue,
    "n": lambda t, text: t._step(lambda d: d.step_over())(text),
    "s": lambda t, text: t._step(lambda d: d.step_into())(text),
    "o": lambda t, text: t._step(lambda d: d.step_out())(text),
    "y": lambda t, text: t._step(lambda d: d.step_cycle())(text),
    "u": Terminal._until,
    "w": Terminal._where,
    "f": Terminal._frame,
    "l": Terminal._locals,
    "p": Terminal._print,
    "set": Terminal._set,
    "force": Terminal._force,
    "unforce": Terminal._unforce,
    "h": Terminal._help,
}
