"""`plctool doc`: what pages say of declarations and comments, where links lead, and what a comment cannot do."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[2]
MOTOR = """\
TYPE
    (* What a motor does. *)
    State : (
        Idle, // it stands
        Running := 5 (* it turns *)
    ) USINT;
    Setpoint : STRUCT // of a motor
        speed : REAL := 1.5; // in 1/min
        list : ARRAY[0..9] OF POINTER TO State;
    END_STRUCT;
END_TYPE

(* Drives a motor. It is **safe**.

   .. note:: Only one.

   :param go: starts it
   :return: never

   - one
   - two, see :ref:`State`
*)
{attribute 'hide' := ''}
FUNCTION_BLOCK Motor
VAR_INPUT
    go : BOOL;
    // Above, in two
    // lines
    limit : Setpoint;
END_VAR
VAR_OUTPUT
    now AT %QX0.1 : State := State.Idle; (* where *)
END_VAR
VAR hidden : INT; END_VAR
/// <summary>Stops it, see <see cref="State"/>.</summary>
/// <param name="fast">at <b>once</b></param>
/// <returns>TRUE if it stood</returns>
METHOD Stop : BOOL
VAR_INPUT fast : BOOL; END_VAR
END_METHOD
METHOD PRIVATE Secret
END_METHOD
PROPERTY Speed : REAL
GET
    Speed := 1;
END_GET
END_PROPERTY
END_FUNCTION_BLOCK
"""


def doc(tool: Any, scratch: Path, text: str, *options: str) -> dict[str, str]:
    """The pages of a source."""
    (scratch / "main.st").write_text(text)
    done = tool("doc", "main.st", "-o", "pages", *options)
    assert done.status == 0, done.err
    return {path.name: path.read_text() for path in (scratch / "pages").iterdir()}


def plain(html: str) -> str:
    """The text of a page, its words one blank apart."""
    return " ".join(re.sub(r"<[^>]*>", " ", html).split())


def test_a_block_has_a_page_with_its_comment_inputs_and_outputs(tool: Any, scratch: Path) -> None:
    page = plain(doc(tool, scratch, MOTOR)["Motor.html"])
    assert "Drives a motor. It is safe ." in page
    assert "Note Only one." in page
    assert "go BOOL starts it" in page
    assert "limit Setpoint Above, in two lines" in page
    assert "now State State . Idle %QX0.1 where" in page or "now State State.Idle %QX0.1 where" in page
    assert "Returns never" in page
    assert "hidden" not in page


def test_a_comment_in_xml_is_read_as_twincat_shows_it(tool: Any, scratch: Path) -> None:
    page = doc(tool, scratch, MOTOR)["Motor.html"]
    method = page[page.index('id="Stop"') :]
    assert 'Stops it, see <a href="State.html">State</a>.' in method
    assert "<td><code>fast</code></td><td><code>BOOL</code></td><td><p>at <strong>once</strong></p>" in method
    assert "TRUE if it stood" in method


def test_types_link_to_their_pages_and_name_their_users(tool: Any, scratch: Path) -> None:
    pages = doc(tool, scratch, MOTOR)
    assert '<a href="Setpoint.html">Setpoint</a>' in pages["Motor.html"]
    assert 'POINTER TO </code><a href="State.html">State</a>' in pages["Setpoint.html"]
    assert "Used by Motor , Setpoint" in plain(pages["State.html"]) or "Used by Setpoint , Motor" in plain(
        pages["State.html"]
    )
    assert "Running 5 it turns" in plain(pages["State.html"])
    assert "of a motor" in plain(pages["Setpoint.html"])


def test_the_first_page_lists_all_with_their_first_sentence(tool: Any, scratch: Path) -> None:
    index = plain(doc(tool, scratch, MOTOR)["index.html"])
    assert "Function blocks and classes Motor Drives a motor. Types" in index


def test_a_diagram_has_a_wire_for_each_input_and_output(tool: Any, scratch: Path) -> None:
    page = doc(tool, scratch, MOTOR)["Motor.html"]
    svg = ElementTree.fromstring(page[page.index("<svg") : page.index("</svg>") + 6])
    space = "{http://www.w3.org/2000/svg}"
    assert len(svg.findall(f"{space}path")) == 3
    assert next(text.text for text in svg.iter(f"{space}text")) == "Motor"
    assert svg.get("aria-label") == "Motor; inputs go, limit; outputs now"


def test_private_methods_are_shown_on_request(tool: Any, scratch: Path) -> None:
    assert "Secret" not in doc(tool, scratch, MOTOR)["Motor.html"]
    assert "Secret" in doc(tool, scratch, MOTOR, "--private")["Motor.html"]


def test_markdown_has_the_same_and_its_diagrams_as_files(tool: Any, scratch: Path) -> None:
    pages = doc(tool, scratch, MOTOR, "--format", "markdown")
    assert "| `limit` | [Setpoint](<Setpoint.md>) | Above, in two lines |" in pages["Motor.md"]
    assert "- two, see [State](<State.md>)" in pages["Motor.md"]
    assert "> **Note**" in pages["Motor.md"]
    assert "![Motor](<Motor.svg>)" in pages["Motor.md"]
    ElementTree.fromstring(pages["Motor.svg"])
    assert "Motor.Stop.svg" in pages


@pytest.mark.parametrize(
    ("comment", "said"),
    [
        ("(* It *is* not closed: **bold *)", "It is not closed: **bold"),
        ("(* <summary>open *)", "<summary>open"),
        ("(* a | b ``c *)", "a | b ``c"),
        ("(*\n * In a frame\n * of stars.\n *)", "In a frame of stars."),
        ("// region\n//! Marked", "Marked"),
    ],
)
def test_a_comment_that_is_no_markup_is_shown_as_written(tool: Any, scratch: Path, comment: str, said: str) -> None:
    pages = doc(tool, scratch, f"{comment}\nFUNCTION f : INT\nEND_FUNCTION\n")
    page = pages["f.html"].replace("&lt;", "\0").replace("&gt;", "\1")
    assert said in plain(page).replace("\0", "<").replace("\1", ">")


@pytest.mark.parametrize(
    "where", ["FUNCTION_BLOCK b // Here", "// Here\nFUNCTION_BLOCK b", "FUNCTION_BLOCK b\n(* Here *)"]
)
def test_the_comment_of_a_block_stands_above_it_or_after_its_first_line(tool: Any, scratch: Path, where: str) -> None:
    page = doc(tool, scratch, f"{where}\nVAR_INPUT x : INT; END_VAR\nEND_FUNCTION_BLOCK\n")["b.html"]
    assert "<p>Here</p>" in page


def test_a_comment_apart_from_a_declaration_is_not_about_it(tool: Any, scratch: Path) -> None:
    text = "// Of the file\n\nFUNCTION f : INT\nVAR_INPUT\n a : INT; // of a\n b : INT;\nEND_VAR\nEND_FUNCTION\n"
    page = plain(doc(tool, scratch, text)["f.html"])
    assert "Of the file" not in page
    assert page.count("of a") == 1


HOSTILE = """\
(* <script>alert(1)</script> `x <javascript:alert(2)>`_ http://example.com

   .. raw:: html

      <img src=x onerror=alert(3)>

   .. include:: main.st

   .. image:: https://example.com/spy.png
*)
FUNCTION f : INT
VAR_INPUT x : STRING := '<script>alert(4)</script>'; END_VAR // | ` <b>
END_FUNCTION
"""


def test_a_comment_cannot_bring_a_script_a_file_or_a_picture_of_another_place(tool: Any, scratch: Path) -> None:
    pages = doc(tool, scratch, HOSTILE)
    found = Elements()
    found.feed(pages["f.html"])
    assert found.tags & {"script", "img", "iframe", "object", "b"} == set()
    assert not any(name.startswith("on") for name in found.attributes)
    assert [link for link in found.links if ":" in link and not link.startswith("http")] == []
    assert "VAR_INPUT x" not in pages["f.html"]
    assert "default-src 'none'" in pages["f.html"]
    markdown = doc(tool, scratch, HOSTILE, "--format", "markdown")["f.md"]
    assert not re.search(r"(?<![\\`'])<script", markdown)
    assert "javascript:alert(2)>)" not in markdown


class Elements(HTMLParser):
    """The elements, attributes, links and ids of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.links: list[str] = []
        self.ids: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        for name, value in attrs:
            self.attributes.add(name)
            if name == "href" and value:
                self.links.append(value)
            if name == "id" and value:
                self.ids.add(value)


@pytest.mark.parametrize(
    "source", ["host/plctool/stdlib", "examples/tanks", "tests/corpus/codesys/cell", "tests/corpus/twincat/process"]
)
def test_all_links_lead_somewhere(tool: Any, scratch: Path, source: str) -> None:
    done = tool("doc", str(ROOT / source), "-o", "pages", "--json")
    assert done.status == 0, done.err
    pages: dict[str, Elements] = {}
    for path in (scratch / "pages").glob("*.html"):
        pages[path.name] = Elements()
        pages[path.name].feed(path.read_text())
    assert len(pages) == json.loads(done.out)["pages"]
    for page in pages.values():
        for link in page.links:
            if link.startswith("http") or link == "style.css":
                continue
            file, _, fragment = unquote(link).partition("#")
            assert file in pages, link
            assert not fragment or fragment in pages[file].ids, link


def test_names_that_differ_in_case_have_files_of_their_own(tool: Any, scratch: Path) -> None:
    text = "FUNCTION Index : INT\nEND_FUNCTION\nNAMESPACE n\nFUNCTION f : INT\nEND_FUNCTION\nEND_NAMESPACE\n"
    pages = doc(tool, scratch, text)
    assert {"index.html", "Index-2.html", "n.f.html"} <= set(pages)
    assert 'href="Index-2.html"' in pages["index.html"]


def test_global_variables_of_a_file_are_one_page(tool: Any, scratch: Path) -> None:
    text = "VAR_GLOBAL\n a : INT; // first\nEND_VAR\nVAR_GLOBAL CONSTANT\n B : INT := 3;\nEND_VAR\n"
    page = plain(doc(tool, scratch, text)["main.html"])
    assert "a INT first" in page
    assert "B INT 3" in page


def test_a_source_with_a_syntax_error_is_named_and_nothing_is_written(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("FUNCTION f : INT\nf := ;\nEND_FUNCTION\n")
    done = tool("doc", "main.st", "-o", "pages")
    assert done.status == 2
    assert done.err.startswith("plctool: main.st:2:")
    assert not (scratch / "pages").exists()


def test_sources_without_declarations_are_refused(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("TEST 'x'\nEND_TEST\n")
    done = tool("doc", "main.st")
    assert (done.status, "declare no block" in done.err) == (2, True)
    assert not (scratch / "doc").exists()


def test_pages_cannot_go_into_a_file(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(MOTOR)
    done = tool("doc", "main.st", "-o", "main.st")
    assert done.status == 2
    assert (scratch / "main.st").read_text() == MOTOR


def test_a_long_source_takes_time_in_proportion_to_its_length(tool: Any, scratch: Path) -> None:
    block = "// Comment {0}\nFUNCTION f{0} : INT\nVAR_INPUT\n{1}END_VAR\nEND_FUNCTION\n"
    inputs = "".join(f"    x{n} : INT; // input {n}\n" for n in range(20))
    pages = doc(tool, scratch, "".join(block.format(n, inputs) for n in range(200)))
    assert len(pages) == 202


def test_a_library_is_titled_by_its_manifest(tool: Any, scratch: Path) -> None:
    assert tool("new", "--template", "library", "Pumps").status == 0
    done = tool("doc", "Pumps/library", "-o", "pages")
    assert done.status == 0, done.err
    assert "<h1>Pumps 0.1.0</h1>" in (scratch / "pages" / "index.html").read_text()
