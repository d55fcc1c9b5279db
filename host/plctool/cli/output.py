"""How documents look to users: short lines and aligned columns, no decoration that disturbs other tools.

All that a command prints goes through `say`, because names, logs and errors come from devices and files that others
made.
"""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import sys
from collections.abc import Iterable, Sequence
from typing import Any, TextIO

from plctool.errors import counted
from plctool.printable import one_line, printable

_LOG_COLUMN = 27  # where the text of a log entry begins
_DIAGNOSTIC = re.compile(r"^(.+?:\d+:\d+:) (error|warning):(?= )|^(\s*\^)$|^  (pass|FAIL)(?=  )", re.MULTILINE)
_OF_SEVERAL_LINES = ("answer", "script", "page", "diff", "formatted_text")
"""The strings of documents whose line breaks are shown: of a shell, a script, a manual page and sources."""
_BOLD, _RED, _MAGENTA, _GREEN, _PLAIN = "\33[1m", "\33[1;31m", "\33[1;35m", "\33[1;32m", "\33[0m"


def say(text: str, stream: TextIO | None = None, *, colours: bool = False) -> None:
    """Prints text to a stream, by default the standard output, at once. `colours`: of diagnostics and of the results of
    tests, if the stream wants them."""
    stream = stream or sys.stdout
    safe = printable(text)
    print(coloured(safe, stream) if colours else safe, file=stream, flush=True)


def shown(value: Any) -> Any:
    """A document whose strings are parts of lines, but for those that have several lines."""
    if isinstance(value, str):
        return one_line(value)
    if isinstance(value, dict):
        return {
            one_line(name) if isinstance(name, str) else name: item if name in _OF_SEVERAL_LINES else shown(item)
            for name, item in value.items()
        }
    return [shown(item) for item in value] if isinstance(value, list | tuple) else value


def as_json(document: Any) -> str:
    """One line of JSON. It has no numbers that are infinite or NaN: these are strings."""
    return json.dumps(_for_json(document), allow_nan=False)


def _for_json(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _for_json(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_for_json(item) for item in value]
    if not isinstance(value, float) or math.isfinite(value):
        return value
    from plctool.iec.value_texts import real_text

    return real_text(value)


def wants_colour(stream: TextIO) -> bool:
    """Whether text for a stream may have colours: on a terminal with colours, unless NO_COLOR is set (no-color.org)."""
    return stream.isatty() and os.environ.get("TERM") != "dumb" and not os.environ.get("NO_COLOR")


def coloured(text: str, stream: TextIO) -> str:
    """Diagnostics with location, kind and caret in colours, and results of tests, if the stream wants them."""
    return _DIAGNOSTIC.sub(_colour, text) if wants_colour(stream) else text


def _colour(match: re.Match[str]) -> str:
    location, kind, caret, result = match.groups()
    if result:
        return f"  {_GREEN if result == 'pass' else _RED}{result}{_PLAIN}"
    if caret:
        return f"{_GREEN}{caret}{_PLAIN}"
    return f"{_BOLD}{location}{_PLAIN} {_RED if kind == 'error' else _MAGENTA}{kind}:{_PLAIN}"


def values_text(texts: dict[str, str], separator: str = "\n") -> str:
    """Names and values, as ST writes them."""
    return separator.join(f"{one_line(name)} = {one_line(text)}" for name, text in texts.items())


def table(rows: Sequence[dict[str, Any]], columns: Iterable[str]) -> str:
    """Rows under their column names; numbers are aligned right."""
    names = list(columns)
    cells = [names, *([str(row[name]) for name in names] for row in rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(names))]
    right = [bool(rows) and isinstance(rows[0][name], int | float) for name in names]
    lines = [
        "  ".join(
            cell.rjust(width) if r else cell.ljust(width) for cell, width, r in zip(line, widths, right, strict=True)
        )
        for line in cells
    ]
    return "\n".join(line.rstrip() for line in lines)


def devices_text(document: dict[str, Any]) -> str:
    """A line for each device that a scan found; what only some of them say is empty for the others."""
    columns = dict.fromkeys(name for device in document["devices"] for name in device)
    return table([{name: device.get(name, "") for name in columns} for device in document["devices"]], columns)


def place_text(place: dict[str, Any]) -> str:
    """`, Main, main.st:12` for what has a source line, else nothing."""
    return f", {place['pou']}, {place['file']}:{place['line']}" if place.get("file") else ""


def detail_text(place: dict[str, Any]) -> str:
    """What is known of an exception besides its location."""
    return f": {place['detail']}" if place.get("detail") else ""


def calls_text(place: dict[str, Any], column: int = 2) -> str:
    """A line for each call that led to a location, indented to a column."""
    return "".join(
        f"\n{'':{column}}called from {call['pou']}, {call['file']}:{call['line']}" for call in place.get("calls", [])
    )


def variables_text(document: dict[str, Any]) -> str:
    """A line for each variable of an image."""
    return table(document["variables"], ("name", "type", "area"))


def run_text(document: dict[str, Any], texts: dict[str, str]) -> str:
    """Values as ST writes them, how long it ran, and the file of a trace."""
    trace = f"; the values are in {document['trace']}" if "trace" in document else ""
    return (
        f"{values_text(texts)}\n{counted(document['cycles'], 'cycle')}, {document['time_ms']:.10g} ms{trace}".lstrip()
    )


def missing_text(document: dict[str, Any]) -> str:
    """What a program needs of libraries of other systems, a line for each name, and how much of it there is not."""
    names = document["missing"]
    rows = [
        {
            "name": n["name"],
            "library": n["library"] or "not known",
            "uses": n["count"],
            "stand-in": "yes" if n["stand_in"] else "no",
            "first at": f"{n['file']}:{n['line']}",
        }
        for n in names
    ]
    absent = [n for n in names if not n["stand_in"]]
    libraries = {n["library"] for n in absent if n["library"]}
    known = f", of which {sum(bool(n['library']) for n in absent)} seem to be of {len(libraries)} libraries"
    end = [f"{len(absent)} names are missing{known if libraries else ''}; {len(names) - len(absent)} have a stand-in."]
    if absent:
        end.append("Give their sources with the program or as a library (--library), or declare the names.")
    if others := document["other_errors"]:
        end.append(f"Errors about other things: {others}; 'plctool check' shows them.")
    return "\n".join([*([table(rows, rows[0])] if rows else []), *end])


def new_text(document: dict[str, Any]) -> str:
    """What was made, and what to type next."""
    files = "\n".join(f"  {file}" for file in document["files"])
    folder = shlex.quote(document["folder"])
    return f"{files}\nNext: cd {folder}, then 'plctool test', 'plctool run --time T#5s', 'plctool build'."


def build_text(document: dict[str, Any]) -> str:
    """What was built, and how old inputs may be."""
    lines = [f"{document['image']}: {document['size']} bytes, CRC {document['crc']}"]
    if io := document.get("io"):
        lines.append(f"{counted(io['channels'], 'channel')} of inputs and outputs")
        if oldest := io["oldest_input"]:
            lines[-1] += f"; oldest input: {oldest['channel']}, up to {age_text(oldest['age_us'])}"
        lines += [f"line {line['name']} is {line['load']:.0%} in use" for line in io["lines"]]
    return "\n".join(lines)


def age_text(age_us: int | None) -> str:
    """A time as users read it; - for one that has no limit."""
    return "-" if age_us is None else f"{age_us / 1000:g} ms"


def io_map_text(document: dict[str, Any]) -> str:
    """A line for each channel."""
    rows = [
        {**c, "tasks": ", ".join(c["tasks"]), "direction": "out" if c["output"] else "in", "age": age_text(c["age_us"])}
        for c in document["channels"]
    ]
    columns = ("device", "channel", "direction", "variable", "type", "address", "tasks", "age")
    return table(rows, columns) if rows else "This image has no inputs and outputs but memory; see docs/io.md."


def io_status_text(document: dict[str, Any]) -> str:
    """A line for each device."""
    rows = [
        {**d, "age": "-" if d["age_ms"] is None else f"{d['age_ms']} ms", "device": d["name"]}
        for d in document["devices"]
    ]
    columns = ("device", "driver", "state", "age", "errors", "skipped")
    return table(rows, columns) if rows else "The program has no devices."


def io_scan_text(document: dict[str, Any]) -> str:
    """A line for each device on a bus."""
    rows = [{**d, **{k: f"0x{d[k]:X}" for k in ("vendor", "product", "revision")}} for d in document["devices"]]
    columns = ("slot", "name", "vendor", "product", "revision")
    return table(rows, columns) if rows else f"Nothing answers on {document['bus']}."


def interface_text(document: dict[str, Any]) -> str:
    """The functions of a C interface, and the files."""
    kept = "" if document["source_written"] else " (kept as it is; --force replaces it)"
    functions = table(document["functions"], document["functions"][0])
    return f"{functions}\n{document['header']}\n{document['source']}{kept}"


def flash_text(document: dict[str, Any]) -> str:
    """What a download did, and what became of PERSISTENT values."""
    size, seconds = document["bytes"], document["seconds"]
    done = "already on the device" if document["skipped"] else f"{size} bytes in {seconds:.2f} s"
    lines = [f"{done}; state: {document['state']}"]
    if document["persistent"]:
        lines += [f"PERSISTENT value lost: {name} {why}" for name, why in document["persistent"]["lost"].items()]
        lines += [f"PERSISTENT value new: {name}" for name in document["persistent"]["new"]]
    return "\n".join(lines)


def flash_several_text(document: dict[str, Any]) -> str:
    """What a download did on each device."""
    return "\n".join(
        f"{device['node']}: {device['error']['message'] if 'error' in device else flash_text(device)}"
        for device in document["devices"]
    )


def unforced_text(document: dict[str, Any], texts: dict[str, str]) -> str:
    """The values that variables have without force, or how many are forced no more."""
    if texts:
        return values_text(texts)
    names = document["unforced"]
    return f"{', '.join(names)}: not forced any more" if names else "nothing was forced"


def forced_text(texts: dict[str, str]) -> str:
    return values_text(texts) or "nothing is forced"


def tasks_text(document: dict[str, Any]) -> str:
    """A line for each task."""
    columns = ("name", "cycles", "last_us", "avg_us", "min_us", "max_us", "jitter_us", "overruns")
    return table(document["tasks"], columns)


def status_text(document: dict[str, Any]) -> str:
    lines = [f"state: {document['state']}"]
    if program := document.get("program"):
        lines.append(f"program: {' '.join(filter(None, program.values()))}")
    if document["image_crc"]:
        lines.append(f"image: {document['image_crc']}")
    if exception := document["exception"]:
        task = f" in task {exception['task']}" if exception["task"] else ""
        where = f"{place_text(exception)}{detail_text(exception)}{calls_text(exception)}"
        lines.append(f"exception: {exception['name']}{task}{where}")
    if document["forced"]:
        lines.append(f"forced: {', '.join(document['forced'])}")
    return "\n".join(lines)


def log_text(document: dict[str, Any]) -> str:
    return "\n".join(
        f"{e['time_s']:12.6f} s  {e['class']:<9}  {e['component']}: {e['text']}{place_text(e)}"
        f"{detail_text(e)}{calls_text(e, _LOG_COLUMN)}"
        for e in document["entries"]
    )


def info_text(document: dict[str, Any]) -> str:
    """Header first, then one section for each table that is not empty."""
    lines = [f"{name}: {value}" for name, value in document.items() if not isinstance(value, list | dict)]
    lines += [f"{name}: {text}" for name, text in document["info"].items() if text]
    for name, rows in document.items():
        if isinstance(rows, list) and rows:
            lines += ["", f"{name}:", table(rows, rows[0])]
    return "\n".join(lines)


def production_text(document: dict[str, Any]) -> str:
    """What was written, a line for each piece, and what is burned besides."""
    pieces = [{**p, "address": f"0x{p['address']}"} for p in document["pieces"]]
    head = f"{document['output']}: {document['board']} with program CRC {document['crc']}"
    lines = [head, table(pieces, ("address", "size", "what"))]
    if document["burn_at"]:
        lines.append(f"A .bin has no addresses: burn it at 0x{document['burn_at']}.")
    if document["burn_apart"]:
        lines.append(f"Programs have a memory of their own: burn {document['burn_apart']} into the processor as it is.")
    if document["stack"] is None:
        lines.append("Whether its stack is large enough is not known: the symbols of the program are not found.")
    elif document["stack"]["at_least"]:
        lines.append(f"The program needs at least {document['stack']['bytes']} bytes of stack; the sum is not known.")
    return "\n".join(lines)


def production_info_text(document: dict[str, Any]) -> str:
    """The parts, and each program as an image is described."""
    parts = [{**p, "address": f"0x{p['address']}"} for p in document["parts"]]
    lines = [table(parts, ("address", "size"))]
    if document["addresses"] == "file":
        lines.append("A .bin has no addresses: these count from its beginning.")
    for program in document["programs"]:
        seal = "without a valid seal, so that no device runs it" if program["seal"] is None else "sealed"
        image = {name: value for name, value in program.items() if name not in ("address", "seal")}
        lines += ["", f"program at 0x{program['address']}, {seal}:", info_text(image)]
    return "\n".join(lines)


def gateways_text(document: dict[str, Any]) -> str:
    """A line for each gateway, and one for each tool it serves."""
    return "\n".join(map(_gateway_text, document["gateways"])) or "No gateway runs."


def _gateway_text(gateway: dict[str, Any]) -> str:
    if gateway["stuck"]:
        return f"{gateway['line']}: gateway (pid {gateway['pid']}) does not answer"
    lines = [f"{gateway['line']}: {gateway['baud']} baud, gateway (pid {gateway['pid']})"]
    lines += [f"  {tool['tool']} (pid {tool['pid']})" for tool in gateway["tools"]]
    return "\n".join([*lines, f"  {gateway['claim']}"] if gateway["claim"] else lines)


def stopped_text(document: dict[str, Any]) -> str:
    lines = [f"{gateway['line']}: gateway (pid {gateway['pid']}) ended" for gateway in document["stopped"]]
    return "\n".join(lines) or "No gateway runs."
