"""The diagrams of the program that a page is about, drawn from the sources beside it.

A diagram may be of several instances; each is one entry. Values are not in the picture: the page fills them in.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.debug.symbols import SymbolTable
from plctool.errors import UsageError
from plctool.iec.types import StructType

if TYPE_CHECKING:
    from plctool.doc.drawn import Diagram

_MOST = 200  # entries
_DEPTH = 8  # of instances in instances
_LOOKED_AT = 20_000  # variables


class Drawings:
    """`folders`: where the sources may be, the project first."""

    def __init__(self, folders: Sequence[Path]) -> None:
        self._folders = folders
        self._diagrams: dict[str, Diagram] | None = None

    def listed(self, table: SymbolTable) -> list[dict[str, str]]:
        """Returns the instances that have a diagram: name, POU and language."""
        return [
            {"name": name, "pou": diagram.name, "language": diagram.language}
            for name, diagram in self._instances(table).items()
        ]

    def picture(self, table: SymbolTable, name: str) -> dict[str, Any]:
        """Returns the SVG of an instance, and the variables that it shows. Raises UsageError."""
        from plctool.doc.monitor import Monitor, monitored
        from plctool.doc.network import picture

        diagram = self._instances(table).get(name)
        if diagram is None:
            raise UsageError(f"{name} has no diagram.", "no-diagram")
        instance = name.removesuffix(f".{diagram.name.partition('.')[2]}") if "." in diagram.name else name
        names = monitored(diagram, instance, table)
        return {"svg": picture(name, diagram, Monitor(names)), "names": sorted(set(names.values()))}

    def _instances(self, table: SymbolTable) -> dict[str, Diagram]:
        if self._diagrams is None:
            self._diagrams = _read(self._folders)
        by_unit: dict[str, list[Diagram]] = {}
        for diagram in self._diagrams.values():
            by_unit.setdefault(diagram.name.partition(".")[0].casefold(), []).append(diagram)
        found: dict[str, Diagram] = {}
        for name, unit in _units(table):
            for diagram in by_unit.get(unit.casefold(), []):
                member = diagram.name.partition(".")[2]
                found[f"{name}.{member}" if member else name] = diagram
            if len(found) >= _MOST:
                break
        return found


def _units(table: SymbolTable) -> list[tuple[str, str]]:
    """The programs and instances of function blocks: name and type."""
    found: list[tuple[str, str]] = []
    programs: set[str] = set()
    waiting = [(name, symbol.type, 0) for name, symbol in table.variables.items() if "%" not in name]
    for name, type_, depth in waiting:
        if len(waiting) > _LOOKED_AT:
            break
        program = name.partition(".")[0]
        if program not in programs:
            programs.add(program)
            found.append((program, program))
        if isinstance(type_, StructType) and depth < _DEPTH:
            found.append((name, type_.name))
            waiting += [(f"{name}.{f.name}", f.type, depth + 1) for f in type_.fields]
    return found


def _read(folders: Sequence[Path]) -> dict[str, Diagram]:
    from plctool.compiler import load_sources
    from plctool.doc.drawn import diagrams
    from plctool.project import PROJECT_FILE

    folder = next((f for f in folders if (f / PROJECT_FILE).is_file()), next(iter(folders), None))
    return {} if folder is None else diagrams(load_sources([folder]))
