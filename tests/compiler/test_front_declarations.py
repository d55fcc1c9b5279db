"""Types, variables, initial values and where things are in memory."""

from __future__ import annotations

import pytest
from front_support import check, findings, main, messages, program, variable

from plctool.compiler.front import Source, check_sources
from plctool.compiler.typed.nodes import ArrayInit, Const, ScalarInit, Storage, StructInit, TypedProgram
from plctool.iec.areas import Area
from plctool.iec.types import ArrayType, EnumType, StringType, StructType, SubrangeType

COLOR = "TYPE Color : (Red, Green := 5, Blue); END_TYPE\n"
FUNCTION = "FUNCTION F : INT VAR_INPUT a : INT; END_VAR VAR b : INT := {}; END_VAR F := a + b; END_FUNCTION\n"
POINT = "TYPE Point : STRUCT x : INT := 1; y : INT; name : STRING[10]; END_STRUCT END_TYPE\n"


def initial(declared: str, before: str = "") -> object:
    """The initial value of variable v."""
    return variable(program(main(f"v : {declared};", before=before)), "Main.v").initial


# ---- types ----


def test_enumeration_counts_on_from_given_values() -> None:
    t = variable(program(main("v : Color;", before=COLOR)), "Main.v").type
    assert isinstance(t, EnumType)
    assert t.values == {"Red": 0, "Green": 5, "Blue": 6}


@pytest.mark.parametrize("spec", ["(A, B) USINT", "USINT (A, B)"])
def test_enumeration_may_have_a_base_type(spec: str) -> None:
    t = variable(program(main("v : E;", before=f"TYPE E : {spec}; END_TYPE\n")), "Main.v").type
    assert t.size == 1


def test_enumeration_starts_with_its_first_value() -> None:
    assert initial("E", "TYPE E : (A := 3, B); END_TYPE\n") == ScalarInit(3)


def test_enumeration_values_may_refer_to_earlier_ones() -> None:
    t = variable(program(main("v : E;", before="TYPE E : (A := 3, B := A * 2); END_TYPE\n")), "Main.v").type
    assert isinstance(t, EnumType)
    assert t.values["B"] == 6


def test_structure_is_laid_out_with_natural_alignment() -> None:
    before = "TYPE S : STRUCT a : BYTE; b : DINT; c : BOOL; d : LREAL; END_STRUCT END_TYPE\n"
    t = variable(program(main("v : S;", before=before)), "Main.v").type
    assert isinstance(t, StructType)
    assert [f.offset for f in t.fields] == [0, 4, 8, 16]
    assert (t.size, t.align) == (24, 8)


def test_array_bounds_may_be_constant_expressions() -> None:
    text = "VAR_GLOBAL CONSTANT N : INT := 4; END_VAR\n" + main("v : ARRAY[-N..N * 2, 0..1] OF BYTE;")
    t = variable(program(text), "Main.v").type
    assert isinstance(t, ArrayType)
    assert t.bounds == ((-4, 8), (0, 1))


def test_alias_is_the_type_it_names_and_brings_its_initial_value() -> None:
    assert initial("Speed", "TYPE Speed : REAL := 2.5; END_TYPE\n") == ScalarInit(2.5)


def test_subrange_starts_with_its_lower_limit() -> None:
    p = program(main("v : Percent; w : INT(-3..3);", before="TYPE Percent : INT(10..100); END_TYPE\n"))
    assert variable(p, "Main.v").initial == ScalarInit(10)
    assert isinstance(variable(p, "Main.w").type, SubrangeType)


@pytest.mark.parametrize("spec", ["STRING[20]", "STRING(20)", "STRING[N]", "STRING(N)"])
def test_string_has_the_length_given(spec: str) -> None:
    text = "VAR_GLOBAL CONSTANT N : INT := 20; END_VAR\n" + main(f"v : {spec};")
    assert variable(program(text), "Main.v").type == StringType(20)


def test_string_without_length_holds_80_characters() -> None:
    assert variable(program(main("v : STRING;")), "Main.v").type == StringType(80)


def test_declarations_may_come_in_any_order() -> None:
    program(
        main("v : Outer;")
        + "TYPE Outer : ARRAY[0..N] OF Inner; END_TYPE\nVAR_GLOBAL CONSTANT N : INT := M; M : INT := 2;"
        " END_VAR\nTYPE Inner : STRUCT a : INT; END_STRUCT END_TYPE"
    )


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        (main("v : Foo;"), "3:5", "unknown type Foo"),
        (main("v : INTT;"), "3:5", "did you mean INT"),
        (main("v : ARRAY[5..1] OF INT;"), "3:11", "above"),
        (main("x : INT; v : ARRAY[1..x] OF INT;"), "3:23", "constant"),
        (main("v : INT(5..1);"), "3:9", "not a range"),
        (main("v : REAL(1..5);"), "3:5", "integer base type"),
        (main("v : STRING[0];"), "3:12", "1..65535"),
        (main("v : INT[5];"), "3:5", "only a STRING has a length"),
        (main("v : Main;"), "3:5", "not a type"),
        (main("v : ANY_NUM;"), "3:5", "parameters of functions"),
        (main("v : ARRAY[0..2147483647] OF LREAL;"), "3:5", "too large"),
        ("TYPE T : STRUCT a : T; END_STRUCT END_TYPE", "1:21", "contains itself"),
        ("TYPE T : ARRAY[0..1] OF U; END_TYPE TYPE U : T; END_TYPE", "1:46", "contains itself"),
        ("FUNCTION_BLOCK F VAR a : F; END_VAR END_FUNCTION_BLOCK", "1:26", "contains itself"),
        ("TYPE E : (A, B, A); END_TYPE", "1:17", "already"),
        ("TYPE E : (A := 40000); END_TYPE", "1:11", "does not fit INT"),
        ("TYPE S : STRUCT a : INT; A : INT; END_STRUCT END_TYPE", "1:26", "already"),
        ("TYPE INT : DINT; END_TYPE", "1:6", "elementary type"),
        ("TYPE T : INT; END_TYPE TYPE t : INT; END_TYPE", "1:29", "declared already in line 1"),
    ],
)
def test_wrong_type_is_explained(text: str, place: str, words: str) -> None:
    found = messages(text)
    assert len(found) == 1, found
    assert found[0].startswith(place + ": ")
    assert words in found[0]


def test_variable_may_have_the_name_of_its_type() -> None:
    before = COLOR + "VAR_GLOBAL point : Point; END_VAR\n" + POINT
    p = program(
        main("color : Color; ton : TON; x : INT;", "color := Color.Green; ton(IN := TRUE); x := point.y;", before)
    )
    assert str(variable(p, "Main.ton").type) == "TON"
    assert str(variable(p, "point").type) == "Point"


# ---- initial values ----


@pytest.mark.parametrize(
    ("declared", "value"),
    [
        ("INT := 5", ScalarInit(5)),
        ("INT := 0", None),
        ("INT", None),
        ("REAL := 1", ScalarInit(1.0)),
        ("BOOL := TRUE", ScalarInit(1)),
        ("TIME := T#1s", ScalarInit(1000)),
        ("LTIME := T#1s", ScalarInit(1_000_000_000)),
        ("STRING := 'ab'", ScalarInit("ab")),
        ("STRING[3] := 'abcdef'", ScalarInit("abc")),
        ("BYTE := 16#FF", ScalarInit(255)),
        ("DINT := 3 * (4 + 5) - 2 ** 3", ScalarInit(19)),
        ("ARRAY[1..3] OF INT := [1, 2, 3]", ArrayInit([(1, ScalarInit(1)), (1, ScalarInit(2)), (1, ScalarInit(3))])),
        ("ARRAY[1..9] OF INT := [2(7), 3]", ArrayInit([(2, ScalarInit(7)), (1, ScalarInit(3))])),
        ("ARRAY[1..6] OF INT := [3(1, 2)]", ArrayInit([(1, ScalarInit(1)), (1, ScalarInit(2))] * 3)),
        ("ARRAY[1..6] OF INT := [2(), 1]", ArrayInit([(2, None), (1, ScalarInit(1))])),
        (
            "ARRAY[0..1, 0..2] OF INT := [[1], [2, 3, 4]]",
            ArrayInit([(1, ScalarInit(1)), (2, None), (1, ScalarInit(2)), (1, ScalarInit(3)), (1, ScalarInit(4))]),
        ),
        (
            "ARRAY[0..1] OF ARRAY[0..1] OF INT := [[1, 2], [3]]",
            ArrayInit(
                [
                    (1, ArrayInit([(1, ScalarInit(1)), (1, ScalarInit(2))])),
                    (1, ArrayInit([(1, ScalarInit(3))])),
                ]
            ),
        ),
    ],
)
def test_initial_value_is_calculated(declared: str, value: object) -> None:
    assert initial(declared) == value


def test_repetition_may_be_counted_by_a_constant() -> None:
    text = "VAR_GLOBAL CONSTANT N : INT := 4; END_VAR\n" + main("v : ARRAY[1..8] OF INT := [N(3)];")
    assert variable(program(text), "Main.v").initial == ArrayInit([(4, ScalarInit(3))])


def test_structure_takes_the_defaults_of_its_type() -> None:
    p = program(main("v : Point; w : Point := (y := 7, name := 'p'); a : ARRAY[1..2] OF Point;", before=POINT))
    assert p.defaults["Point"] == StructInit({"x": ScalarInit(1)})
    assert variable(p, "Main.v").initial == StructInit({})
    assert variable(p, "Main.w").initial == StructInit({"y": ScalarInit(7), "name": ScalarInit("p")})
    assert variable(p, "Main.a").initial == ArrayInit([], StructInit({}))


@pytest.mark.parametrize("spec", ["TON := (PT := T#1s)", "TON(PT := T#1s)"])
def test_function_block_is_initialised_where_it_is_declared(spec: str) -> None:
    assert initial(spec) == StructInit({"PT": ScalarInit(1000)})


def test_defaults_of_a_function_block_hold_those_of_its_parts() -> None:
    text = "FUNCTION_BLOCK F VAR p : Point; n : INT := 3; z : INT; END_VAR END_FUNCTION_BLOCK\n"
    p = program(main("v : F;", before=POINT + text))
    assert p.defaults["F"] == StructInit({"p": StructInit({}), "n": ScalarInit(3)})


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        ("INT := 40000", "does not fit INT"),
        ("INT := 1.5", "REAL_TO_INT"),
        ("INT := 'a'", "does not fit INT"),
        ("BOOL := 2", "does not fit BOOL"),
        ("ARRAY[1..2] OF INT := [1, 2, 3]", "3 initial values for the 2 elements"),
        ("INT := [1]", "does not initialise INT"),
        ("INT := (a := 1)", "does not initialise INT"),
        ("TON := (XX := 1)", "no member XX"),
        ("INT(1..5) := 6", "outside"),
        ("TIME := 5", "T#5ms"),
        ("ARRAY[1..9] OF INT := [-1(3)]", "expected"),
    ],
)
def test_wrong_initial_value_is_explained(declared: str, words: str) -> None:
    found = messages(main(f"w : INT; v : {declared};"))
    assert len(found) == 1, found
    assert words in found[0]


# ---- where variables live ----


def test_program_variables_lie_one_after_the_other_in_the_data_area() -> None:
    p = program(main("a : BYTE; b : DINT; c : INT;"))
    assert [(v.name, v.offset) for v in p.globals] == [("Main.a", 0), ("Main.b", 4), ("Main.c", 8)]
    assert p.area_sizes[Area.DATA] == 10


def test_retain_variables_lie_in_the_retain_area() -> None:
    text = "PROGRAM Main VAR RETAIN r : INT; END_VAR VAR PERSISTENT p : INT; END_VAR VAR n : INT; END_VAR END_PROGRAM"
    p = program(text)
    assert [variable(p, f"Main.{n}").area for n in "rpn"] == [Area.RETAIN, Area.RETAIN, Area.DATA]


@pytest.mark.parametrize("declared", ["F", "ARRAY[1..2] OF F", "Outer", "S"])
def test_function_block_with_a_retain_variable_is_retained_as_a_whole(declared: str) -> None:
    before = (
        "FUNCTION_BLOCK F VAR RETAIN r : INT; END_VAR VAR n : INT; END_VAR END_FUNCTION_BLOCK\n"
        "FUNCTION_BLOCK Outer VAR f : F; END_VAR END_FUNCTION_BLOCK\nTYPE S : STRUCT f : F; END_STRUCT END_TYPE\n"
    )
    assert variable(program(main(f"v : {declared};", before=before)), "Main.v").area is Area.RETAIN


def located(address: str, t: str) -> tuple[Area, int, int | None]:
    v = variable(program(main(f"v AT {address} : {t};")), "Main.v")
    return v.area, v.offset, v.bit


@pytest.mark.parametrize(
    ("address", "t", "place"),
    [
        ("%IX0.3", "BOOL", (Area.INPUT, 0, 3)),
        ("%QX2.0", "BOOL", (Area.OUTPUT, 2, 0)),
        ("%I1.7", "BOOL", (Area.INPUT, 1, 7)),
        ("%IB5", "BYTE", (Area.INPUT, 5, None)),
        ("%QW2", "INT", (Area.OUTPUT, 4, None)),
        ("%MD4", "REAL", (Area.MEMORY, 16, None)),
        ("%ml1", "LREAL", (Area.MEMORY, 8, None)),
        ("%IB3", "ARRAY[0..7] OF BYTE", (Area.INPUT, 3, None)),
        ("%IB4", "BOOL", (Area.INPUT, 4, None)),
    ],
)
def test_address_is_a_place_in_an_area(address: str, t: str, place: tuple[Area, int, int | None]) -> None:
    assert located(address, t) == place


def test_area_reaches_to_the_last_address() -> None:
    p = program(main("a AT %IW3 : WORD; b AT %IX9.0 : BOOL;"))
    assert p.area_sizes[Area.INPUT] == 10


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        ("v AT %QX0.9 : BOOL;", "not an address"),
        ("v AT %IX0.0 : INT;", "is a bit"),
        ("v AT %IX2.0 : ARRAY[0..7] OF BOOL;", "is a bit, ARRAY[0..7] OF BOOL is not; write %IB2"),
        ("v AT %IB1 : ARRAY[0..1] OF DINT;", "multiple of 4"),
        ("v AT %IB70000 : BYTE;", "too far"),
    ],
)
def test_wrong_address_is_explained(declared: str, words: str) -> None:
    found = messages(main(declared))
    assert len(found) == 1, found
    assert found[0].startswith("3:6: ")
    assert words in found[0]


def test_address_in_a_function_block_is_an_error() -> None:
    text = "FUNCTION_BLOCK F VAR x AT %IX0.0 : BOOL; END_VAR END_FUNCTION_BLOCK"
    assert findings(text) == [(1, 27, "location")]


def test_variables_of_a_function_live_on_the_stack() -> None:
    text = main(
        "v : INT;",
        "v := F(1);",
        FUNCTION.format("3"),
    )
    f = next(pou for pou in program(text).pous if pou.name == "F")
    assert [(v.name, v.storage) for v in f.locals] == [("F", Storage.LOCAL), ("b", Storage.LOCAL)]
    assert f.locals[1].initial == ScalarInit(3)


def test_initial_value_of_a_local_variable_may_be_calculated() -> None:
    text = main(
        "v : INT;",
        "v := F(1);",
        FUNCTION.format("a + 1"),
    )
    f = next(pou for pou in program(text).pous if pou.name == "F")
    assert len(f.body) == 2


def test_function_block_variables_are_members_of_the_instance() -> None:
    text = (
        "FUNCTION_BLOCK F VAR_INPUT a : BYTE; END_VAR VAR_IN_OUT b : INT; END_VAR VAR c : INT; END_VAR\n"
        "VAR_TEMP d : INT; END_VAR END_FUNCTION_BLOCK\n"
    )
    f = next(pou for pou in program(main("v : F;", before=text)).pous if pou.name == "F")
    assert f.instance is not None
    assert [(x.name, x.offset, x.type.size) for x in f.instance.fields] == [("a", 0, 1), ("b", 8, 8), ("c", 16, 2)]
    assert [p.variable.storage for p in f.parameters] == [Storage.SELF, Storage.REFERENCE]
    assert [v.name for v in f.locals] == ["d"]


def test_constant_array_of_a_function_block_exists_once() -> None:
    text = (
        "FUNCTION_BLOCK F VAR CONSTANT t : ARRAY[0..1] OF INT := [4, 5]; END_VAR VAR x : INT; END_VAR x := t[x];\n"
        "END_FUNCTION_BLOCK\n"
    )
    p = program(main("a, b : F;", before=text))
    assert [v.name for v in p.globals] == ["F.t", "Main.a", "Main.b"]
    assert variable(p, "F.t").constant


def test_scalar_constants_take_no_memory() -> None:
    p = program(
        "PROGRAM Main VAR CONSTANT N : INT := 5; S : STRING := 'x'; END_VAR VAR v : INT := N; END_VAR END_PROGRAM"
    )
    assert [v.name for v in p.globals] == ["Main.v"]


# ---- globals ----


def files(**texts: str) -> TypedProgram:
    result = check_sources([Source(f"{name}.st", text) for name, text in texts.items()])
    assert result.program is not None, result.diagnostics
    return result.program


def test_file_of_globals_is_a_named_list() -> None:
    p = files(GVL="VAR_GLOBAL x : INT; END_VAR", m=main("v, w : INT;", "v := x; w := GVL.x;"))
    assert [v.name for v in p.globals] == ["GVL.x", "Main.v", "Main.w"]
    assert p.aliases == {"x": "GVL.x"}


def test_globals_beside_programs_have_plain_names() -> None:
    p = files(m="VAR_GLOBAL x : INT; END_VAR\n" + main("v, w : INT;", "v := x; w := m.x;"))
    assert [v.name for v in p.globals] == ["x", "Main.v", "Main.w"]
    assert p.aliases == {"m.x": "x"}


def test_global_in_two_lists_needs_the_name_of_its_list() -> None:
    gvl = "VAR_GLOBAL x : INT; END_VAR"
    p = files(A=gvl, B=gvl, m=main("v : INT;", "v := A.x + B.x;"))
    assert [v.name for v in p.globals][:2] == ["A.x", "B.x"]
    found = check_sources([Source("A.st", gvl), Source("B.st", gvl), Source("m.st", main("v : INT;", "v := x;"))])
    assert [d.message for d in found.diagnostics] == ["x is in several lists; write A.x or B.x"]


def test_external_variable_is_the_global_one() -> None:
    text = "VAR_GLOBAL g : INT; END_VAR\nPROGRAM Main VAR_EXTERNAL g : INT; END_VAR g := 1; END_PROGRAM"
    assert [v.name for v in program(text).globals] == ["g"]


def test_external_variable_has_to_agree_with_the_global_one() -> None:
    text = "VAR_GLOBAL g : INT; END_VAR\nPROGRAM Main VAR_EXTERNAL g : DINT; h : INT; END_VAR END_PROGRAM"
    assert [code for *_, code in findings(text)] == ["type", "unknown"]


def test_constant_that_depends_on_itself_is_an_error() -> None:
    assert [c for *_, c in findings("VAR_GLOBAL CONSTANT a : INT := b; b : INT := a; END_VAR")] == ["recursion"]


@pytest.mark.parametrize("kind", ["VAR", "VAR_TEMP"])
def test_unused_variable_is_a_warning(kind: str) -> None:
    text = f"PROGRAM Main\n{kind} used, extra : INT; END_VAR\nused := 1;\nEND_PROGRAM"
    assert findings(text, "warning") == [(2, text.split("\n")[1].index("extra") + 1, "unused")]


def test_inputs_outputs_and_addresses_are_not_called_unused() -> None:
    text = (
        "PROGRAM Main VAR_INPUT a : INT; END_VAR VAR_OUTPUT b : INT; END_VAR VAR c AT %QX0.0 : BOOL; END_VAR\n"
        "END_PROGRAM"
    )
    assert check(text).diagnostics == []


def test_folded_constant_keeps_its_declared_type() -> None:
    text = "PROGRAM Main VAR CONSTANT N : USINT := 5; END_VAR VAR v : DINT; END_VAR v := N; END_PROGRAM"
    (assign,) = program(text).programs["Main"].body
    assert isinstance(assign.value, Const)  # type: ignore[union-attr]
    assert str(assign.value.type) == "DINT"  # type: ignore[union-attr]


def test_external_variable_of_several_lists_is_an_error() -> None:
    lists = [Source(f"{name}.st", "VAR_GLOBAL x : INT; END_VAR") for name in ("one", "two")]
    main_file = Source("main.st", "PROGRAM Main VAR_EXTERNAL x : INT; END_VAR x := 1; END_PROGRAM")
    found = [d.message for d in check_sources([*lists, main_file]).diagnostics if d.severity == "error"]
    assert "one.x or two.x" in found[0]


def test_external_variable_may_be_one_of_the_same_namespace() -> None:
    text = "NAMESPACE N VAR_GLOBAL x : INT; END_VAR\nFUNCTION_BLOCK F VAR_EXTERNAL x : INT; END_VAR x := 1;\n"
    assert messages(text + "END_FUNCTION_BLOCK END_NAMESPACE") == []


@pytest.mark.parametrize("name", ["größe", "Ström2", "_δ", "温度"])
def test_name_may_have_letters_of_any_language(name: str) -> None:
    text = f"PROGRAM Main VAR {name} : INT; END_VAR {name.upper()} := {name} + 1; END_PROGRAM"
    assert messages(text) == []


# ---- C functions ----


def external(name: str, inputs: str, version: str = "1.0") -> str:
    attributes = f"{{attribute 'external' := 'adc'}} {{attribute 'version' := '{version}'}}"
    return f"{attributes}\nFUNCTION {name} : DINT VAR_INPUT {inputs} END_VAR END_FUNCTION\n"


@pytest.mark.parametrize("other", [external("Other", "a : REAL; b : DINT;"), external("Other", "a : DINT;", "1.1")])
def test_c_function_is_declared_once_whether_it_is_called_or_not(other: str) -> None:
    assert messages(external("One", "a : DINT;") + other + main("n : DINT;")) == [
        "4:10: the C function adc is One already, with other parameters or another version: declare it once, and call "
        "that one"
    ]


def test_c_function_may_have_two_names() -> None:
    assert messages(external("One", "a : DINT;") + external("Same", "b : DINT;") + main("n : DINT;")) == []


def test_c_function_of_the_program_may_have_the_name_of_one_of_a_library() -> None:
    own = external("Own", "a : DINT;").replace("adc", "sin")
    assert messages(own + main("n : DINT;"), library=external("Sine", "a : LREAL;").replace("adc", "sin")) == []
