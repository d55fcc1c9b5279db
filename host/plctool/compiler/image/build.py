"""From the typed program to the image and its symbols."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path

from plctool.compiler.base.garbage import no_collection
from plctool.compiler.base.nesting import room_for_nesting
from plctool.compiler.codegen.kept_code import KeptCode
from plctool.compiler.codegen.link import Linked, link
from plctool.compiler.codegen.lower import Lowered, lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.codegen.objects import emit_objects
from plctool.compiler.codegen.stack import CallGraph, Frames
from plctool.compiler.image.io_configuration import assign_tasks, configuration_of, describe_program, io_document
from plctool.compiler.image.online_change import Steps, check_facts, constants_of, device_facts, facts_of, tasks_of
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.compiler.syntax.library import is_standard
from plctool.compiler.typed.kept import kept_parts, kept_variables
from plctool.compiler.typed.nodes import (
    Direction,
    Export,
    External,
    Pou,
    PouKind,
    ScalarInit,
    Task,
    TaskPart,
    TypedProgram,
)
from plctool.compiler.typed.online_change import OnlineChange
from plctool.core import lib
from plctool.debug.frames import INSTANCE
from plctool.debug.symbols import CodeUnit, KeptName, SymbolTable, symbol_path
from plctool.debug.variables import Symbol, constant_symbol
from plctool.files import write_atomically
from plctool.iec.areas import Area
from plctool.iec.types import CLASS_NUMBER, Type, base_of
from plctool.iec.values import encode
from plctool.image.c_functions import find_c_function
from plctool.image.file import (
    NO_AREA,
    ApplicationInfo,
    ExternalFunction,
    Image,
    ImageChange,
    ImageEvent,
    ImageExport,
    ImagePart,
    ImageTask,
    build_image,
    image_crc,
    packed_steps,
)
from plctool.image.limits import Need, largest, needs_of_image, of_area
from plctool.image.targets import Machine, Target
from plctool.io.configuration import pack_configuration

_UNIT = int(lib.CDL_IMAGE_UNIT)
_CODE_ALIGN = int(lib.APP_CODE_ALIGN)


@dataclass(frozen=True)
class BuildResult:
    """An image and its symbols. `sizes`: bytes of code made from each POU's source, inlined copies included; `needs`:
    what a device must have room for, by the names of `limits.py`; `dumps`: what a pass has left of each
    part, if that is asked for."""

    image: bytes
    symbols: SymbolTable
    sizes: dict[str, int] = field(default_factory=dict)
    needs: dict[str, Need] = field(default_factory=dict)
    dumps: list[str] = field(default_factory=list)
    warnings: list[Diagnostic] = field(default_factory=list)
    rendered_warnings: list[str] = field(default_factory=list)
    change: OnlineChange | None = None

    @property
    def crc(self) -> int:
        return self.symbols.image_crc

    def write(self, path: Path) -> None:
        """Writes the image to `path` and the symbol file beside it. Raises UsageError when that is not possible."""
        self.symbols.save(symbol_path(path))
        write_atomically(path, self.image)


def build_program(
    program: TypedProgram,
    options: Options,
    info: ApplicationInfo | None = None,
    *,
    keeps: bool = True,
    change: OnlineChange | None = None,
    code: KeptCode | None = None,
    changed: Collection[Pou] | None = None,
) -> BuildResult:
    """Compiles a checked program. `keeps`: whether RETAIN and PERSISTENT variables outlive a start. `change`: how it
    takes the place of the program that runs; what is in the way is added to it. `code`: that of the last build in this
    process, which is kept; `changed`: the units that differ from it, as in `KeptCode.lower`. Raises UsageError when the
    target cannot run it."""
    with no_collection():
        with room_for_nesting():
            lowered = lower(program, options) if code is None else code.lower(program, options, changed)
        is_kept = code is not None and not options.passes.dump_after
        objects = emit_objects(lowered.parts, options, code.objects_of(lowered.parts) if code and is_kept else ())
        if code is not None:
            code.keep_objects(lowered.parts, objects)
        return _build(program, options, info or ApplicationInfo(), keeps, change, lowered, objects)


def _build(
    program: TypedProgram,
    options: Options,
    info: ApplicationInfo,
    keeps: bool,
    change: OnlineChange | None,
    lowered: Lowered,
    objects: list[bytes],
) -> BuildResult:
    target = options.target
    linked = link(objects, target, lowered.entries, lowered.imports, options.cache)
    symbols = _symbols(program, lowered, linked, target, info.project, steps=options.steps)
    kept = kept_parts(v for v in program.globals if keeps and v.area is Area.RETAIN)
    code, io, devices = linked.code, None, []
    if program.io is not None and program.io.connectors:
        assign_tasks(program, program.io)
        describe_program(program, info, program.io)
        tables = configuration_of(program, program.io)
        configuration, devices = pack_configuration(tables), device_facts(tables)
        code += bytes(-len(code) % _CODE_ALIGN)
        io = (len(code), len(configuration))
        code += configuration
        symbols.io = io_document(program, program.io)
    tasks = [_task(task, _entry(linked, name, target)) for task, name in zip(program.tasks, lowered.tasks, strict=True)]
    device_id = options.device_id or int(getattr(lib, target.device_id))
    symbols.online = facts_of(tasks, device_id, devices)
    symbols.online["constants"] = constants_of(program.globals, program.defaults)
    areas = {area.value: size for area, size in program.area_sizes.items() if area is not Area.CODE}
    changes = None
    if change is not None:
        symbols.online["base"] = change.previous.crc
        check_facts(change, symbols.online, target.name)
        change.tasks = tasks_of(change, symbols.online)
        code += bytes(-len(code) % _CODE_ALIGN)
        changes = _image_change(program, lowered, linked, target, change, len(code), areas)
        code += packed_steps(changes)
    symbols.kept = [KeptName(part.name, part.type, part.persistent, part.size) for part in kept]
    image = Image(
        device_id=device_id,
        code=code,
        areas=areas,
        functions={number: _entry(linked, name, target) for number, name in lowered.functions.items()},
        externals=[
            ExternalFunction(e.name, e.signature, e.version, slot * target.pointer_size)
            for slot, e in enumerate(linked.imports)
        ],
        tasks=tasks,
        info=info,
        events=[
            ImageEvent(event.event, event.name, _entry(linked, name, target))
            for event, name in zip(program.events, lowered.events, strict=True)
        ],
        exports=[
            _export(export, _entry(linked, name, target) if name else None)
            for export, name in zip(program.exports, lowered.exports, strict=True)
        ],
        kept=kept_variables(kept),
        io=io,
        change=changes,
    )
    built = build_image(image)
    symbols.image_crc = image_crc(built)
    sizes = code_sizes(symbols, len(linked.code))
    needs = _needs(program, lowered, linked, image, len(built), sizes, options)
    symbols.stack = needs["stack"]
    return BuildResult(built, symbols, sizes, needs, change=change)


def _export(export: Export, entry: int | None) -> ImageExport:
    variable = export.variable
    area, offset, size = (
        (NO_AREA, 0, 0) if variable is None else (variable.area.value, variable.offset, variable.type.size)
    )
    return ImageExport(export.name, export.signature, area, offset, size, entry)


def _image_change(
    program: TypedProgram,
    lowered: Lowered,
    linked: Linked,
    target: Target,
    change: OnlineChange,
    place: int,
    areas: dict[int, int],
) -> ImageChange:
    transient = {(pou.instance, v.offset) for pou, vs in lowered.transient.items() if pou.instance for v in vs}
    passed = {
        (pou.instance, p.variable.offset)
        for pou in program.pous
        if pou.instance is not None
        for p in pou.parameters
        if p.direction is Direction.IN_OUT
    }
    init = _entry(linked, lowered.change_init, target) if lowered.change_init else None
    steps = Steps(change, program.defaults, transient, passed, areas).all()
    return ImageChange(change.previous.crc, init, place, tuple(steps))


def _needs(
    program: TypedProgram,
    lowered: Lowered,
    linked: Linked,
    image: Image,
    size: int,
    sizes: dict[str, int],
    options: Options,
) -> dict[str, Need]:
    needs = needs_of_image(image, size)
    for area in program.area_sizes:
        parts = ((v.name, v.type.size) for v in program.globals if v.area is area)
        name = of_area(area)
        if name in needs:
            needs[name] = replace(needs[name], parts=largest(parts))
    for name in ("code", "image"):
        needs[name] = replace(needs[name], parts=tuple(sizes.items()))
    roots = [linked.symbols[name].offset for name in lowered.entries]
    # A stub takes what its C function takes.
    of_c = {offset: _stack_of(external, options) for offset, external in linked.stubs.items()}
    stubs: Frames = {offset: (0, size) for offset, size in of_c.items() if size is not None}
    chain = CallGraph(linked.code, options.target.machine, linked.frames | stubs).deepest(roots)
    names = {symbol.offset: name for name, symbol in linked.symbols.items()}
    names |= {offset: external.name for offset, external in linked.stubs.items()}
    names |= {linked.symbols[name].offset: pou.name for name, pou in lowered.pous.items() if name in linked.symbols}
    names |= {linked.symbols[name].offset: task.name for name, task in zip(lowered.tasks, program.tasks, strict=True)}
    frames: Counter[str] = Counter()
    for offset, frame in chain:
        frames[names[offset]] += frame
    # On Linux stacks are large.
    are_known = options.target.hosted or len(stubs) == len(linked.imports)
    at_least = program.may_recurse or not are_known
    needs["stack"] = Need(frames.total(), largest((+frames).items()), deepest=True, at_least=at_least)
    return needs


def _stack_of(external: External, options: Options) -> int | None:
    """Bytes that a call of a C function takes: in the firmware that is at hand, else in any of this repository. What
    those of the runtime call by pointer is of no account."""
    known = find_c_function(external.name, external.signature)
    size = None
    if options.firmware is not None:
        size = options.firmware.of_function(external.signature, with_pointers=known is not None)
    return known.stack(options.target.machine) if size is None and known is not None else size


def _entry(linked: Linked, name: str, target: Target) -> int:
    """What the runtime adds to the address of the code to call a function; odd in Thumb code."""
    return linked.symbols[name].offset | (target.machine in (Machine.THUMB, Machine.THUMB_V6M))


def _task(task: Task, entry: int) -> ImageTask:
    event, ignored = None, 0
    if task.event is not None:
        event = (task.event.variable.area.value, task.event.variable.offset + task.event.offset)
        ignored = 0 if task.event.bit is None else 0xFF ^ 1 << task.event.bit
    return ImageTask(
        task.name,
        task.kind.value,
        task.priority,
        task.interval_us,
        entry,
        task.watchdog_us,
        task.watchdog_sensitivity,
        event,
        ignored,
        task.external,
        (_part(task, Area.INPUT), _part(task, Area.OUTPUT)),
    )


def _part(task: Task, area: Area) -> ImagePart:
    part = task.parts.get(area, TaskPart())
    return ImagePart(part.start // _UNIT, (part.end - part.start) // _UNIT, part.written, part.shared)


def _symbols(
    program: TypedProgram, lowered: Lowered, linked: Linked, target: Target, project: str, *, steps: bool
) -> SymbolTable:
    named = (*program.globals, *program.accesses)
    variables = {v.name: Symbol(v.name, v.area.value, v.offset, v.type, v.bit, constant=v.constant) for v in named}
    units = []
    for name, pou in lowered.pous.items():
        symbol = linked.symbols.get(name)
        offset, size = (symbol.offset, symbol.size) if symbol else (0, 0)
        units.append(CodeUnit(pou.name, offset, size, pou.pos.file, pou.pos.line, _temporaries(pou)))
    units.sort(key=lambda u: (u.offset, u.name))
    files: dict[str, int] = {}
    lines = []
    for line in linked.lines:
        index = files.setdefault(line.file, len(files)) if line.file else -1
        lines.append((line.address, index, line.line))
    table = SymbolTable(
        0,
        target.name,
        project,
        [t.name for t in program.tasks],
        variables,
        units,
        lines,
        list(files),
        program.aliases,
        _classes(program),
        {n: constant_symbol(n, c.type, encode(base_of(c.type), c.value)) for n, c in program.constants.items()},
        linked.debug,
        bounds=lowered.bounds,
        passed_lines=lowered.passed_lines,
        unkept=_unkept(lowered),
        internal=_internal(lowered),
        frames=_frames(lowered) if steps else {},
    )
    # Without the variables that are not in memory the types are others than those of the program.
    return SymbolTable.from_json(table.to_json()) if table.unkept else table


def _unkept(lowered: Lowered) -> dict[str, list[str]]:
    """The variables of function blocks that are not in memory, by the name of the block."""
    found = {}
    for pou, variables in lowered.transient.items():
        assert pou.instance is not None
        offsets = {variable.offset for variable in variables}
        if offsets:
            found[pou.instance.name] = [f.name for f in pou.instance.fields if f.offset in offsets]
    return found


def _internal(lowered: Lowered) -> dict[str, list[str]]:
    """The variables of blocks of the standard library that are not parameters, by the name of the block."""
    found = {}
    for pou in lowered.pous.values():
        if pou.instance is not None and is_standard(pou.pos.file):
            parameters = {parameter.variable.name for parameter in pou.parameters}
            names = [f.name for f in pou.instance.fields if f.name not in parameters and "%" not in f.name]
            if names:
                found[pou.instance.name] = names
    return found


def _temporaries(pou: Pou) -> list[str]:
    """The variables of a unit that live only while it runs."""
    variables = list(pou.locals)
    if pou.kind in (PouKind.FUNCTION, PouKind.METHOD):
        variables += [p.variable for p in pou.parameters]
    return [v.name for v in variables if "%" not in v.name]


def _frames(lowered: Lowered) -> dict[str, dict[str, Type]]:
    """The types of what is on the stack, or of what pointers on it lead to."""
    found: dict[str, dict[str, Type]] = {}
    for pou in lowered.pous.values():
        variables = [*pou.locals, *(p.variable for p in pou.parameters)]
        found[pou.name] = {v.name: v.type for v in variables if "%" not in v.name}
        if pou.instance is not None:
            found[pou.name][INSTANCE] = pou.instance
    return found


def _classes(program: TypedProgram) -> dict[str, int]:
    numbers = {name: init.members.get(CLASS_NUMBER) for name, init in program.defaults.items()}
    return {name: int(n.value) for name, n in numbers.items() if isinstance(n, ScalarInit)}


def code_sizes(symbols: SymbolTable, code_size: int) -> dict[str, int]:
    """Bytes of code by the POU whose source they come from, largest first."""
    starts: dict[str, list[tuple[int, str]]] = {}
    for unit in symbols.pous:
        starts.setdefault(unit.file, []).append((unit.line, unit.name))
    for units in starts.values():
        units.sort()
    sizes: dict[str, int] = {}
    ends = [*(line[0] for line in symbols.lines[1:]), code_size]
    for (offset, index, number), end in zip(symbols.lines, ends, strict=False):
        units = starts.get(symbols.files[index], []) if index >= 0 else []
        at = bisect_right(units, (number, "\U0010ffff")) - 1
        if at >= 0 and number:
            sizes[units[at][1]] = sizes.get(units[at][1], 0) + end - offset
    return dict(sorted(sizes.items(), key=lambda item: -item[1]))
