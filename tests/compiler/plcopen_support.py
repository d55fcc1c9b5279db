"""Small PLCopen XML files."""

from __future__ import annotations

from pathlib import Path

from plctool.compiler import compile_sources, load_sources
from plctool.compiler.front import check_sources
from plctool.sim import Simulator

HEAD = '<?xml version="1.0" encoding="utf-8"?>\n<project xmlns="http://www.plcopen.org/xml/tc6_0201">\n'
CODESYS = "http://www.3s-software.com/plcopenxml/"


def project(pous: str = "", data_types: str = "", instances: str = "", added: str = "") -> str:
    """A whole file."""
    return (
        f"{HEAD}<types>\n<dataTypes>{data_types}</dataTypes>\n<pous>\n{pous}\n</pous>\n</types>\n"
        f"<instances><configurations>{instances}</configurations></instances>\n"
        f"<addData>{added}</addData>\n</project>\n"
    )


def pou(name: str, body: str, variables: str = "", kind: str = "program", more: str = "") -> str:
    """A unit. `variables`: the lists in its interface."""
    head = f'<pou name="{name}" pouType="{kind}">\n<interface>{variables}</interface>'
    return f"{head}\n<body>\n{body}\n</body>\n{more}</pou>"


def st(text: str) -> str:
    """A body of Structured Text."""
    escaped = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return f'<ST><xhtml xmlns="http://www.w3.org/1999/xhtml">{escaped}</xhtml></ST>'


def variables(where: str, *declared: str) -> str:
    """A list of variables, each as `name:TYPE` or `name:TYPE:=value`; a type in lower case is one of the project."""
    return f"<{where}>{''.join(variable(d) for d in declared)}</{where}>"


def variable(declared: str) -> str:
    """One of them, on a line of its own."""
    head, _, value = declared.partition(":=")
    name, _, kind = head.partition(":")
    spec = f"<{kind}/>" if kind.isupper() and kind not in ("TON", "CTU") else f'<derived name="{kind}"/>'
    initial = f'<initialValue><simpleValue value="{value}"/></initialValue>' if value else ""
    return f'\n<variable name="{name}"><type>{spec}</type>{initial}</variable>\n'


def data(name: str, text: str) -> str:
    """What CODESYS adds."""
    return f'<data name="{CODESYS}{name}" handleUnknown="implementation">{text}</data>'


def written(folder: Path, text: str) -> Path:
    """A file with that."""
    path = folder / "plc.xml"
    path.write_text(text, "utf-8")
    return path


def started(folder: Path, text: str) -> Simulator:
    """Its program, ready to run."""
    built = compile_sources([written(folder, text)])
    return Simulator(built.image, built.symbols)


def errors(folder: Path, text: str) -> list[tuple[int, str]]:
    """Line and message of each error."""
    found = check_sources(load_sources([written(folder, text)])).diagnostics
    return [(d.line, d.message) for d in found if d.severity == "error"]
