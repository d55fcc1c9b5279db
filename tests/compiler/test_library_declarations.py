"""What a library declares is found, however it is written: by the compiler, and by {IF defined(...)}."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from library_support import check, library, messages

from plctool.compiler.base.source import Source
from plctool.compiler.sources import imports

BETWEEN = {
    "blank": " ",
    "line": "\n",
    "comment": " (* Other : (No, *) ",
    "nested": " (* Other (* : *) , *) ",
    "touching": "(**)",
    "C comment": " /* it's , */ ",
    "line comment": " // ) Other' :\n",
    "attribute": " {attribute 'x' := 'Other : INT'} ",
    "unclosed inner comment": " (* Other (* : *) ",
}
"""What may stand between two words."""

DECLARATIONS = {
    "function": "FUNCTION_Get_:_INT\nGet := 1;\nEND_FUNCTION",
    "public function": "FUNCTION_PUBLIC_Get_:_INT\nGet := 1;\nEND_FUNCTION",
    "block": "FUNCTION_BLOCK_Get\nEND_FUNCTION_BLOCK",
    "abstract block": "FUNCTION_BLOCK_PUBLIC_ABSTRACT_Get\nEND_FUNCTION_BLOCK",
    "final block": "FUNCTION_BLOCK_FINAL_Get_EXTENDS_Base\nEND_FUNCTION_BLOCK\nFUNCTION_BLOCK Base\nEND_FUNCTION_BLOCK",
    "class": "CLASS_Get\nEND_CLASS",
    "interface": "INTERFACE_Get\nEND_INTERFACE",
    "structure": "TYPE_Get_:_STRUCT_x_:_INT;_END_STRUCT;_END_TYPE",
    "derived structure": "TYPE_Get_EXTENDS_Base_:_STRUCT x : INT; END_STRUCT END_TYPE\n"
    "TYPE Base : STRUCT y : INT; END_STRUCT END_TYPE",
    "second type": "TYPE First : STRUCT y : INT; END_STRUCT; Get_EXTENDS_First_:_STRUCT x : INT; END_STRUCT; END_TYPE",
    "union": "TYPE_Get_:_UNION_x_:_INT;_END_UNION;_END_TYPE",
    "alias": "TYPE_Get_:_INT_:=_3;_END_TYPE",
    "subrange": "TYPE_Get_:_INT_(_1_.._9_);_END_TYPE",
    "enumeration": "TYPE_Get_:_(_No_,_Yes_);_END_TYPE",
    "public type": "TYPE_PUBLIC_Get_:_INT_;_END_TYPE",
}
VALUES = {
    "first value": "TYPE E_:_(_Get_,_Put_)_;_END_TYPE",
    "middle value": "TYPE E_:_(_No_,_Get_,_Put_);_END_TYPE",
    "last value": "TYPE E_:_(_No_,_Get_);_END_TYPE",
    "value with number": "TYPE E_:_(_No_:=_(1_+_2)_,_Get_:=_5_);_END_TYPE",
    "value after one in parentheses": "TYPE E_:_(_No_:=_(_1_),_Get_)_INT_:=_Get_;_END_TYPE",
    "value with base": "TYPE E_:_INT_(_No_,_Get_:=_7_);_END_TYPE",
    "value beside a name like a keyword": "TYPE E_:_(_Union_,_Get_);_END_TYPE\n"
    "TYPE U : UNION x : INT; END_UNION END_TYPE",
    "global": "VAR_GLOBAL_No_,_Get_:_INT;_END_VAR",
    "global at an address": "VAR_GLOBAL_Get_AT_%MW0_:_INT;_END_VAR",
    "value of a global": "VAR_GLOBAL_x_:_(_No_:=_(1)_,_Get_:=_5_);_END_VAR",
}
KINDS = DECLARATIONS | VALUES
OTHER = "FUNCTION Beside : INT\nBeside := 1;\nEND_FUNCTION\n"


def written(declaration: str, between: str) -> str:
    """With something else wherever _ stands between two words."""
    marked = declaration
    for word in ("FUNCTION_BLOCK", "VAR_GLOBAL", *(f"END_{w}" for w in ("FUNCTION", "BLOCK", "TYPE", "VAR", "STRUCT"))):
        marked = marked.replace(word, word.replace("_", "\1"))
    for word in ("END_UNION", "END_CLASS", "END_INTERFACE", "END\1FUNCTION_BLOCK"):
        marked = marked.replace(word, word.replace("_", "\1"))
    return marked.replace("_", between).replace("\1", "_")


@pytest.mark.parametrize(("kind", "how"), list(product(KINDS, BETWEEN)))
def test_declaration_is_found_with_anything_between_its_words(kind: str, how: str) -> None:
    text = written(KINDS[kind], BETWEEN[how])
    for source in (text, f"{OTHER}{text}\n", f"{text}\n{OTHER}", f"{text}\nVAR_GLOBAL more : INT; END_VAR\n"):
        parts = imports.parts_of(Source("x.st", source))
        assert "".join(source[p.start : p.end] for p in parts).strip() == source.strip()
        assert any("get" in map(str.casefold, p.names) for p in parts), (source, parts)
    assert "VAR_GLOBAL" in text or len(imports.parts_of(Source("x.st", OTHER + text))) > 1


@pytest.mark.parametrize("how", BETWEEN)
@pytest.mark.parametrize("kind", KINDS)
def test_the_parser_takes_what_is_tried_here(tmp_path: Path, kind: str, how: str) -> None:
    """So that the test above is one of programs that exist."""
    assert messages(check(tmp_path, f"{written(KINDS[kind], BETWEEN[how])}\nPROGRAM Main\nEND_PROGRAM")) == []


def test_program_uses_a_library_that_is_full_of_comments(tmp_path: Path) -> None:
    home = library(tmp_path, "Lib", {
        "s.st": "TYPE Sub EXTENDS Base : STRUCT b : INT; END_STRUCT END_TYPE\n",
        "b.st": "TYPE (* of all *) Base : STRUCT a : INT; END_STRUCT END_TYPE\n",
        "e.st": "TYPE Mode : (Off (* no power *), On // power\n, Fault {attribute 'x'}); END_TYPE\n",
        "f.st": "FUNCTION (* twice *) {attribute 'y'} Twice : INT\nVAR_INPUT x : INT; END_VAR\n"
        "Twice := 2 * x; END_FUNCTION",
        "g.st": "FUNCTION_BLOCK // a block\nABSTRACT (* of all *) Root END_FUNCTION_BLOCK\n"
        "FUNCTION_BLOCK FINAL /* one */ Leaf EXTENDS Root VAR_OUTPUT n : INT; END_VAR END_FUNCTION_BLOCK",
    })  # fmt: skip
    text = """PROGRAM Main
VAR s : Sub; m : Mode := Off; l : Leaf; END_VAR
s.a := Twice(s.b); IF m = On THEN m := Fault; END_IF; l();
END_PROGRAM"""
    assert messages(check(tmp_path, text, home)) == []


@pytest.mark.parametrize("how", BETWEEN)
def test_members_of_a_block_have_anything_between_their_words(tmp_path: Path, how: str) -> None:
    members = written(
        "METHOD_PUBLIC_FINAL_Get_:_INT\nGet := 1;\nEND\1METHOD\n"
        "PROPERTY_PROTECTED_Speed_:_INT\nGET_Speed := 1; END\1GET\nEND\1PROPERTY\n"
        "ACTION_Act_:\nEND\1ACTION\n",
        BETWEEN[how],
    )
    text = f"FUNCTION_BLOCK Block\n{members}END_FUNCTION_BLOCK\nPROGRAM Main VAR b : Block; END_VAR b.Get(); b.Act();"
    assert messages(check(tmp_path, f"{text} END_PROGRAM")) == []


@pytest.mark.parametrize("name", ["Öffnen", "Überlauf", "größe", "名前"])
def test_names_with_letters_of_other_alphabets_are_found(tmp_path: Path, name: str) -> None:
    home = library(tmp_path, "Lib", {
        "f.st": f"FUNCTION {name} : INT\n{name} := 1;\nEND_FUNCTION\n{OTHER}",
        "t.st": f"TYPE T_{name} : ({name}_An, Ä_{name}); END_TYPE\n",
    })  # fmt: skip
    text = f"PROGRAM Main\nVAR n : INT; t : T_{name}; END_VAR\nn := {name}(); t := Ä_{name};\nEND_PROGRAM"
    assert messages(check(tmp_path, text, home)) == []


@pytest.mark.parametrize("how", BETWEEN)
@pytest.mark.parametrize("kind", DECLARATIONS)
def test_condition_finds_a_declaration_with_anything_between_its_words(tmp_path: Path, kind: str, how: str) -> None:
    asked = "type" if "TYPE" in DECLARATIONS[kind] else "pou"
    text = f"""{written(DECLARATIONS[kind], BETWEEN[how])}
PROGRAM Main
{{IF NOT defined({asked}: Get)}} nowhere := 1; {{END_IF}}
END_PROGRAM
"""
    assert messages(check(tmp_path, text)) == []


def test_condition_finds_every_variable_of_a_list(tmp_path: Path) -> None:
    text = """VAR_GLOBAL a (* first *), b, größe : INT; list : ARRAY[0..1] OF INT; END_VAR
PROGRAM Main
{IF NOT (defined(variable: a) AND defined(variable: b) AND defined(variable: größe))} nowhere := 1; {END_IF}
{IF defined(variable: c)} nowhere := 2; {END_IF}
END_PROGRAM
"""
    assert messages(check(tmp_path, text)) == []


def test_condition_does_not_find_what_is_in_a_comment(tmp_path: Path) -> None:
    text = """(*
FUNCTION Get : INT
TYPE T : INT; END_TYPE
VAR_GLOBAL g : INT; END_VAR
*)
PROGRAM Main
{IF defined(pou: Get) OR defined(type: T) OR defined(variable: g)} nowhere := 1; {END_IF}
END_PROGRAM
"""
    assert messages(check(tmp_path, text)) == []
