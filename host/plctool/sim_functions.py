"""Functions of a simulated program that Python implements."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from plctool.core import Core, lib
from plctool.errors import UsageError
from plctool.iec.types import StringType, Type
from plctool.iec.values import decode, encode

if TYPE_CHECKING:
    from plctool.compiler.typed.nodes import Pou

_FAILED = int(lib.RTSEXCPT_NONCONTINUABLE)  # what the program ends with when Python raises


class Output:
    """A VAR_OUTPUT or VAR_IN_OUT of a function: `value` is that of the caller's variable, and may be set."""

    def __init__(self, core: Core, t: Type, address: Any) -> None:
        self._core, self._type, self._address = core, t, address

    @property
    def value(self) -> Any:
        return _read(self._core, self._type, self._address)

    @value.setter
    def value(self, value: Any) -> None:
        _write(self._core, self._type, self._address, value)


class EndProgram(Exception):
    """A function ends the program that calls it, with an exception of the runtime (RTSEXCPT_*)."""

    def __init__(self, exception: int) -> None:
        super().__init__(exception)
        self.exception = exception


@dataclass(frozen=True)
class _Function:
    """`parameters`: their types, and whether they are inputs. `result`: None without."""

    name: str
    python: Callable[..., Any]
    parameters: Sequence[tuple[Type, bool]]
    result: Type | None


class SimFunctions:
    """`units`: what the functions are declared as, in the order of `functions`."""

    def __init__(self, functions: Mapping[str, Callable[..., Any]] | None = None, units: Sequence[Pou] = ()) -> None:
        pythons = (functions or {}).values()
        self._functions = [
            _Function(
                unit.name,
                python,
                [(p.variable.type, p.direction.value == "VAR_INPUT") for p in unit.parameters],
                unit.result.type if unit.result else None,
            )
            for unit, python in zip(units, pythons, strict=True)
        ]
        self._busy = False
        self._raised: BaseException | None = None
        self._callback: Any = None  # C has its address

    @classmethod
    def without_parameters(cls, pythons: Sequence[Callable[[], None]]) -> SimFunctions:
        """Functions that the program knows by their index, and that take and return nothing."""
        functions = cls()
        functions._functions = [_Function(python.__name__, python, (), None) for python in pythons]
        return functions

    def connect(self, core: Core) -> None:
        """The program in this runtime calls them from now on."""

        def call(number: int, addresses: Any, result: Any) -> int:
            try:
                self._call(core, self._functions[number], addresses, result)
            except EndProgram as end:
                return end.exception
            except BaseException as error:
                self._raised = error
                return _FAILED
            return int(lib.RTSEXCPT_NOEXCEPTION)

        if self._functions:
            self._callback = core.ffi.callback("SIM_FUNCTION", call)
            core.lib.SimSetFunction(self._callback)

    def disconnect(self, core: Core) -> None:
        """The program calls none any more."""
        core.lib.SimSetFunction(core.ffi.NULL)

    @contextmanager
    def while_running(self) -> Iterator[None]:
        """The program runs meanwhile. Raises what a function raised, and UsageError within a function."""
        if self._busy:
            raise UsageError(
                "A function of the program is a part of a cycle: it cannot run the program itself.", "busy"
            )
        yield
        if self._raised is not None:
            raised, self._raised = self._raised, None
            raise raised

    def _call(self, core: Core, function: _Function, addresses: Any, result: Any) -> None:
        arguments = [
            _read(core, t, addresses[i]) if is_input else Output(core, t, addresses[i])
            for i, (t, is_input) in enumerate(function.parameters)
        ]
        self._busy = True
        try:
            value = function.python(*arguments)
        finally:
            self._busy = False
        if function.result is not None:
            if value is None:
                raise UsageError(
                    f"{function.name} in Python returns nothing; its result is {function.result}.", "python"
                )
            _write(core, function.result, result, value)


def _read(core: Core, t: Type, address: Any) -> Any:
    """A value in memory. A STRING may have less memory than its type says, where the caller's is shorter."""
    if isinstance(t, StringType):
        text = core.ffi.string(core.ffi.cast("char16_t *" if t.wide else "char *", address), t.length)
        return text if t.wide else text.decode("latin-1")
    return decode(t, bytes(core.ffi.buffer(address, t.size)))


def _write(core: Core, t: Type, address: Any, value: Any) -> None:
    data = encode(t, value)
    core.ffi.memmove(address, data, len(data))
