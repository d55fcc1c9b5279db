"""The code of a program that stays in a process: after a change of statements only the changed functions are written
and compiled again.

What is kept is used only if the module is the one that `lower()` would write: the changed functions refer to the same
others in the same order, and what callers know of them has not changed.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from plctool.compiler.codegen.lower import Entries, Lowered, finished, lower_into, write_pou
from plctool.compiler.codegen.lower_unit import Form, Options, Unit
from plctool.compiler.codegen.partition import KnownParts, Part
from plctool.compiler.codegen.sections import sections
from plctool.compiler.codegen.signatures import block_signatures
from plctool.compiler.typed.analysis import Effects
from plctool.compiler.typed.nodes import Dispatch, External, Pou, StructInit, TypedProgram, Variable
from plctool.debug.bounds import BoundsCheck
from plctool.iec.areas import Area
from plctool.iec.types import StructType

_Key = tuple[Pou, Form]


class _Noting(Unit):
    """Notes what a function refers to while it is written."""

    def __init__(self, options: Options, area_sizes: dict[Area, int], defaults: dict[str, StructInit]) -> None:
        super().__init__(options, area_sizes, defaults)
        self.asked_for: list[object] = []

    def symbol(self, pou: Pou, form: Form = Form.PLAIN) -> str:
        self.asked_for.append((pou, form))
        return super().symbol(pou, form)

    def target_of(self, pou: Pou, dispatch: Dispatch | None, form: Form) -> str:
        self.asked_for.append((pou, dispatch, form))
        return super().target_of(pou, dispatch, form)

    def initialiser(self, struct: StructType) -> str:
        self.asked_for.append(struct)
        return super().initialiser(struct)

    def import_slot(self, external: External) -> int:
        self.asked_for.append(external)
        return super().import_slot(external)


@dataclass(frozen=True)
class _Written:
    """A function: what it refers to, each once, and the bounds that it checks."""

    asked_for: list[object]
    bounds: list[BoundsCheck]


class KeptCode:
    """The module of the last build, and the objects of its parts."""

    def __init__(self) -> None:
        self._unit: _Noting | None = None
        self._entries = Entries([], {}, [], [])
        self._written: dict[_Key, _Written] = {}
        self._inlining: dict[str, str] = {}  # of all functions, before the parts are cut
        self._effects: dict[Pou, tuple[bool, bool]] = {}
        self._places: list[tuple[Variable, int]] = []
        self._parts = KnownParts()
        self._objects: dict[Part, bytes] = {}
        self._options: Options | None = None

    def lower(self, program: TypedProgram, options: Options, changed: Collection[Pou] | None) -> Lowered:
        """Returns what `lower()` does. `changed`: the units whose bodies differ from those of the last call, if the
        program and the options are the same otherwise; None if they may not be."""
        unit, self._unit = self._unit, None  # nothing is kept of what fails
        if unit is None or changed is None or not self._write_again(unit, program, changed):
            unit = self._write_all(program, options)
        for name, inlining in self._inlining.items():
            unit.module.functions[name].function.inlining = inlining
        self._places = _places(program)
        lowered = finished(program, unit, self._entries, self._parts)
        self._unit = unit if self._may_be_kept(unit) else None
        return lowered

    def objects_of(self, parts: Sequence[Part]) -> list[bytes | None]:
        """Returns the objects of those parts that the last build had, too."""
        return [self._objects.get(part) for part in parts]

    def keep_objects(self, parts: Sequence[Part], objects: Sequence[bytes]) -> None:
        """Keeps the objects of a build."""
        self._objects = dict(zip(parts, objects, strict=True))

    def _may_be_kept(self, unit: _Noting) -> bool:
        """True if what is written of a function depends on nothing but what is compared."""
        bounds = [check for written in self._written.values() for check in written.bounds]
        is_plain = unit.trail_variable is None and not unit.exchanges and not unit.options.passes.dump_after
        return is_plain and not unit.module.collided and unit.bounds == bounds

    def _write_all(self, program: TypedProgram, options: Options) -> _Noting:
        self._written, self._effects = {}, {}
        self._parts.clear()
        if options != self._options:
            self._objects, self._options = {}, options
        unit = _Noting(options, program.area_sizes, program.defaults)
        self._entries = lower_into(unit, program, self._write)
        self._inlining = {name: d.function.inlining for name, d in unit.module.functions.items()}
        return unit

    def _write(self, unit: Unit, pou: Pou, effects: Effects, form: Form) -> None:
        assert isinstance(unit, _Noting)
        unit.asked_for, count = [], len(unit.bounds)
        write_pou(unit, pou, effects, form)
        self._written[pou, form] = _Written(list(dict.fromkeys(unit.asked_for)), unit.bounds[count:])
        self._effects[pou] = _known_of(pou, effects)

    def _write_again(self, unit: _Noting, program: TypedProgram, changed: Collection[Pou]) -> bool:
        """Writes the functions of units again. False if others may differ, too; then nothing may be kept."""
        signatures = block_signatures(program, unit.options)
        if (
            (signatures.handed, signatures.transient, signatures.closed) != (unit.handed, unit.transient, unit.closed)
            or unit.area_sizes != program.area_sizes
            or self._places != _places(program)
        ):
            return False
        effects = Effects()
        reached = [pou for pou in changed if pou in self._effects]
        return all(self._write_unit(unit, pou, effects) for pou in reached)

    def _write_unit(self, unit: _Noting, pou: Pou, effects: Effects) -> bool:
        if _known_of(pou, effects) != self._effects[pou] or len(sections(pou)) > 1:
            return False
        forms = {form: name for (of, form), name in unit.pous.items() if of is pou}
        for name in forms.values():
            scope = unit.module.functions[name].function.scope
            if scope >= 0:
                unit.forget_subprogram(scope)
        for form, name in forms.items():
            before = self._written[pou, form]
            self._write(unit, pou, effects, form)
            if self._written[pou, form].asked_for != before.asked_for:
                return False
            self._inlining[name] = unit.module.functions[name].function.inlining
        unit.bounds = [check for written in self._written.values() for check in written.bounds]
        return True


def _known_of(pou: Pou, effects: Effects) -> tuple[bool, bool]:
    """What the code of callers depends on."""
    return effects.is_local(pou), effects.renews_in_outs(pou)


def _places(program: TypedProgram) -> list[tuple[Variable, int]]:
    return [(variable, variable.offset) for variable in program.globals]
