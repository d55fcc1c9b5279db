"""PLCopen XML: configurations, resources, tasks and instances of programs.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.formats import plcopen_types as types
from plctool.compiler.formats.text import Findings, Text
from plctool.compiler.formats.twincat import identifier
from plctool.compiler.formats.xml_tree import Element
from plctool.iec.tasks import LOWEST_PRIORITY

_ISO = re.compile(r"P(?:(\d+)D)?(?:T(?:(\d+)H)?(?:(\d+)M)?(?:(\d+(?:\.\d+)?)S)?)?", re.IGNORECASE)
_CLOCK = re.compile(r"(\d+):(\d+):(\d+(?:\.\d+)?)")
_NAME = re.compile(r"\w+")  # a visualisation, which is run by a library, has a dot in it
_UNITS = {"µs": "us", "us": "us", "ms": "ms", "s": "s"}


def write_configuration(text: Text, element: Element, findings: Findings) -> None:
    """A CONFIGURATION; where it names no program, its globals alone."""
    instances = [i for i in element.every("pouInstance") if _NAME.fullmatch(i.get("typeName") or i.get("name"))]
    unnamed = [section for section in element.every("globalVars") if not section.get("name")]
    if not instances:
        for section in unnamed:
            types.block(text, section)
        return
    text.made(f"CONFIGURATION {identifier(element.get('name') or 'Config')}\n", element.at)
    for section in unnamed:
        types.block(text, section)
    of_task = {id(instance): task for task in element.every("task") for instance in task.every("pouInstance")}
    busy = {id(of_task[id(i)]) for i in instances if id(i) in of_task}
    tasks = [t for t in element.every("task") if id(t) in busy or next(t.every("pouInstance"), None) is None]
    for task in tasks:
        properties = ", ".join(_properties(task, findings))
        text.made(f"TASK {identifier(task.get('name'))}({properties});\n", task.at)
    for instance in instances:
        owner = of_task.get(id(instance))
        within = f" WITH {identifier(owner.get('name'))}" if owner is not None else ""
        program = instance.get("typeName") or instance.get("name")
        text.made(f"PROGRAM {instance.get('name')}{within} : {program};\n", instance.at)
    text.made("END_CONFIGURATION\n", element.at)


def _properties(task: Element, findings: Findings) -> list[str]:
    settings = next(task.every("TaskSettings"), None)
    kind = settings.get("KindOfTask", "Cyclic") if settings is not None else "Cyclic"
    found = []
    if task.get("single"):
        found.append(f"SINGLE := {task.get('single')}")
    elif settings is not None and kind in ("Event", "Status") and settings.get("Event"):
        found.append(f"SINGLE := {settings.get('Event')}")
    elif kind not in ("Cyclic", "Freewheeling"):
        findings.add(task.at, "xml", f"the task {task.get('name')} is of the kind {kind}; only cyclic tasks are read")
    elif kind == "Cyclic":
        interval = duration(task.get("interval")) or _setting(settings)
        found += [f"INTERVAL := {interval}"] if interval else []
    if task.get("priority").isdecimal():
        found.append(f"PRIORITY := {min(int(task.get('priority')), LOWEST_PRIORITY)}")
    return found


def _setting(settings: Element | None) -> str:
    if settings is None:
        return ""
    text, unit = settings.get("Interval"), _UNITS.get(settings.get("IntervalUnit", "ms").lower(), "ms")
    return duration(f"T#{text}{unit}" if text.isdecimal() else text)


def duration(text: str) -> str:
    """Returns `PT0.02S` and `00:00:00.020000` as a literal; other text, such as `T#20ms` or the name of a constant, as
    it is."""
    match = _ISO.fullmatch(text)
    clock = _CLOCK.fullmatch(text)
    if clock is not None:
        days, (hours, minutes, seconds) = 0.0, map(float, clock.groups())
    elif match is not None and text[1:]:
        days, hours, minutes, seconds = (float(part or 0) for part in match.groups())
    else:
        return text
    return f"LTIME#{round((((days * 24 + hours) * 60 + minutes) * 60 + seconds) * 1_000_000)}us"
