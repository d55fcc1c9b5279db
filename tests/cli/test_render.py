"""`plctool render`: what stands in the picture of a diagram, and what has none."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1] / "compiler"))

from test_codesys2_networks import contact, export, gate, rung
from twincat_archive import archive, assign, box, given, item, network, unit

from plctool.compiler import compile_sources
from plctool.debug.symbols import cache_path
from plctool.device import connect
from plctool.testing.plcrt import Plcrt

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "five-languages"
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def rendered(tool: Any, source: Path, unit: str, scratch: Path) -> ElementTree.Element:
    done = tool("render", str(source), unit, "-o", "x.svg")
    assert done.status == 0, done.err
    return ElementTree.fromstring((scratch / "x.svg").read_text())


def words(svg: ElementTree.Element) -> list[str]:
    return [e.text or "" for e in svg.iter(f"{SVG}text")]


@pytest.mark.parametrize(("file", "unit"), [("fill_ld.xml", "FillLd"), ("fill_fbd.xml", "FillFbd")])
def test_every_element_is_drawn(tool: Any, scratch: Path, file: str, unit: str) -> None:
    svg = rendered(tool, EXAMPLE / file, unit, scratch)
    text = (EXAMPLE / file).read_text()
    drawn = {e.get("data-id") for e in svg.iter() if e.get("data-id")}
    assert drawn == set(re.findall(r'<(?!leftPowerRail)\w+ localId="(\d+)"', text))
    assert {"timer", "TON", "PT", "T#50ms", "counter", "starts"} <= set(words(svg))


def test_nothing_lies_on_something_else(tool: Any, scratch: Path) -> None:
    svg = rendered(tool, EXAMPLE / "fill_fbd.xml", "FillFbd", scratch)
    boxes = [tuple(float(r.get(k, "")) for k in ("x", "y", "width", "height")) for r in svg.iter(f"{SVG}rect")]
    assert len(boxes) == 6
    for i, (x, y, w, h) in enumerate(boxes):
        for ox, oy, ow, oh in boxes[:i]:
            assert x + w <= ox or ox + ow <= x or y + h <= oy or oy + oh <= y


def test_coils_contacts_and_negations_have_their_signs(tool: Any, scratch: Path) -> None:
    seen = words(rendered(tool, EXAMPLE / "fill_ld.xml", "FillLd", scratch))
    assert (seen.count("S"), seen.count("/")) == (1, 2)
    assert len(list(rendered(tool, EXAMPLE / "fill_fbd.xml", "FillFbd", scratch).iter(f"{SVG}circle"))) == 3


def project(body: str) -> str:
    pou = f'<pou name="Main" pouType="program"><interface/><body>{body}</body></pou>'
    return f'<project xmlns="http://www.plcopen.org/xml/tc6_0201"><types><pous>{pou}</pous></types></project>'


def test_a_line_back_is_dashed(tool: Any, scratch: Path) -> None:
    given = '<connectionPointIn><connection refLocalId="1" formalParameter="q"/></connectionPointIn>'
    block = (
        '<block localId="1" typeName="A" instanceName="a"><inputVariables><variable formalParameter="i">'
        f'{given}</variable></inputVariables><outputVariables><variable formalParameter="q"/></outputVariables></block>'
    )
    Path("plc.xml").write_text(project(f"<FBD>{block}</FBD>"))
    svg = rendered(tool, Path("plc.xml"), "main", scratch)
    assert [e.get("stroke-dasharray") for e in svg.iter(f"{SVG}path")] == ["4 2"]


def test_names_cannot_be_markup(tool: Any, scratch: Path) -> None:
    element = '<inVariable localId="1"><expression>&lt;script&gt; &amp; "</expression></inVariable>'
    Path("plc.xml").write_text(project(f"<FBD>{element}</FBD>"))
    assert words(rendered(tool, Path("plc.xml"), "Main", scratch)) == ['<script> & "']


@pytest.mark.parametrize(
    ("body", "unit", "message"),
    [
        ("<ST><xhtml>;</xhtml></ST>", "Main", "Main is text; LD, FBD, CFC and SFC are drawn."),
        ("<FBD/>", "Mian", "plc.xml has no diagram Mian; did you mean Main?"),
        ("<FBD/>", "Other", "plc.xml has no diagram Other; it has Main."),
    ],
)
def test_what_has_no_diagram_is_refused(tool: Any, scratch: Path, body: str, unit: str, message: str) -> None:
    Path("plc.xml").write_text(project(body))
    done = tool("render", "plc.xml", unit)
    assert done.status != 0
    assert message in done.err
    assert not list(scratch.glob("*.svg"))


def test_text_is_refused(tool: Any, scratch: Path) -> None:
    Path("main.st").write_text("PROGRAM Main\nEND_PROGRAM\n")
    done = tool("render", "main.st", "Main")
    assert "Main is text; LD, FBD, CFC and SFC are drawn." in done.err


def test_the_source_is_not_overwritten(tool: Any, scratch: Path) -> None:
    Path("plc.xml").write_text(project("<FBD/>"))
    done = tool("render", "plc.xml", "Main", "-o", "plc.xml")
    assert done.status != 0
    assert Path("plc.xml").read_text() == project("<FBD/>")


def test_a_long_row_is_refused(tool: Any, scratch: Path) -> None:
    def contact(number: int) -> str:
        point = f'<connectionPointIn><connection refLocalId="{number - 1}"/></connectionPointIn>' if number > 1 else ""
        return f'<contact localId="{number}">{point}<variable>a</variable></contact>'

    Path("plc.xml").write_text(project(f"<LD>{''.join(contact(n) for n in range(2000, 0, -1))}</LD>"))
    done = tool("render", "plc.xml", "Main")
    assert "nested too deeply to be drawn" in done.err


CONTACTS = item(box("OR", [item(box("AND", [given("a"), given("b", 1)])), given("c")]))
TWINCAT = archive(network(assign(CONTACTS, ("o", 2))), mode="Ld")
DECLARED = "PROGRAM Main\nVAR a, b, c, o : BOOL; END_VAR"
CODESYS = export("LD", [rung(gate("OR", gate("AND", contact("a"), contact("b", True)), contact("c")), ("o", "S"))], "")


@pytest.mark.parametrize(
    ("file", "text", "name"), [("Main.TcPOU", unit(DECLARED, TWINCAT), "Main"), ("plc.EXP", CODESYS, "PLC_PRG")]
)
def test_a_ladder_of_twincat_or_codesys_2_is_drawn_with_contacts(
    tool: Any, scratch: Path, file: str, text: str, name: str
) -> None:
    (scratch / "plant").mkdir()
    (scratch / "plant" / file).write_text(text)
    seen = words(rendered(tool, scratch / "plant", name, scratch))  # of a folder
    assert sorted(seen) == ["/", "S", "a", "b", "c", "o"]


def test_a_file_of_twincat_that_cannot_be_read_says_why(tool: Any, scratch: Path) -> None:
    (scratch / "Main.TcPOU").write_text(unit(DECLARED, archive(network(assign(given("a", 64), ("o", 0))))))
    done = tool("render", "Main.TcPOU", "Main")
    assert "the diagram Main cannot be compiled: it has the flags 64, which are not known." in done.err


CHART = """PROGRAM Main
VAR go, done : BOOL; END_VAR
INITIAL_STEP Wait: END_STEP
STEP Work: Run(N); END_STEP
TRANSITION FROM Wait TO Work := go AND NOT done; END_TRANSITION
TRANSITION (PRIORITY := 2) FROM Work TO Wait := done; END_TRANSITION
ACTION Run: done := TRUE; END_ACTION
END_PROGRAM
"""


def test_a_chart_is_drawn_with_its_conditions_actions_and_ways_back(tool: Any, scratch: Path) -> None:
    Path("main.st").write_text(CHART)
    seen = words(rendered(tool, Path("main.st"), "Main", scratch))
    assert seen == ["Wait", "go AND NOT done", "Work", "N Run", "done", "\N{RIGHTWARDS ARROW} Wait"]


def test_live_values_stand_at_pins_contacts_coils_and_steps(
    tool: Any, scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    timer = item(box("TON", {"IN": given("a"), "PT": given("T#1h")}, {"Q:BOOL": "", "ET:TIME": ""}, "t"))
    sum_ = assign(item(box("ADD", [given("n"), given("40")])), ("m", 0))
    body = archive(network(assign(timer, ("o", 0))), network(sum_))
    (scratch / "FB.TcPOU").write_text(
        unit(
            "FUNCTION_BLOCK FB\nVAR a : BOOL := TRUE; o : BOOL; t : TON; n : INT := 2; m : INT; END_VAR", body, "", "FB"
        )
    )
    (scratch / "main.st").write_text("PROGRAM Main\nVAR f : FB; END_VAR\nf();\nEND_PROGRAM\n")
    built = compile_sources([scratch / "FB.TcPOU", scratch / "main.st"])
    cache_path(built.crc).parent.mkdir(parents=True, exist_ok=True)
    built.symbols.save(cache_path(built.crc))
    with Plcrt(scratch / "flash.bin", "--tcp", "0") as runtime:
        with connect(f"tcp:{runtime.tcp}") as plc:
            plc.flash(built.image)
            plc.start()
            while plc.read("Main.f.m") != 42:
                pass
        done = tool("render", "FB.TcPOU", "FB", "--live", "Main.f", "--tcp", str(runtime.tcp), "-o", "x.svg", "--json")
    assert done.status == 0, done.out + done.err
    pins = {entry["variable"]: entry["value"] for entry in json.loads(done.out)["pins"]}
    assert pins.items() >= {"Main.f.a": "TRUE", "Main.f.o": "FALSE", "Main.f.t.Q": "FALSE", "Main.f.m": "42"}.items()
    assert [value for name, value in pins.items() if "_TMP_ADD" in name] == ["42"], pins
    shown = ElementTree.fromstring((scratch / "x.svg").read_text())
    values = {e.get("data-variable"): e.text for e in shown.iter() if e.get("data-variable")}
    assert values == pins
