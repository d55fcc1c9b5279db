"""`plctool render`: what stands in the picture of a diagram, and what has none."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

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
        ("<ST><xhtml>;</xhtml></ST>", "Main", "Main is written in ST; only LD, FBD and CFC are drawn."),
        ("<FBD/>", "Mian", "plc.xml has no unit Mian; did you mean Main?"),
        ("<FBD/>", "Other", "plc.xml has no unit Other; it has Main."),
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
    assert "Give a PLCopen XML file." in done.err


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
