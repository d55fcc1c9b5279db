"""What `check` found, in the formats that CI systems show: SARIF 2.1.0 (OASIS), and JUnit XML.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote
from xml.etree import ElementTree

from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.compiler.syntax.warnings import MEANINGS
from plctool.version import plctool_version

_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif(diagnostics: Sequence[Diagnostic]) -> bytes:
    """Returns one run with a result for each diagnostic. Locations are relative to the current folder, which is that of
    the repository in a CI job; others are URIs of files."""
    codes = dict.fromkeys(d.code for d in diagnostics)
    run: dict[str, Any] = {
        "tool": {
            "driver": {"name": "plctool", "version": plctool_version(), "rules": [_rule(code) for code in codes]},
        },
        "columnKind": "unicodeCodePoints",
        "results": [_result(d) for d in diagnostics],
    }
    document = {"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}
    return json.dumps(document, indent=1).encode() + b"\n"


def _rule(code: str) -> dict[str, Any]:
    return {"id": code, "shortDescription": {"text": MEANINGS.get(code, code)}}


def _result(diagnostic: Diagnostic) -> dict[str, Any]:
    place: dict[str, Any] = {"artifactLocation": {"uri": _uri(diagnostic.file)}}
    if diagnostic.line > 0:
        place["region"] = {"startLine": diagnostic.line, "startColumn": max(1, diagnostic.column)}
    return {
        "ruleId": diagnostic.code,
        "level": diagnostic.severity,
        "message": {"text": diagnostic.message},
        "locations": [{"physicalLocation": place}],
    }


def _uri(file: str) -> str:
    path = PurePath(file)
    return Path(file).as_uri() if path.is_absolute() else quote(path.as_posix())


def junit(diagnostics: Sequence[Diagnostic], files: Iterable[str]) -> bytes:
    """Returns a test case for each file: errors fail it, warnings are its output."""
    found: dict[str, list[Diagnostic]] = {file: [] for file in files}
    for diagnostic in diagnostics:
        found.setdefault(diagnostic.file, []).append(diagnostic)
    failed = sum(any(d.severity == "error" for d in of_file) for of_file in found.values())
    totals = {"tests": str(len(found)), "failures": str(failed), "errors": "0"}
    root = ElementTree.Element("testsuites", totals, name="plctool check")
    suite = ElementTree.SubElement(root, "testsuite", totals, name="plctool check")
    for file, of_file in found.items():
        case = ElementTree.SubElement(
            suite, "testcase", classname="check", name=_printable(file), file=_printable(file)
        )
        errors = [_line(d) for d in of_file if d.severity == "error"]
        if errors:
            failure = ElementTree.SubElement(case, "failure", message=errors[0], type="error")
            failure.text = "\n".join(errors)
        if warnings := [_line(d) for d in of_file if d.severity == "warning"]:
            ElementTree.SubElement(case, "system-out").text = "\n".join(warnings)
    ElementTree.indent(root)
    data: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return data + b"\n"


def _line(diagnostic: Diagnostic) -> str:
    where = f"{diagnostic.file}:{diagnostic.line}:{diagnostic.column}"
    return _printable(f"{where}: {diagnostic.severity}: {diagnostic.message} [{diagnostic.code}]")


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() or c == "\t" else "?" for c in text)
