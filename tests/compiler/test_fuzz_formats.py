"""Whatever is done to a file of another system, it gives diagnostics that have a line."""

from __future__ import annotations

from pathlib import Path

import pytest
import test_codesys2_networks as codesys2
import twincat_archive
from hypothesis import given
from hypothesis import strategies as st
from plcopen_support import pou, project, variables
from shares import examples
from test_codesys2_exports import HARDWARE, LIBRARY, PROGRAM, SETTINGS, TASKS, VISUALISATION
from test_object_texts import COUNTER
from test_plcopen import BLOCK, GLOBALS, MIXED, TYPES, USER
from test_plcopen import TASKS as CONFIGURATION
from test_plcopen_charts import COUNT, LOOP, chart
from test_plcopen_diagrams import block, coil, contact, ladder, network, taken
from test_plcopen_diagrams import given as variable_of
from test_source_files import BLOCK as TC_BLOCK
from test_source_files import GENERATED, TASK

from plctool.compiler.front import check_sources
from plctool.compiler.sources.source_files import load

LADDER = pou(
    "Rungs",
    ladder(
        contact(2, "a", "1", more='edge="rising"'),
        contact(3, "b", "1", more='negated="true"'),
        block(4, "TON", {"IN": "2", "PT": "5"}, "Q ET", "TON0"),
        variable_of(5, "T#20ms"),
        block(6, "ADD", {"EN": "4.Q", "IN1": "7", "IN2": "7"}, "ENO OUT"),
        variable_of(7, "n"),
        taken(8, "n", "6.OUT", row=20),
        coil(9, "a", "2", "3", more='storage="set"'),
    ),
    variables("localVars", "a:BOOL", "b:BOOL", "n:INT", "TON0:TON"),
)
NETWORK = pou("Net", network(variable_of(1, "n"), taken(2, "n", "1")), variables("localVars", "n:INT"), "functionBlock")
ARCHIVE = twincat_archive.archive(
    twincat_archive.network(
        twincat_archive.demux(3, twincat_archive.given("a", 1)),
        twincat_archive.assign(twincat_archive.demux(3), ("o", 2), ("b", 1)),
        twincat_archive.assign(twincat_archive.given("a", 16), ("over", 4)),
    ),
    twincat_archive.network(
        twincat_archive.assign(
            twincat_archive.item(
                twincat_archive.box(
                    "TON",
                    {"IN": twincat_archive.given("a"), "PT": twincat_archive.given("T#1s")},
                    {"Q:BOOL": "", "ET:TIME": ""},
                    "t",
                )
            ),
            ("c", 0),
        ),
        label="over",
    ),
    mode="Ld",
)
RUNGS = [
    codesys2.rung(
        codesys2.gate("OR", codesys2.contact("a"), codesys2.contact("b", negated=True)),
        ("o", "S"),
        boxes=(codesys2.assign(codesys2.box("REAL_TO_INT", codesys2.operand("x"), enabled=True), ("n", "=")),),
    ),
    codesys2.network(
        codesys2.assign(codesys2.box("TON", codesys2.operand("a"), codesys2.operand("T#1s"), instance="t"), ("o", "=")),
        "label",
    ),
]
SAMPLES = {
    "a.xml": project(BLOCK + USER + LADDER + NETWORK, TYPES, CONFIGURATION, GLOBALS + MIXED),
    "b.xml": chart(*LOOP, more=COUNT),
    "c.EXP": LIBRARY + PROGRAM + VISUALISATION + HARDWARE + TASKS + SETTINGS,
    "d.TcPOU": TC_BLOCK,
    "e.TcTTO": TASK,
    "f.st": COUNTER,
    "g.st": GENERATED,
    "h.TcPOU": twincat_archive.unit("PROGRAM Drawn\nVAR a, b, c, o : BOOL; t : TON; END_VAR", ARCHIVE, "", "Drawn"),
    "i.EXP": codesys2.export("LD", RUNGS, "a, b, o : BOOL; t : TON; x : REAL; n : INT;", "", "Drawn"),
}
SPLICES = [
    "", "<", ">", '"', "</", "]]>", "<![CDATA[", "&lt;", "&#0;", "&#10;", "'", "(*", "*)", "\0", "\ud800", "END_VAR",
    "VAR", "PROGRAM ", "METHOD m\n", "_LD_BODY\n", "<block/>", "<step/>", '<connection refLocalId="1"/>', "<addData>",
    "<!DOCTYPE a>", "TASK t (", "LIBRARY\n", "ä€\u2028", "\r", "\n" * 5,
]  # fmt: skip


@pytest.mark.parametrize("name", SAMPLES)
@examples(60)
@given(data=st.data())
def test_a_mutated_file_gives_diagnostics_with_a_line(tmp_path: Path, name: str, data: st.DataObject) -> None:
    text = SAMPLES[name]
    for _ in range(data.draw(st.integers(1, 4))):
        begin = data.draw(st.integers(0, len(text)))
        length = data.draw(st.sampled_from([0, 1, 2, 5, 20, 200]))
        text = text[:begin] + data.draw(st.sampled_from([*SPLICES, text[:80]])) + text[begin + length :]
    path = tmp_path / name
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    sources = load([path])
    assert sources
    for source in sources:
        for found in source.findings:
            assert 1 <= found.line <= len(source.line_starts)
            assert found.column >= 1
            assert found.message
    for diagnostic in check_sources(sources).diagnostics:
        assert diagnostic.file == str(path)
        assert 1 <= diagnostic.line <= len(sources[0].line_starts)


@pytest.mark.parametrize("name", SAMPLES)
def test_what_is_mutated_is_right_by_itself(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text(SAMPLES[name], "utf-8")
    errors = [d.message for d in check_sources(load([path])).diagnostics if d.severity == "error"]
    assert not [message for message in errors if "unknown" not in message and "no program" not in message]
