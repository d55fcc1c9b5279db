"""Whatever word the compiler takes does something, or is named in an error or a warning: every section in every kind of
unit, every qualifier of a section, every modifier of a unit, every attribute, pragma and property of a task."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from front_support import check, findings, messages

import plctool.compiler
from plctool.compiler.front import Source, check_sources
from plctool.compiler.semantics.configuration import _Reader
from plctool.compiler.semantics.permitted import MODIFIERS, SECTIONS
from plctool.compiler.semantics.unit_tests import TestSuite as Suite
from plctool.compiler.syntax import attributes
from plctool.compiler.syntax.lexer import KEYWORDS
from plctool.iec.areas import Area

MAIN = "PROGRAM Main\nVAR k : INT; END_VAR\nk := 1;\nEND_PROGRAM\n"
UNITS = {
    "FUNCTION": "FUNCTION F : INT\n{}F := 1;\nEND_FUNCTION\n",
    "FUNCTION_BLOCK": "FUNCTION_BLOCK F\n{}END_FUNCTION_BLOCK\n",
    "CLASS": "CLASS F\n{}END_CLASS\n",
    "PROGRAM": "PROGRAM F\n{}END_PROGRAM\n",
    "METHOD": "FUNCTION_BLOCK F\nMETHOD m : INT\n{}m := 1;\nEND_METHOD\nEND_FUNCTION_BLOCK\n",
    "METHOD of a PROGRAM": "PROGRAM F\nMETHOD m : INT\n{}m := 1;\nEND_METHOD\nEND_PROGRAM\n",
    "method of an INTERFACE": "INTERFACE F\nMETHOD m : INT\n{}END_METHOD\nEND_INTERFACE\n",
    "property of an INTERFACE": "INTERFACE F\nPROPERTY p : INT\n{}GET\nEND_GET\nEND_PROPERTY\nEND_INTERFACE\n",
    "PROPERTY": "CLASS F\nPROPERTY p : INT\n{}GET\np := 1;\nEND_GET\nEND_PROPERTY\nEND_CLASS\n",
    "GET": "CLASS F\nPROPERTY p : INT\nGET\n{}p := 1;\nEND_GET\nEND_PROPERTY\nEND_CLASS\n",
    "SET": "CLASS F\nPROPERTY p : INT\nSET\n{}END_SET\nEND_PROPERTY\nEND_CLASS\n",
    "TEST": "TEST 'a'\n{}ASSERT_EQ(1, 1);\nEND_TEST\n",
    "SETUP": "SETUP\n{}END_SETUP\nTEST 'a'\nASSERT_EQ(1, 1);\nEND_TEST\n",
    "TEARDOWN": "TEARDOWN\n{}END_TEARDOWN\nTEST 'a'\nASSERT_EQ(1, 1);\nEND_TEST\n",
}
KEEP = "RETAIN NON_RETAIN PERSISTENT"
ACCESS = "PUBLIC PRIVATE PROTECTED INTERNAL"
CALL = {"VAR": "CONSTANT", "VAR_TEMP": "CONSTANT", "VAR_STAT": f"CONSTANT {KEEP}", "VAR_EXTERNAL": "CONSTANT"}
TEST = {"VAR": "CONSTANT", "VAR_TEMP": "CONSTANT", "VAR_EXTERNAL": "CONSTANT"}
HANDED = {"VAR_INPUT": "CONSTANT", "VAR_OUTPUT": "", "VAR_IN_OUT": "CONSTANT"}
LASTING = {"VAR": f"CONSTANT {KEEP} {ACCESS}", "VAR_INPUT": f"CONSTANT {KEEP}", "VAR_OUTPUT": KEEP}
INST = {"VAR_INST": KEEP}
EXPECTED = {
    "FUNCTION": CALL | HANDED,
    "FUNCTION_BLOCK": CALL | LASTING | {"VAR_IN_OUT": "CONSTANT", "VAR_GENERIC": "CONSTANT"},
    "CLASS": CALL | {"VAR": LASTING["VAR"]},
    "PROGRAM": CALL | LASTING | {"VAR_IN_OUT": "CONSTANT"},
    "METHOD": CALL | HANDED | INST,
    "METHOD of a PROGRAM": CALL | HANDED | INST,
    "method of an INTERFACE": HANDED,
    "property of an INTERFACE": {},
    "PROPERTY": CALL | INST,
    "GET": CALL | INST,
    "SET": CALL | INST,
    "TEST": TEST,
    "SETUP": TEST,
    "TEARDOWN": TEST,
}
"""What the issue's table says: for each kind of unit its sections and the words that do something there."""

SECTION_WORDS = {word for word, kind in KEYWORDS.items() if kind == "VAR"}
WORDS = {word for word, kind in KEYWORDS.items() if kind in ("QUALIFIER", "MODIFIER")}


def errors_of(text: str) -> list[str]:
    result = check_sources([Source("f.st", text)], tests=Suite() if "TEST" in text else None)
    return [d.message for d in result.diagnostics if d.severity == "error"]


def text_with(kind: str, section: str) -> str:
    declared = f"{section}\nx : INT;\nEND_VAR\n"
    shared = "VAR_GLOBAL\nx : INT;\nEND_VAR\n" if section.startswith("VAR_EXTERNAL") else ""
    return shared + UNITS[kind].format(declared) + MAIN


# ---- sections and their qualifiers ---------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", UNITS)
def test_a_section_is_taken_where_it_does_something(kind: str) -> None:
    taken = {section for section in SECTION_WORDS if not errors_of(text_with(kind, section))}
    assert taken == set(EXPECTED[kind])


@pytest.mark.parametrize(("kind", "section"), [(k, s) for k in UNITS for s in EXPECTED[k]])
def test_a_qualifier_is_taken_where_it_does_something(kind: str, section: str) -> None:
    found = {word: errors_of(text_with(kind, f"{section} {word}")) for word in WORDS}
    assert {word for word, errors in found.items() if not errors} == set(EXPECTED[kind][section].split())
    for word, errors in found.items():
        assert len(errors) <= 1
        assert all(word in message for message in errors)


@pytest.mark.parametrize("word", sorted(WORDS))
def test_qualifiers_of_global_variables(word: str) -> None:
    allowed = f"CONSTANT {KEEP} PUBLIC INTERNAL".split()
    errors = errors_of(f"VAR_GLOBAL {word}\nx : INT;\nEND_VAR\n" + MAIN)
    assert bool(errors) is (word not in allowed), errors


def test_every_word_that_the_grammar_takes_is_in_the_tables() -> None:
    """A new section, qualifier or modifier needs an entry."""
    tables = [words for sections in SECTIONS.values() for words in sections.values()]
    assert {"VAR_GLOBAL", *SECTION_WORDS} == {section for sections in SECTIONS.values() for section in sections}
    assert set().union(*tables, *MODIFIERS.values()) == WORDS


@pytest.mark.parametrize("word", KEEP.split())
@pytest.mark.parametrize("section", ["VAR", "VAR_INPUT", "VAR_OUTPUT", "VAR_STAT"])
@pytest.mark.parametrize("kind", ["PROGRAM", "FUNCTION_BLOCK"])
def test_what_is_kept_lies_in_retain_memory(kind: str, section: str, word: str) -> None:
    inside = f"{section} {word}\nx : INT;\nEND_VAR\n"
    body = "PROGRAM Main\nVAR f : F; END_VAR\nf();\nEND_PROGRAM\n"
    if kind == "PROGRAM":
        body = "CONFIGURATION C\nTASK t(INTERVAL := T#1s);\nPROGRAM Main WITH t : F;\nEND_CONFIGURATION\n"
    result = check(UNITS[kind].format(inside) + body)
    assert result.program is not None
    areas = {v.area for v in result.program.globals}
    assert (Area.RETAIN in areas) is (word != "NON_RETAIN")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("VAR RETAIN NON_RETAIN", "a variable cannot be RETAIN and NON_RETAIN; choose one"),
        ("VAR PUBLIC PRIVATE", "a variable cannot be PRIVATE and PUBLIC; choose one"),
        (
            "VAR_IN_OUT RETAIN",
            "a VAR_IN_OUT cannot be RETAIN: it is a variable of the caller; write it where that is declared",
        ),
        ("VAR_TEMP RETAIN", "a VAR_TEMP cannot be RETAIN: it lives for one call; VAR RETAIN keeps a value"),
        ("VAR_OUTPUT CONSTANT", "a VAR_OUTPUT cannot be CONSTANT: it is there to be written"),
        ("VAR_INPUT PRIVATE", "PRIVATE is for VAR; a VAR_INPUT is visible to all callers; leave it out"),
        ("VAR FINAL", "FINAL is for blocks and methods, not for variables; leave it out"),
        ("VAR_INST", "a FUNCTION_BLOCK has no VAR_INST; VAR keeps its value from call to call"),
    ],
)
def test_the_error_says_what_to_write(text: str, said: str) -> None:
    assert errors_of(text_with("FUNCTION_BLOCK", text)) == [said]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "FUNCTION_BLOCK F\nVAR CONSTANT RETAIN\nx : INT;\nEND_VAR\nEND_FUNCTION_BLOCK\n",
            "2:1: RETAIN has no effect here: a constant never changes; leave it out",
        ),
        (
            "PROGRAM F\nVAR PRIVATE\nx : INT;\nEND_VAR\nEND_PROGRAM\n",
            "2:1: PRIVATE has no effect in a PROGRAM: other POUs see its variables all the same; leave it out",
        ),
        (
            "FUNCTION_BLOCK F\nVAR_IN_OUT\nx : INT := 5;\nEND_VAR\nEND_FUNCTION_BLOCK\n",
            "3:1: this initial value has no effect: each call gives x a variable; leave it out",
        ),
        (
            "PROGRAM F\nVAR_EXTERNAL\ng : INT := 5;\nEND_VAR\nEND_PROGRAM\nVAR_GLOBAL g : INT; END_VAR\n",
            "3:1: this initial value has no effect: g gets the one of its VAR_GLOBAL; write it there",
        ),
    ],
)
def test_a_word_without_effect_is_a_warning(text: str, said: str) -> None:
    assert [m for m in messages(text + MAIN, "warning") if "effect" in m] == [said]


def test_a_constant_has_no_address() -> None:
    text = "VAR_GLOBAL CONSTANT\nc AT %MW0 : INT := 5;\nEND_VAR\n" + MAIN
    assert messages(text) == ["2:6: the constant c has no address; leave out CONSTANT or AT"]


def test_a_constant_input_of_a_program_is_only_read() -> None:
    text = "PROGRAM Main\nVAR_INPUT CONSTANT x : INT; END_VAR\nx := 1;\nEND_PROGRAM\n"
    assert messages(text) == ["3:1: x is a constant and cannot be assigned to"]


# ---- modifiers of units --------------------------------------------------------------------------------------------

HEADS = {
    "FUNCTION": "FUNCTION {} F : INT\nF := 1;\nEND_FUNCTION\n",
    "FUNCTION_BLOCK": "FUNCTION_BLOCK {} F\nEND_FUNCTION_BLOCK\n",
    "CLASS": "CLASS {} F\nEND_CLASS\n",
    "PROGRAM": "PROGRAM {} F\nEND_PROGRAM\n",
    "INTERFACE": "INTERFACE {} F\nEND_INTERFACE\n",
    "METHOD": "FUNCTION_BLOCK ABSTRACT F EXTENDS B\nMETHOD {} m\nEND_METHOD\nEND_FUNCTION_BLOCK\n",
    "PROPERTY": "CLASS ABSTRACT F EXTENDS B\nPROPERTY {} p : INT\nGET\nEND_GET\nEND_PROPERTY\nEND_CLASS\n",
    "method of an INTERFACE": "INTERFACE F\nMETHOD {} m\nEND_METHOD\nEND_INTERFACE\n",
    "property of an INTERFACE": "INTERFACE F\nPROPERTY {} p : INT\nGET\nEND_GET\nEND_PROPERTY\nEND_INTERFACE\n",
    "NAMESPACE": "NAMESPACE {} N\nFUNCTION_BLOCK F\nEND_FUNCTION_BLOCK\nEND_NAMESPACE\n",
    "TYPE": "TYPE {} F : (A, Z); END_TYPE\n",
}
BASE = "CLASS B\nMETHOD m\nEND_METHOD\nPROPERTY p : INT\nGET\np := 1;\nEND_GET\nEND_PROPERTY\nEND_CLASS\n"
TAKEN = {
    "FUNCTION": "PUBLIC INTERNAL",
    "FUNCTION_BLOCK": "PUBLIC INTERNAL ABSTRACT FINAL",
    "CLASS": "PUBLIC INTERNAL ABSTRACT FINAL",
    "PROGRAM": "PUBLIC INTERNAL",
    "INTERFACE": "PUBLIC INTERNAL",
    "METHOD": f"{ACCESS} ABSTRACT FINAL OVERRIDE",
    "PROPERTY": f"{ACCESS} ABSTRACT FINAL OVERRIDE",
    "method of an INTERFACE": "PUBLIC ABSTRACT FINAL INTERNAL PROTECTED",  # the last three with a warning
    "property of an INTERFACE": "PUBLIC ABSTRACT FINAL INTERNAL PROTECTED",
    "NAMESPACE": "PUBLIC INTERNAL",
    "TYPE": "PUBLIC INTERNAL",
}


@pytest.mark.parametrize("kind", HEADS)
def test_a_modifier_is_taken_where_it_does_something(kind: str) -> None:
    modifiers = {word for word, terminal in KEYWORDS.items() if terminal == "MODIFIER"}
    taken = {word for word in modifiers if not errors_of(HEADS[kind].format(word) + BASE + MAIN)}
    assert taken == set(TAKEN[kind].split())


def test_every_kind_of_unit_is_in_the_table() -> None:
    assert {*HEADS, "ACTION"} - {"NAMESPACE"} == set(MODIFIERS)  # those of NAMESPACE are in the grammar


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("FUNCTION_BLOCK ABSTRACT FINAL", "F cannot be ABSTRACT and FINAL: derived blocks complete what is ABSTRACT"),
        ("FUNCTION_BLOCK PUBLIC INTERNAL", "F cannot be INTERNAL and PUBLIC; choose one"),
        ("FUNCTION_BLOCK PRIVATE", "a FUNCTION_BLOCK cannot be PRIVATE; it may be ABSTRACT, FINAL, INTERNAL or PUBLIC"),
        (
            "FUNCTION_BLOCK OVERRIDE",
            "a FUNCTION_BLOCK cannot be OVERRIDE; it may be ABSTRACT, FINAL, INTERNAL or PUBLIC",
        ),
    ],
)
def test_modifiers_that_contradict_each_other_are_an_error(head: str, said: str) -> None:
    assert errors_of(f"{head} F\nEND_FUNCTION_BLOCK\n" + MAIN) == [said]


def test_a_public_namespace_is_seen_from_outside() -> None:
    inside = "NAMESPACE {} N\nFUNCTION F : INT\nF := 1;\nEND_FUNCTION\nEND_NAMESPACE\n"
    use = "PROGRAM Main\nVAR k : INT; END_VAR\nk := A.N.F();\nEND_PROGRAM\n"
    outer = "NAMESPACE A\n{}END_NAMESPACE\n"
    assert not errors_of(outer.format(inside.format("PUBLIC")) + use)
    assert errors_of(outer.format(inside.format("INTERNAL")) + use)


def test_a_structure_does_not_overlap() -> None:
    said = errors_of("TYPE S : STRUCT OVERLAP a : INT; END_STRUCT END_TYPE\n" + MAIN)
    assert said == ["the members of a STRUCT do not overlap; those of a UNION do"]
    assert not errors_of("TYPE S : UNION OVERLAP a : INT; END_UNION END_TYPE\n" + MAIN)


# ---- attributes and pragmas ----------------------------------------------------------------------------------------

PLACES = {
    "FUNCTION": "{}\nFUNCTION F : INT\nEND_FUNCTION\n",
    "FUNCTION_BLOCK": "{}\nFUNCTION_BLOCK F\nEND_FUNCTION_BLOCK\n",
    "PROGRAM": "{}\nPROGRAM F\nEND_PROGRAM\n",
    "METHOD": "CLASS F\n{}\nMETHOD m\nEND_METHOD\nEND_CLASS\n",
    "VAR_GLOBAL": "{}\nVAR_GLOBAL\nx : INT;\nEND_VAR\n",
    "variable": "VAR_GLOBAL\n{}\nx : INT;\nEND_VAR\n",
    "enumeration": "{}\nTYPE T : (a, b); END_TYPE\n",
    "named enumeration": "TYPE\n{}\nT : (a, b); END_TYPE\n",
    "structure": "{}\nTYPE T : STRUCT a : INT; END_STRUCT END_TYPE\n",
    "nothing": "FUNCTION_BLOCK F\n{}\nEND_FUNCTION_BLOCK\n",
}
HEEDED_AT = {
    "qualified_only": {"VAR_GLOBAL", "enumeration", "named enumeration"},
    "external": {"FUNCTION", "FUNCTION_BLOCK"},
    "shared_output": {"variable"},
}


def effects(name: str, place: str, value: str = "") -> list[tuple[str, str]]:
    text = f"{{attribute '{name}'{value}}}"
    found = check(PLACES[place].format(text) + MAIN).diagnostics
    return [(d.severity, d.message) for d in found if d.code in ("no-effect", "attribute")]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", sorted(HEEDED_AT))
def test_an_attribute_that_is_heeded_says_so_where_it_is_not(name: str, place: str) -> None:
    found = effects(name, place, " := 'f'" if name == "external" else "")
    assert (not found) is (place in HEEDED_AT[name])
    assert all(name in message or "written in C" in message for _, message in found)


def test_code_in_c_is_for_functions_and_blocks() -> None:
    assert effects("external", "PROGRAM", " := 'f'") == [
        ("error", "only a FUNCTION or FUNCTION_BLOCK can be written in C, not a PROGRAM")
    ]
    assert effects("external_name", "FUNCTION", " := 'f'") == [
        ("error", "the name of a function in C is written {attribute 'external' := 'name'}")
    ]
    body = "{attribute 'external' := 'f'}\nFUNCTION F : INT\nVAR\nx : INT;\nEND_VAR\nF := 1;\nEND_FUNCTION\n"
    assert messages(body + MAIN) == [
        "3:1: F is written in C, so it has no VAR here",
        "6:1: F is written in C, so it has no statements here",
    ]


@pytest.mark.parametrize("name", sorted(attributes.UNHEEDED))
def test_an_attribute_that_changes_other_systems_is_a_warning(name: str) -> None:
    for place in PLACES:
        found = effects(name, place)
        assert len(found) == 1, place
        severity, message = found[0]
        assert severity == "warning"
        assert message == f"{{attribute '{name}'}} has no effect here: {attributes.UNHEEDED[name]}"


@pytest.mark.parametrize("name", sorted(attributes.OF_THE_LIBRARY))
def test_an_attribute_of_the_library_is_not_for_programs(name: str) -> None:
    assert [severity for severity, _ in effects(name, "FUNCTION")] == ["warning"]


def test_locals_are_zero_whatever_an_attribute_says() -> None:
    text = "{attribute 'no_init'}\nFUNCTION F : INT\nVAR x : INT; END_VAR\nF := x;\nEND_FUNCTION\n"
    result = check(text + "PROGRAM Main\nVAR k : INT; END_VAR\nk := F();\nEND_PROGRAM\n")
    assert result.program is not None
    assert not any(pou.no_init for pou in result.program.pous)


@pytest.mark.parametrize("name", [*sorted(attributes.SILENT), "a_name_that_nobody_knows", "OPC.UA.DA.Access", "TcHmiX"])
def test_an_attribute_that_changes_nothing_says_nothing(name: str) -> None:
    assert not effects(name, "FUNCTION_BLOCK")


@pytest.mark.parametrize(
    ("written", "meant"), [("qualifed_only", "qualified_only"), ("pack_mod", "pack_mode"), ("to_strng", "to_string")]
)
def test_a_misspelt_attribute_is_a_warning(written: str, meant: str) -> None:
    said = f"{{attribute '{written}'}} has no effect here: did you mean '{meant}'?"
    assert effects(written, "enumeration") == [("warning", said)]


@pytest.mark.parametrize("name", ["call_on_start", "run_after_init2", "execute_on_stop"])
def test_an_unknown_attribute_about_when_something_runs_is_a_warning(name: str) -> None:
    ((severity, message),) = effects(name, "FUNCTION")
    assert severity == "warning" and message.startswith(f"{{attribute '{name}'}} has no effect here: call it")


def test_a_symbol_that_all_may_read_and_write_is_as_it_is_here() -> None:
    for value, said in (("readwrite", 0), ("ReadWrite", 0), ("read", 1), ("none", 1), ("write", 1)):
        text = f"VAR_GLOBAL\n{{attribute 'symbol' := '{value}'}}\na : INT;\nEND_VAR\n{MAIN}"
        assert sum("'symbol'" in d.message for d in check(text).diagnostics) == said, value


def test_the_documentation_lists_every_attribute() -> None:
    page = (Path(__file__).parents[2] / "docs" / "language.md").read_text()
    section = page.partition("\n## Attributes\n")[2].partition("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("| ")][1:]
    listed = [set(re.findall(r"`([^`]+)`", line.split("|")[2])) for line in rows]
    assert listed[0] == set(attributes.HEEDED)
    assert listed[1] == set(attributes.UNHEEDED) | {"call_on_start"}
    assert listed[2] == set(attributes.SILENT)


def test_every_attribute_the_compiler_reads_is_in_the_tables() -> None:
    """A new attribute needs an entry."""
    read: set[str] = set()
    for path in Path(plctool.compiler.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Compare) and isinstance(node.left, ast.Constant):
                if "attributes" in ast.unparse(node.comparators[0]).lower():
                    read.add(str(node.left.value))
            elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("attributes.get"):
                read |= {str(a.value) for a in node.args[:1] if isinstance(a, ast.Constant)}
    assert read == set(attributes.HEEDED) | attributes.OF_THE_LIBRARY


def test_no_name_is_in_two_tables() -> None:
    tables = [set(attributes.HEEDED), set(attributes.UNHEEDED), set(attributes.SILENT)]
    assert sum(map(len, tables)) == len(set().union(*tables))


@pytest.mark.parametrize(
    ("pragma", "found"),
    [
        ("{error 'not on this device'}", [("error", "pragma", "not on this device")]),
        ("{warning 'slow'}", [("warning", "pragma", "slow")]),
        ("{info 'x'}", []),
        ("{text 'x'}", []),
        ("{region 'x'}", []),
        ("{analysis -33}", []),
        ("{IF defined(NONE)} {error 'never'} {END_IF}", []),
        (
            "{external}",
            [("error", "pragma", "the name of a function in C is written {attribute 'external' := 'name'}")],
        ),
        (
            "{flag noinit on}",
            [
                (
                    "warning",
                    "no-effect",
                    "{flag noinit} has no effect here: every variable starts with its initial value",
                )
            ],
        ),
        *(
            (
                pragma,
                [
                    (
                        "warning",
                        "no-effect",
                        "this attribute has no effect: it is written {attribute 'name'} or "
                        "{attribute 'name' := 'text'}",
                    )
                ],
            )
            for pragma in ('{attribute "hide"}', "{attribut 'hide'}", "{atribute 'hide'}")
        ),
    ],
)
def test_pragmas(pragma: str, found: list[tuple[str, str, str]]) -> None:
    result = check(f"{pragma}\n{MAIN}")
    assert [(d.severity, d.code, d.message) for d in result.diagnostics] == found


# ---- properties of a task ------------------------------------------------------------------------------------------

PROPERTIES = {
    "INTERVAL": "T#5ms",
    "PRIORITY": "3",
    "SINGLE": "g",
    "LEVEL": "g",
    "EVENT": "'door'",
    "WATCHDOG": "T#7ms",
    "SENSITIVITY": "4",
}


def task(properties: str) -> str:
    return (
        "VAR_GLOBAL g : BOOL; END_VAR\n" + MAIN + "CONFIGURATION C\n"
        f"TASK t({properties});\nPROGRAM p WITH t : Main;\nEND_CONFIGURATION\n"
    )


def test_every_property_of_a_task_changes_it() -> None:
    assert set(PROPERTIES) == set(_Reader._properties)
    before = check(task("INTERVAL := T#9ms, WATCHDOG := T#9ms")).program
    assert before is not None
    for name, value in PROPERTIES.items():
        rest = {"INTERVAL": "T#9ms", "WATCHDOG": "T#9ms"} | {name: value}
        if name in ("SINGLE", "LEVEL", "EVENT"):
            del rest["INTERVAL"]
        after = check(task(", ".join(f"{k} := {v}" for k, v in rest.items()))).program
        assert after is not None
        old, new = ({k: v for k, v in vars(p.tasks[0]).items() if k != "programs"} for p in (before, after))
        assert old != new, name


@pytest.mark.parametrize(
    ("properties", "said"),
    [
        ("PRIORITY := 1, PRIORITY := 2", "PRIORITY of the task t is given twice"),
        ("INTERVAL := T#1s, SINGLE := g", "a TASK runs by INTERVAL or by SINGLE, not by both: write another task"),
        ("SINGLE := g, INTERVAL := T#1s", "a TASK runs by SINGLE or by INTERVAL, not by both: write another task"),
    ],
)
def test_properties_that_contradict_each_other_are_an_error(properties: str, said: str) -> None:
    assert errors_of(task(properties)) == [said]


def test_a_program_instance_may_be_kept_or_not() -> None:
    for word in sorted(WORDS):
        text = task("INTERVAL := T#1s").replace("PROGRAM p", f"PROGRAM {word} p")
        assert (not findings(text)) is (word in KEEP.split()), word


def test_an_action_of_an_interface_is_an_error() -> None:
    found = errors_of("INTERFACE F\nACTION a:\nEND_ACTION\nEND_INTERFACE\n")
    assert any("an INTERFACE has no ACTION; it has METHOD and PROPERTY" in message for message in found)
