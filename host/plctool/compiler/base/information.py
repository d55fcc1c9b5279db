"""Information of the project: what [information] of plc.toml says, for the functions that give it to programs.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum


class PropertyKind(Enum):
    """The type of a property; the value is the word of messages."""

    TEXT = "text"
    NUMBER = "number"
    BOOL = "bool"
    VERSION = "version"


@dataclass(frozen=True)
class Property:
    """An entry of [information.properties]. A version is a str such as "1.2.0.4"."""

    kind: PropertyKind
    value: str | int | float | bool


@dataclass(frozen=True)
class Information:
    """`strings`: the keys of [information] that have a value; `properties`: by their key, as plc.toml has it. `file`:
    the name of the project file; "" without one."""

    strings: Mapping[str, str] = field(default_factory=dict)
    properties: Mapping[str, Property] = field(default_factory=dict)
    file: str = ""


NO_INFORMATION = Information()
