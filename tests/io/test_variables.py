"""Which variables channels lead to, and where these are."""

from __future__ import annotations

from pathlib import Path

from io_support import addresses, build, configuration, messages

MAIN = "PROGRAM Main\nVAR {} END_VAR\n{}\nEND_PROGRAM\n"


def test_variable_of_a_channel_is_in_the_inputs(tmp_path: Path) -> None:
    built = build(tmp_path, MAIN.format("start : BOOL; level : INT;", "level := level;"), "[sim.in]\na = 'Main.level'")
    (channel,) = configuration(built).task_maps[0].connectors[0].channels
    symbol = built.symbols.resolve("Main.level")
    assert (symbol.area, symbol.offset * 8) == (2, channel.area_bit)
    assert built.symbols.resolve("Main.start").area == 0


def test_variable_that_only_a_channel_names_is_used(tmp_path: Path) -> None:
    program = MAIN.format("recipe : INT; spare : INT; b : INT;", "b := 1;")
    found = messages(tmp_path, program, "[sim]\nin = { x = 'Main.recipe' }\nout = { y = 'Main.b' }")
    assert found == ["main.st:2: spare is never used"]


def test_variable_with_an_address_keeps_it(tmp_path: Path) -> None:
    program = MAIN.format("a AT %IX3.5 : BOOL; b AT %QW4 : INT;", "b := SEL(a, 1, 2);")
    built = build(tmp_path, program, "[sim]\nin = { x = 'Main.a' }\nout = { y = 'Main.b' }")
    assert addresses(built) == {"Main.a": "%IX3.5", "Main.b": "%QW4"}


def test_variable_with_an_open_address_gets_one(tmp_path: Path) -> None:
    program = MAIN.format("a AT %I* : BOOL; b AT %Q* : BOOL;", "b := a;")
    assert messages(tmp_path, program, "[sim]\nin = { x = 'Main.a' }\nout = { y = 'Main.b' }") == []


def test_address_of_var_config_is_that_of_the_channel(tmp_path: Path) -> None:
    program = MAIN.format("a AT %I* : BOOL; b : BOOL;", "b := a;")
    program += "CONFIGURATION C\nTASK t(INTERVAL := T#10ms);\nPROGRAM Main WITH t : Main;\n"
    program += "VAR_CONFIG Main.a AT %IX7.2 : BOOL; END_VAR\nEND_CONFIGURATION\n"
    built = build(tmp_path, program, "[sim]\nin = { x = 'Main.a' }\nout = { y = 'Main.b' }")
    assert built.warnings == []
    assert addresses(built)["Main.a"] == "%IX7.2"


def test_open_address_in_a_block_is_located_by_its_channel(tmp_path: Path) -> None:
    program = MAIN.format("f : Block;", "f();")
    program += "FUNCTION_BLOCK Block\nVAR a AT %I* : BOOL; b : BOOL; END_VAR\nb := a;\nEND_FUNCTION_BLOCK\n"
    assert messages(tmp_path, program, "[sim]\nin = { x = 'Main.f.a' }\nout = { y = 'Main.f.b' }") == []


def test_device_that_is_not_enabled_is_in_the_image(tmp_path: Path) -> None:
    text = "[sim]\nenabled = false\noptional = true\nin = { x = 'Main.a' }"
    found = configuration(build(tmp_path, MAIN.format("a, b : BOOL;", "b := a;"), text))
    assert [c.flags for c in found.connectors] == [2]


def test_global_is_found_by_both_names(tmp_path: Path) -> None:
    (tmp_path / "GVL.st").write_text("VAR_GLOBAL a, b : BOOL; END_VAR\n")
    (tmp_path / "main.st").write_text(MAIN.format("", "b := a;"))
    (tmp_path / "p.io.toml").write_text("[sim]\nin = { x = 'GVL.a' }\nout = { y = 'b' }")
    from plctool.compiler import compile_sources

    built = compile_sources([tmp_path])
    assert {c["variable"] for c in built.symbols.io["channels"]} == {"GVL.a", "GVL.b"}
    assert built.symbols.resolve("b").area == 3


def test_global_that_has_a_channel_and_a_name_of_both_kinds_is_used_twice(tmp_path: Path) -> None:
    program = "VAR_GLOBAL a : BOOL; END_VAR\n" + MAIN.format("c : BOOL;", "c := a;")
    found = messages(tmp_path, program, "[sim.in]\nx = 'a'\ny = 'A'")
    assert found[0].startswith("3: A belongs to the channel x in line 2 already")


def test_address_needs_no_variable(tmp_path: Path) -> None:
    built = build(
        tmp_path, MAIN.format("n : INT;", "n := n + 1;"), "[sim]\nin = { x = '%IW7' }\nout = { y = '%QX9.1' }"
    )
    assert addresses(built) == {"%IW7": "%IW7", "%QX9.1": "%QX9.1"}
    assert configuration(built).task_maps[0].connectors[0].channels[0].bits == 16


def test_device_with_a_name_is_a_variable(tmp_path: Path) -> None:
    program = MAIN.format("lost : BOOL; n : UDINT;", "lost := NOT Bench.ok; n := Bench.age;")
    built = build(tmp_path, program, "[sim]\nname = 'Bench'")
    state = configuration(built).connectors[0].state
    assert state is not None
    assert state % 4 == 0
    assert built.symbols.resolve("Bench.flags").offset == state


def test_program_may_declare_the_variable_of_a_device_itself(tmp_path: Path) -> None:
    program = "VAR_GLOBAL Bench : IO_DEVICE; END_VAR\n" + MAIN.format("lost : BOOL;", "lost := NOT Bench.ok;")
    built = build(tmp_path, program, "[sim]\nname = 'Bench'")
    assert configuration(built).connectors[0].state == built.symbols.resolve("Bench").offset


def test_device_must_not_have_the_name_of_another_variable(tmp_path: Path) -> None:
    program = "VAR_GLOBAL Bench : INT; END_VAR\n" + MAIN.format("", "Bench := 1;")
    found = messages(tmp_path, program, "[sim]\nname = 'Bench'")
    assert found == [
        "2: the program has a variable Bench already; declare it as IO_DEVICE, or give the device another name"
    ]


def test_written_input_is_warned_of(tmp_path: Path) -> None:
    program = MAIN.format("a : BOOL; b : BOOL;", "b := a;\na := FALSE;")
    found = messages(tmp_path, program, "[sim]\nin = { x = 'Main.a' }\nout = { y = 'Main.b' }")
    assert found == ["main.st:4: Main.a is the input x: the next cycle overwrites what is written here"]


def test_output_of_two_tasks_is_warned_of(tmp_path: Path) -> None:
    program = """\
VAR_GLOBAL lamp : BOOL; END_VAR
PROGRAM One
lamp := TRUE;
END_PROGRAM
PROGRAM Two
lamp := FALSE;
END_PROGRAM
CONFIGURATION C
TASK Fast(INTERVAL := T#1ms);
TASK Slow(INTERVAL := T#9ms);
PROGRAM A WITH Fast : One;
PROGRAM B WITH Slow : Two;
END_CONFIGURATION
"""
    found = messages(tmp_path, program, "[sim]\nout = { y = 'lamp' }")
    assert [text.split(":")[1] for text in found] == ["6"]
    assert "each undoes what the other wrote" in found[0]
