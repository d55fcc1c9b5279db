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
from plctool.dap.debuggees import Debuggee, attach, launch
from plctool.dap.messages import Message, Sender
from plctool.debug.breakpoints import Debugger, Halt
from plctool.debug.expressions import NAME
from plctool.debug.halted import Call
from plctool.debug.variables import Symbol
from plctool.errors import PlcError, UsageError
from plctool.iec.types import ArrayType, StructType

_SLICE = 0.02  # between two looks at requests while the program runs [s]
_MOST_CAUGHT_UP = 0.2  # of virtual time [s]
_HITS = re.compile(r"\s*(>=|>|=|==)?\s*(\d{1,9})\s*")
_ASSIGNMENT = re.compile(r"\s*(\S+)\s*:=\s*(.+)")

Named = Callable[[], dict[str, Symbol]]
"""Variables by the names they are shown with."""

CAPABILITIES = {
    "supportsConfigurationDoneRequest": True,
    "supportsConditionalBreakpoints": True,
    "supportsHitConditionalBreakpoints": True,
    "supportsLogPoints": True,
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
        self._running = False
        self._done = False
        self._entry = False  # the next pause is the halt at the beginning
        self._failed = False  # an exception was reported
        self._first_line = 1
        self._files: dict[str, list[int]] = {}  # the numbers of breakpoints, by the path of the editor
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
        if self._running and not self._done:
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

    def _initialize(self, arguments: Message) -> Message:
        self._first_line = 1 if arguments.get("linesStartAt1", True) else 0
        return dict(CAPABILITIES)

    def _launch(self, arguments: Message) -> Message:
        return self._begin(launch(arguments), bool(arguments.get("stopOnEntry")))

    def _attach(self, arguments: Message) -> Message:
        return self._begin(attach(arguments), bool(arguments.get("stopOnEntry")))

    def _begin(self, debuggee: Debuggee, entry: bool) -> Message:
        if self._debuggee is not None:
            debuggee.close()
            raise UsageError("A program is being debugged already; disconnect first.", "dap")
        self._debuggee = debuggee
        self._debugger = debuggee.plc.breakpoints
        self._debugger.output = lambda text: self._output(text + "\n", "console")
        self._entry = entry
        return {}

    def _plc(self) -> Debuggee:
        if self._debuggee is None:
            raise UsageError("Nothing is debugged yet: send launch or attach.", "dap")
        return self._debuggee

    def _breakpoints(self) -> Debugger:
        self._plc()
        assert self._debugger is not None
        return self._debugger

    def _configuration_done(self, arguments: Message) -> Message:
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
        debugger = self._breakpoints()
        path = str(arguments["source"].get("path") or arguments["source"].get("name") or "")
        for number in self._files.pop(path, []):
            with suppress(UsageError):
                debugger.clear(number)
        wanted = arguments.get("breakpoints") or [{"line": line} for line in arguments.get("lines") or []]
        numbers = self._files.setdefault(path, [])
        return {"breakpoints": [self._set_breakpoint(path, entry, numbers) for entry in wanted]}

    def _set_breakpoint(self, path: str, wanted: Message, numbers: list[int]) -> Message:
        try:
            made = self._breakpoints().set(
                path,
                int(wanted["line"]) + 1 - self._first_line,
                condition=str(wanted.get("condition") or ""),
                hits=_hits(str(wanted.get("hitCondition") or "")),
                log=str(wanted.get("logMessage") or ""),
            )
        except PlcError as error:
            return {"verified": False, "line": wanted.get("line"), "message": str(error)}
        numbers.append(made.number)
        return {"id": made.number, "verified": True, "line": made.line - 1 + self._first_line}

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
        self._calls = halt.calls
        first = int(arguments.get("startFrame") or 0)
        count = int(arguments.get("levels") or 0) or len(self._calls)
        frames = [self._frame(i, call) for i, call in enumerate(self._calls)]
        return {"stackFrames": frames[first : first + count], "totalFrames": len(frames)}

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
            self._calls = self._calls or self._halt().calls
            return self._calls[0] if self._calls else None
        if not 1 <= frame <= len(self._calls):
            raise UsageError(f"There is no frame {frame}.", "dap")
        return self._calls[frame - 1]

    def _scopes(self, arguments: Message) -> Message:
        halted, call = self._halt().halted, self._call(arguments["frameId"])
        if call is None:
            return {"scopes": []}
        table = self._breakpoints().table
        scopes: list[tuple[str, Named, bool]] = [
            ("Locals", lambda: halted.locals(call), False),
            (call.pou, lambda: halted.instance(call), False),
            ("Globals", lambda: {symbol.name: symbol for symbol in table.find([])}, True),
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

    def _pause(self, arguments: Message) -> Message:
        self._breakpoints().pause()
        return {}

    def _restart(self, arguments: Message) -> Message:
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
        if self._debuggee is not None and not self._debuggee.launched:
            self._debuggee.plc.end_debugging()
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
        if halt.breakpoints:
            body["hitBreakpointIds"] = [b.number for b in halt.breakpoints]
        self._sender.event("stopped", body)

    def _look_for_exception(self, debuggee: Debuggee) -> None:
        if self._failed or debuggee.plc.raw_status().exception is None:
            return
        self._failed = True
        self._output(f"The program stopped: {debuggee.plc.status().exception}.\n", "stderr")
        if debuggee.launched:
            self._running = False
            self._sender.event("terminated")

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


def _hits(text: str) -> int:
    """From the hit on that a hit condition says. Raises UsageError."""
    if not text:
        return 1
    match = _HITS.fullmatch(text)
    if match is None or match[1] in ("=", "=="):
        raise UsageError(f"'{text}' is not a number of hits; write for example 5, or > 5.", "hits")
    return int(match[2]) + (match[1] == ">")


def _shown(value: Any) -> str:
    return str(value).upper() if isinstance(value, bool) else str(value)


_REQUESTS: dict[str, Callable[[Adapter, Message], Message]] = {
    "initialize": Adapter._initialize,
    "launch": Adapter._launch,
    "attach": Adapter._attach,
    "configurationDone": Adapter._configuration_done,
    "setBreakpoints": Adapter._set_breakpoints,
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
    "force": Adapter._force,
    "unforce": Adapter._unforce,
}
