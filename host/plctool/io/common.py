"""What the tables of all kinds have in common: name, task, optional, enabled."""

from __future__ import annotations

from typing import TypeVar

from plctool.core import lib
from plctool.io.model import Connector
from plctool.io.names import MAX_NAME, is_name
from plctool.io.tables import Table

C = TypeVar("C", bound=Connector)


def read_connector(
    made: type[C],
    table: Table,
    driver: str,
    *,
    default_name: str = "",
    parent: Connector | None = None,
    kind: int | None = None,
) -> C:
    """A connector of the class `made` with the keys `name`, `task`, `optional` and `enabled` of a table.

    With `name` it has a variable of that name in the program; without `default_name` the name is required. `kind`:
    CT_*, for other than master and slave. What is on a line that is not enabled is not enabled either."""
    name = table.text("name", required="" if default_name else "Drive1")
    if name is not None and not is_name(name):
        what = f"the name of a device is one of a variable, with at most {MAX_NAME} letters, digits and _"
        table.error(f"'{name}' cannot be a variable; {what}", "name")
        name = None
    pos = table.value_pos("name") if name is not None else table.pos
    connector = made(name or default_name or f"{table.name}@{pos.line}", driver, pos)
    connector.parent = parent
    connector.type = kind if kind is not None else int(lib.CT_SLAVE if parent is not None else lib.CT_MASTER)
    connector.variable = name is not None
    connector.optional = table.flag("optional")
    connector.enabled = table.flag("enabled", True) and (parent is None or parent.enabled)
    connector.task = table.text("task")
    connector.task_pos = table.value_pos("task")
    return connector
