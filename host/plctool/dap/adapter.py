"""The adapter: the requests of one editor, and the events that it gets."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from plctool.compiler import CompileError
from plctool.dap.debuggees import Debuggee, TestedDebuggee, attach, launch
from plctool.dap.messages import Message, Sender
from plctool.dap.test_runs import TestRun, find_test_run
from plctool.dap.wanted import Install, WantedBreakpoints, hits_of
from plctool.debug.breakpoints import Debugger, Halt
from plctool.debug.expressions import NAME
from plctool.debug.forced import name_forced, place_of
from plctool.debug.halted import Call
from plctool.debug.variables import Symbol
from plctool.debug.watches import check_watchable
from plctool.errors import PlcError, UsageError
from plctool.iec.types import ArrayType, StructType
from plctool.sim import Simulator, watched_by

_SLICE = 0.02  # between two looks at requests while the program runs [s]
_DATA = ":data"  # the group of data breakpoints, which no path of a source is
_MOST_CAUGHT_UP = 0.2  # of virtual time [s]
_ASSIGNMENT = re.compile(r"\s*(\S+)\s*:=\s*(.+)")

Named = Callable[[], dict[str, Symbol]]
"""Variables by the names they are shown with."""

CAPABILITIES = {
    "supportsConfigurationDoneRequest": True,
    "supportsConditionalBreakpoints": True,
    "supportsHitConditionalBreakpoints": True,
    "supportsLogPoints": True,
    "supportsDataBreakpoints": True,
    "supportsSetVariable": True,
    "supportsEvaluateForHovers": True,
    "supportsExceptionInfoRequest": True,
    "supportsRestartRequest": True,
    "supportsTerminateRequest": True,
    "supportTerminateDebuggee": True,
}


class Adapter:
    """Serves one editor until it disconnects. Requests come in a queue, None at the end."""

    def __init__(self, requests: SimpleQueue[Message | None], sender: Sender) -> None:
        self._requests = requests
        self._sender = sender
        self._debuggee: Debuggee | None = None
        self._debugger: Debugger | None = None
        self._tests: TestRun | None = None  # let time pass in place of the adapter
        self._running = False
        self._done = False
        self._entry = False  # the next pause is the halt at the beginning
        self._failed = False  # an exception was reported
        self._first_line = 1
        self._wanted = WantedBreakpoints()
        self._references: list[Named] = []
        self._calls: list[Call] = []
        self._last = time.monotonic()

    def run(self) -> None:
        """Until the editor is gone."""
        try:
            while not self._done:
                self._one_turn()
        finally:
            self._close()

    def _one_turn(self) -> None:
        try:
            request = self._requests.get(timeout=_SLICE if self._running else None)
        except Empty:
            self._let_run()
            return
        if request is None:
            self._done = True
        elif request.get("type") == "request":
            self._handle(request)
        if self._running and not self._done and self._tests is None:
            self._let_run()

    # ---- requests ----

    def _handle(self, request: Message) -> None:
        command = request.get("command")
        action = _REQUESTS.get(command) if isinstance(command, str) else None
        arguments = request.get("arguments")
        try:
            if action is None:
                raise UsageError(f"The adapter has no request {command}.", "dap")
            body = action(self, arguments if isinstance(arguments, dict) else {})
        except CompileError as error:
            self._output(f"{error}\n", "stderr")
            self._sender.refusal(request, f"The program has errors: {error.diagnostics[0].message}")
        except PlcError as error:
            self._sender.refusal(request, str(error))
        except (KeyError, TypeError, ValueError, IndexError) as error:
            self._sender.refusal(request, f"The arguments of {command} make no sense: {type(error).__name__} {error}.")
        else:
            self._sender.response(request, body)
            self._after(str(command))

    def _after(self, command: str) -> None:
        """What follows a response."""
        if command in ("launch", "attach"):
            self._sender.event("initialized")
        if command == "configurationDone" and self._tests is not None:
            self._run_tests(self._tests)

    def _initialize(self, arguments: Message) -> Message:
        self._first_line = 1 if arguments.get("linesStartAt1", True) else 0
        return dict(CAPABILITIES)

    def _launch(self, arguments: Message) -> Message:
        tests = find_test_run(arguments)
        if tests is not None:
            self._check_free()
            self._tests, self._entry = tests, bool(arguments.get("stopOnEntry"))
            return {}
        return self._begin(launch(arguments), bool(arguments.get("stopOnEntry")))

    def _attach(self, arguments: Message) -> Message:
        return self._begin(attach(arguments), bool(arguments.get("stopOnEntry")))

    def _begin(self, debuggee: Debuggee, entry: bool) -> Message:
        try:
            self._check_free()
        except UsageError:
            debuggee.close()
            raise
        self._show(debuggee)
        self._entry = entry
        return {}

    def _check_free(self) -> None:
        if self._debuggee is not None or self._tests is not None:
            raise UsageError("A program is being debugged already; disconnect first.", "dap")

    def _show(self, debuggee: Debuggee) -> None:
        """The program that requests are about."""
        self._debuggee = debuggee
        self._debugger = debuggee.debugger
        self._debugger.output = lambda text: self._output(text + "\n", "console")

    def _plc(self) -> Debuggee:
        if self._debuggee is None:
            raise UsageError("Nothing is debugged yet: send launch or attach.", "dap")
        return self._debuggee

    def _breakpoints(self) -> Debugger:
        self._plc()
        assert self._debugger is not None
        return self._debugger

    def _configuration_done(self, arguments: Message) -> Message:
        if self._tests is not None:
            return {}  # they run when this is answered
        debuggee, debugger = self._plc(), self._breakpoints()
        if self._entry:
            debugger.pause()
        debuggee.start()
        self._go_on()
        return {}

    def _go_on(self) -> None:
        self._running, self._last = True, time.monotonic()
        self._references.clear()
        self._calls = []

    def _set_breakpoints(self, arguments: Message) -> Message:
        path = str(arguments["source"].get("path") or arguments["source"].get("name") or "")
        entries = arguments.get("breakpoints") or [{"line": line} for line in arguments.get("lines") or []]
        installs = [(int(entry["line"]), self._line_breakpoint(path, entry)) for entry in entries]
        return {"breakpoints": self._wanted.replace(path, installs, self._present())}

    def _present(self) -> Debugger | None:
        """The debugger of the program; None before a test has one."""
        return self._debugger if self._tests is not None else self._breakpoints()

    def _line_breakpoint(self, path: str, entry: Message) -> Install:
        def install(debugger: Debugger) -> tuple[int, Message]:
            made = debugger.set(
                path,
                int(entry["line"]) + 1 - self._first_line,
                condition=str(entry.get("condition") or ""),
                hits=hits_of(str(entry.get("hitCondition") or "")),
                log=str(entry.get("logMessage") or ""),
            )
            return made.number, {"line": made.line - 1 + self._first_line}

        return install

    # ---- data breakpoints ----

    def _data_breakpoint_info(self, arguments: Message) -> Message:
        """Which variable it would be, if it is one that is compared."""
        try:
            symbol = self._named(arguments)
            check_watchable(symbol)
        except PlcError as error:
            return {"dataId": None, "description": str(error)}
        watched = next(
            s for s, _ in name_forced([place_of(symbol)], self._breakpoints().table.variables.values()).values()
        )
        text = f"{watched.name} (halts at the first statement after a change)"
        return {"dataId": watched.name, "description": text, "accessTypes": ["write"], "canPersist": True}

    def _named(self, arguments: Message) -> Symbol:
        """A variable in an area."""
        name, debugger = str(arguments["name"]), self._breakpoints()
        if debugger.halt is None:
            return debugger.table.resolve(name)
        halted = debugger.halt.halted
        if not arguments.get("variablesReference"):
            return halted.in_area(name, self._call(arguments.get("frameId")))
        symbol = self._referred(arguments).get(name)
        if symbol is None:
            raise UsageError(f"There is no variable {name} here.", "dap")
        return halted.symbol_in_area(symbol)

    def _set_data_breakpoints(self, arguments: Message) -> Message:
        installs = [(None, self._data_breakpoint(entry)) for entry in arguments["breakpoints"]]
        return {"breakpoints": self._wanted.replace(_DATA, installs, self._present())}

    def _data_breakpoint(self, entry: Message) -> Install:
        def install(debugger: Debugger) -> tuple[int, Message]:
            if str(entry.get("accessType") or "write") != "write":
                raise UsageError("Reads of a variable do not halt; choose changes (write).", "dap")
            name = str(entry["dataId"])
            hits = hits_of(str(entry.get("hitCondition") or ""))
            made = debugger.watch(name, condition=str(entry.get("condition") or ""), hits=hits)
            return made.number, {"message": f"{made.name} is compared before {debugger.granularity}."}

        return install

    def _set_exception_breakpoints(self, arguments: Message) -> Message:
        return {}  # exceptions always halt

    def _threads(self, arguments: Message) -> Message:
        if self._debuggee is None:
            return {"threads": []}
        names = self._breakpoints().table.tasks
        return {"threads": [{"id": i + 1, "name": name} for i, name in enumerate(names)]}

    # ---- a halted program ----

    def _halt(self) -> Halt:
        halt = self._breakpoints().halt
        if halt is None:
            raise UsageError("The program runs; pause it first.", "not-halted")
        return halt

    def _stack_trace(self, arguments: Message) -> Message:
        halt = self._halt()
        if arguments.get("threadId") != self._thread(halt):
            return {"stackFrames": [], "totalFrames": 0}
        self._calls = self._calls_of(halt)
        first = int(arguments.get("startFrame") or 0)
        count = int(arguments.get("levels") or 0) or len(self._calls)
        frames = [self._frame(i, call) for i, call in enumerate(self._calls)]
        if not frames:  # the dump of a program that was between two cycles has variables nevertheless
            frames, count = [{"id": 1, "name": halt.task, "line": 0, "column": 0}], 1
        return {"stackFrames": frames[first : first + count], "totalFrames": len(frames)}

    def _calls_of(self, halt: Halt) -> list[Call]:
        if self._tests is None:
            return halt.calls
        from plctool.st_tests import up_to_test  # which needs the compiler

        return up_to_test(halt.calls)

    def _frame(self, i: int, call: Call) -> Message:
        path = Path(call.file)
        line = call.line - 1 + self._first_line
        source = {"name": path.name, "path": str(path.absolute())}
        return {"id": i + 1, "name": call.pou, "line": line, "column": 1, "source": source}

    def _thread(self, halt: Halt) -> int:
        names = self._breakpoints().table.tasks
        return names.index(halt.task) + 1 if halt.task in names else 1

    def _call(self, frame: Any) -> Call | None:
        if not isinstance(frame, int) or not self._calls:
            self._calls = self._calls or self._calls_of(self._halt())
            return self._calls[0] if self._calls else None
        if not 1 <= frame <= len(self._calls):
            raise UsageError(f"There is no frame {frame}.", "dap")
        return self._calls[frame - 1]

    def _scopes(self, arguments: Message) -> Message:
        halted, call = self._halt().halted, self._call(arguments["frameId"])
        table = self._breakpoints().table
        scopes: list[tuple[str, Named, bool]] = [
            ("Globals", lambda: {symbol.name: symbol for symbol in table.find([])}, True)
        ]
        if call is not None:
            scopes[:0] = [
                ("Locals", lambda: halted.locals(call), False),
                (call.pou, lambda: halted.instance(call), False),
            ]
        return {
            "scopes": [
                {"name": name, "variablesReference": self._refer(named), "expensive": expensive}
                for name, named, expensive in scopes
            ]
        }

    def _refer(self, named: Named) -> int:
        self._references.append(named)
        return len(self._references)

    def _variable(self, name: str, symbol: Symbol) -> Message:
        composite = isinstance(symbol.type, StructType | ArrayType)
        text = str(symbol.type) if composite else self._text(symbol)
        reference = self._refer(lambda: _parts(symbol)) if composite else 0
        return {
            "name": name,
            "value": text,
            "type": str(symbol.type),
            "evaluateName": symbol.name,
            "variablesReference": reference,
        }

    def _text(self, symbol: Symbol) -> str:
        try:
            return self._halt().halted.text(symbol)
        except PlcError as error:
            return f"<{error}>"

    def _variables(self, arguments: Message) -> Message:
        return {"variables": [self._variable(name, symbol) for name, symbol in self._referred(arguments).items()]}

    def _referred(self, arguments: Message) -> dict[str, Symbol]:
        self._halt()
        reference = int(arguments["variablesReference"])
        if not 1 <= reference <= len(self._references):
            raise UsageError(f"There are no variables {reference}.", "dap")
        named: Named = self._references[reference - 1]
        return named()

    def _set_variable(self, arguments: Message) -> Message:
        halted = self._halt().halted
        symbol = self._referred(arguments).get(str(arguments["name"]))
        if symbol is None:
            raise UsageError(f"There is no variable {arguments['name']} here.", "dap")
        halted.write_symbol(symbol, str(arguments["value"]))
        return {"value": halted.text(symbol), "variablesReference": 0}

    def _evaluate(self, arguments: Message) -> Message:
        text = str(arguments["expression"]).strip()
        if self._breakpoints().halt is None:
            return self._evaluate_running(text)
        halted, call = self._halt().halted, self._call(arguments.get("frameId"))
        assignment = _ASSIGNMENT.fullmatch(text)
        if assignment is not None and arguments.get("context") == "repl":
            symbol = halted.write(assignment[1], assignment[2], call)
            return {"result": halted.text(symbol), "variablesReference": 0}
        if NAME.fullmatch(text):
            found = self._variable(text, halted.resolve(text, call))
            return {"result": found["value"], "type": found["type"], "variablesReference": found["variablesReference"]}
        return {"result": _shown(halted.evaluate(text, call)), "variablesReference": 0}

    def _evaluate_running(self, text: str) -> Message:
        if not NAME.fullmatch(text):
            raise UsageError("While the program runs, only variables of programs and global ones have values.", "dap")
        return {"result": self._plc().plc.sample([text]).texts[text], "variablesReference": 0}

    def _exception_info(self, arguments: Message) -> Message:
        halt = self._halt()
        return {"exceptionId": halt.exception or halt.reason, "description": str(halt), "breakMode": "always"}

    # ---- going on ----

    def _step(self, action: Callable[[], object]) -> Message:
        self._halt()
        action()
        self._go_on()
        return {}

    def _continue(self, arguments: Message) -> Message:
        self._step(self._breakpoints().go)
        return {"allThreadsContinued": True}

    def _next(self, arguments: Message) -> Message:
        return self._step(self._breakpoints().step_over)

    def _step_in(self, arguments: Message) -> Message:
        return self._step(self._breakpoints().step_into)

    def _step_out(self, arguments: Message) -> Message:
        return self._step(self._breakpoints().step_out)

    def _step_cycle(self, arguments: Message) -> Message:
        return self._step(self._breakpoints().step_cycle)

    def _run_to(self, arguments: Message) -> Message:
        path, line = str(arguments["source"]["path"]), int(arguments["line"]) + 1 - self._first_line
        return self._step(lambda: self._breakpoints().run_to(path, line))

    def _pause(self, arguments: Message) -> Message:
        self._breakpoints().pause()
        return {}

    def _restart(self, arguments: Message) -> Message:
        if self._tests is not None:
            raise UsageError("Tests begin again when they are launched again.", "dap")
        plc, debugger = self._plc().plc, self._breakpoints()
        plc.reset("warm")
        debugger.forget_halt()
        self._failed = False
        plc.start()
        self._go_on()
        return {}

    def _force(self, arguments: Message) -> Message:
        values = arguments["values"]
        self._plc().plc.force(values)
        return {"forced": list(self._plc().plc.forced())}

    def _unforce(self, arguments: Message) -> Message:
        self._plc().plc.unforce(arguments.get("names"))
        return {"forced": list(self._plc().plc.forced())}

    def _disconnect(self, arguments: Message) -> Message:
        self._done = True
        self._close()
        return {}

    def _terminate(self, arguments: Message) -> Message:
        self._running = False
        self._done = self._done or self._tests is not None
        if self._debuggee is not None and not self._debuggee.launched:
            self._debuggee.end_debugging()
        self._sender.event("terminated")
        return {}

    # ---- time ----

    def _let_run(self) -> None:
        """Lets a simulator follow the clock, looks whether the program has halted, and says so."""
        debuggee, debugger = self._plc(), self._breakpoints()
        now = time.monotonic()
        passed, self._last = min(now - self._last, _MOST_CAUGHT_UP), now
        try:
            halt = debugger.wait(passed if debuggee.simulator is not None else 0)
            if halt is None:
                self._look_for_exception(debuggee)
        except PlcError as error:
            self._running = False
            self._output(f"{error}\n", "stderr")
            self._sender.event("terminated")
            return
        if halt is not None:
            self._say_halted(halt)

    def _say_halted(self, halt: Halt) -> None:
        self._running = False
        reason = "entry" if self._entry and halt.reason == "pause" else halt.reason
        self._entry = False
        body: Message = {"reason": reason, "threadId": self._thread(halt), "allThreadsStopped": True}
        if halt.exception:
            body |= {"description": str(halt), "text": halt.exception}
        if halt.changed:
            body |= {"description": str(halt), "text": ", ".join(map(str, halt.changed))}
        if halt.breakpoints or halt.changed:
            body["hitBreakpointIds"] = self._wanted.ids(self._breakpoints(), halt)
        self._sender.event("stopped", body)

    def _look_for_exception(self, debuggee: Debuggee) -> None:
        if self._failed or debuggee.plc.raw_status().exception is None:
            return
        self._failed = True
        self._output(f"The program stopped: {debuggee.plc.status().exception}.\n", "stderr")
        if debuggee.launched:
            self._running = False
            self._sender.event("terminated")

    # ---- tests ----

    def _run_tests(self, tests: TestRun) -> None:
        """The requests of the editor are handled before time passes, and while a program is halted."""
        status = 1
        try:
            with watched_by(self):
                status = tests.run(lambda text: self._output(text, "stdout"))
        except KeyboardInterrupt:
            pass  # the editor has ended them
        except PlcError as error:
            self._output(f"{error}\n", "stderr")
        self._running = False
        with suppress(BrokenPipeError, ConnectionError):
            self._sender.event("exited", {"exitCode": status})
            self._sender.event("terminated")

    def made(self, plc: Simulator) -> None:
        """A test has a program."""
        try:
            self._show(TestedDebuggee(plc))
        except PlcError as error:
            self._output(f"{error}\n", "stderr")
            return
        debugger = self._breakpoints()
        for changed in self._wanted.install(debugger):
            self._sender.event("breakpoint", {"reason": "changed", "breakpoint": changed})
        self._go_on()

    def before(self, plc: Simulator) -> None:
        """A test lets time pass."""
        while not self._done and not self._requests.empty():
            self._one_turn()
        self._check_not_done()
        if self._entry and self._debugger is not None:
            self._debugger.pause()

    def halted(self, plc: Simulator) -> None:
        """A program is halted: returns when it has gone on."""
        if self._debuggee is None or self._debuggee.plc is not plc:
            self._show(TestedDebuggee(plc))
        debugger = self._breakpoints()
        halt = debugger.wait(0)
        if halt is None:
            return
        self._say_halted(halt)
        while debugger.halt is not None and not self._done:
            self._one_turn()
        self._check_not_done()

    def _check_not_done(self) -> None:
        if self._done:
            self._close()
            raise KeyboardInterrupt

    def closed(self, plc: Simulator) -> None:
        """A test has ended its program."""
        if self._debuggee is not None and self._debuggee.plc is plc:
            if self._debugger is not None:
                self._wanted.forget(self._debugger)
            self._debuggee = self._debugger = None

    def _output(self, text: str, category: str) -> None:
        self._sender.event("output", {"category": category, "output": text})

    def _close(self) -> None:
        debuggee, self._debuggee, self._debugger = self._debuggee, None, None
        self._running = False
        if debuggee is not None:
            debuggee.close()


def _parts(symbol: Symbol) -> dict[str, Symbol]:
    """The parts of a variable, named as in it."""
    return {part.name.removeprefix(symbol.name).removeprefix("."): part for part in symbol.parts()}


def _shown(value: Any) -> str:
    return str(value).upper() if isinstance(value, bool) else str(value)


_REQUESTS: dict[str, Callable[[Adapter, Message], Message]] = {
    "initialize": Adapter._initialize,
    "launch": Adapter._launch,
    "attach": Adapter._attach,
    "configurationDone": Adapter._configuration_done,
    "setBreakpoints": Adapter._set_breakpoints,
    "dataBreakpointInfo": Adapter._data_breakpoint_info,
    "setDataBreakpoints": Adapter._set_data_breakpoints,
    "setExceptionBreakpoints": Adapter._set_exception_breakpoints,
    "threads": Adapter._threads,
    "stackTrace": Adapter._stack_trace,
    "scopes": Adapter._scopes,
    "variables": Adapter._variables,
    "setVariable": Adapter._set_variable,
    "evaluate": Adapter._evaluate,
    "exceptionInfo": Adapter._exception_info,
    "continue": Adapter._continue,
    "next": Adapter._next,
    "stepIn": Adapter._step_in,
    "stepOut": Adapter._step_out,
    "pause": Adapter._pause,
    "restart": Adapter._restart,
    "terminate": Adapter._terminate,
    "disconnect": Adapter._disconnect,
    "stepCycle": Adapter._step_cycle,  # ours, as the next ones
    "runTo": Adapter._run_to,
    "force": Adapter._force,
    "unforce": Adapter._unforce,
}
