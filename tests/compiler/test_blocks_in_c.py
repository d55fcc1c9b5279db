"""Function blocks that are written in C: what their declaration may have, and what their signature is made of."""

from __future__ import annotations

from pathlib import Path

import pytest
from front_support import main, messages, program

from plctool.compiler import compile_sources
from plctool.compiler.typed.nodes import CallStatement, FbCall
from plctool.image.c_functions import parse_version, version_text
from plctool.image.file import parse_image
from plctool.image.targets import TARGETS

BLOCK = """{attribute 'external' := 'acme'}
FUNCTION_BLOCK Acme
VAR_INPUT a : INT; END_VAR
VAR b : Inner; c : ARRAY[0..3] OF INT; m : Mode; END_VAR
METHOD Go : BOOL
VAR_INPUT n : INT; END_VAR
END_METHOD
END_FUNCTION_BLOCK
"""
TYPES = "TYPE Mode : (Off, On); Inner : STRUCT x : REAL; next : POINTER TO Inner; END_STRUCT END_TYPE\n"


def signatures(text: str = BLOCK, types: str = TYPES, more: str = "") -> list[int]:
    """Of the body and the method."""
    found = program(types + text + more + main("f : Acme; ok : BOOL;", "f(); ok := f.Go(1);")).externals
    return [pou.external.signature for pou in found if pou.external is not None]


def test_calls_of_body_and_method_are_calls_of_c_functions() -> None:
    body = program(TYPES + BLOCK + main("f : Acme;", "f(); f.Go(1);")).programs["Main"].body
    assert isinstance(body[0], FbCall) and body[0].block.external is not None
    assert body[0].block.external.name == "acme__main"
    assert isinstance(body[1], CallStatement) and body[1].call.function.external is not None
    assert body[1].call.function.external.name == "acme__go"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("a : INT", "a : UINT"),
        ("a : INT", "z : INT"),
        ("0..3", "0..4"),
        ("x : REAL;", "x : LREAL;"),
        ("(Off, On)", "(Off, On) BYTE"),
    ],
)
def test_each_member_counts_for_all_signatures_of_a_block(old: str, new: str) -> None:
    changed = signatures(BLOCK.replace(old, new), TYPES.replace(old, new))
    assert all(one != other for one, other in zip(signatures(), changed, strict=True))


def test_rest_of_the_program_does_not_count_for_a_signature() -> None:
    other = "INTERFACE I END_INTERFACE FUNCTION_BLOCK Base END_FUNCTION_BLOCK\n"
    other += "FUNCTION_BLOCK User EXTENDS Base IMPLEMENTS I\n"
    other += "VAR p : POINTER TO Acme; f : Acme; END_VAR END_FUNCTION_BLOCK\n"
    assert signatures(more=other) == signatures()


def test_signature_is_the_same_in_a_namespace() -> None:
    inside = program(f"NAMESPACE N\n{TYPES}{BLOCK}END_NAMESPACE\n" + main("f : N.Acme;", "f();")).externals
    assert [pou.external.signature for pou in inside if pou.external is not None] == signatures()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("METHOD Go", "a := 1;\nMETHOD Go", "Acme is written in C, so it has no statements here"),
        ("VAR b", "VAR_TEMP b", "Acme is written in C, so it has no VAR_TEMP here"),
        ("END_METHOD", "Go := TRUE; END_METHOD", "Go is written in C, so it has no statements here"),
        ("VAR_INPUT n", "VAR_INST n", "Go is written in C, so it has no VAR_INST here"),
        ("a : INT", "a : BOOL R_EDGE", "Acme is written in C, so its variables cannot have an edge"),
        ("b : Inner", "b AT %I* : INT", "Acme is written in C, so its variables cannot have an address"),
        (
            "METHOD Go : BOOL\nVAR_INPUT n : INT; END_VAR\nEND_METHOD",
            "ACTION Go END_ACTION",
            "Acme is written in C, so it has methods, but no ACTION; write a METHOD",
        ),
        (
            "BLOCK Acme",
            "BLOCK Acme EXTENDS TON",
            "Acme is written in C, so it cannot extend or implement TON; call it in a block that does",
        ),
        ("BLOCK Acme", "BLOCK ABSTRACT Acme", "Acme is written in C, so it cannot be ABSTRACT"),
        (
            "END_FUNCTION_BLOCK",
            "END_FUNCTION_BLOCK FUNCTION_BLOCK D EXTENDS Acme END_FUNCTION_BLOCK",
            "Acme is written in C and cannot be extended; declare a variable of it in D",
        ),
        (
            "FUNCTION_BLOCK Acme",
            "{attribute 'version' := '1.2.3'} FUNCTION_BLOCK Acme",
            "the attribute version is written '1.0' or '1.0.0.0', of numbers up to 255",
        ),
    ],
)
def test_what_c_code_cannot_have_is_an_error(old: str, new: str, message: str) -> None:
    found = messages(TYPES + BLOCK.replace(old, new, 1) + main("n : INT;"))
    assert message in [text.split(": ", 1)[1] for text in found]


def test_version_is_written_as_it_was() -> None:
    for text in ("1.0", "255.255", "1.0.0.0", "3.4.5.0", "255.255.255.255"):
        version = parse_version(text)
        assert version is not None and version_text(version) == text
    assert parse_version("3.4.5.0") == 0x03040500  # as CODESYS writes it
    assert [parse_version(text) for text in ("256.0", "0.1.2.3", "1", "1.2.3", "1.2.3.4.5", "a.b", "")] == [None] * 7


@pytest.mark.parametrize("target", TARGETS)
def test_block_in_c_is_compiled_for_each_processor(target: str, tmp_path: Path) -> None:
    path = tmp_path / "main.st"
    path.write_text(TYPES + BLOCK + main("f : Acme; ok : BOOL;", "f(a := 3); ok := f.Go(1);"))
    image = parse_image(compile_sources([path], target=target, limits=False).image)
    assert {"acme__main", "acme__go"} <= {external.name for external in image.externals}
