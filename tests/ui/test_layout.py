"""page.toml: what a layout says, and the mistakes in it, each with its line."""

from __future__ import annotations

from pathlib import Path

import pytest
from operators import ELEMENTS, HEAD, KINDS, make_folder

from plctool.debug.symbols import SymbolTable, load_symbols
from plctool.errors import UsageError
from plctool.ui.layout import Layout, read_layout
from plctool.ui.operating import operator_page

VALUE = '[[element]]\nkind = "value"\nvariable = "Main.n"\n'
BUTTON = '[[element]]\nkind = "button"\nvariable = "Main.auto"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_folder(tmp_path_factory.mktemp("layout"))


@pytest.fixture(scope="module")
def table(folder: Path) -> SymbolTable:
    return load_symbols(folder / "plant.sym")


def read(folder: Path, text: str) -> Layout:
    path = folder / "page.toml"
    path.write_text(text)
    return read_layout(path)


def mistakes(folder: Path, text: str, table: SymbolTable | None = None) -> str:
    with pytest.raises(UsageError) as raised:
        layout = read(folder, text)
        if table is not None:
            operator_page(layout, table)
    assert str(folder / "page.toml") in str(raised.value)
    return str(raised.value)


def test_each_kind_of_element_is_read(folder: Path, table: SymbolTable) -> None:
    page = operator_page(read(folder, HEAD.format(operate="true") + ELEMENTS), table)
    kinds = [element.mode or element.kind for element in page.elements]
    assert kinds == ["setpoint" if kind == "choice" else kind for kind in KINDS]
    document = page.document()
    assert (document["title"], document["columns"]) == ("Plant <b>1</b>", 4)
    value = document["elements"][0]["items"][0]
    assert (value["variable"], value["unit"], value["decimals"]) == ("Main.tanks[1].level", "%", 1)
    assert value["colours"] == ({"condition": "above", "value": 40, "colour": "red"},)
    assert document["elements"][KINDS.index("choice")]["choices"] == ("Off", "Automatic", "Manual")
    assert [element.operates for element in page.elements] == [False] * 3 + [True] * 6 + [False] * 3 + [True]


def test_an_array_in_a_row_stands_for_its_elements(folder: Path, table: SymbolTable) -> None:
    page = operator_page(read(folder, HEAD.format(operate="true") + ELEMENTS), table)
    items = page.elements[KINDS.index("list")].items
    assert [(item.variable, item.text) for item in items] == [(f"Main.alarms[{i}]", f"Alarm[{i}]") for i in (1, 2, 3)]


@pytest.mark.parametrize(
    ("page", "element", "operates"),
    [
        ("", "", False),
        ("", "operate = true\n", True),
        ("operate = true\n", "", True),
        ("operate = true\n", "operate = false\n", False),
        ("operate = false\n", "", False),
    ],
)
def test_the_right_to_operate_is_that_of_page_and_element(
    folder: Path, page: str, element: str, operates: bool
) -> None:
    assert read(folder, page + BUTTON + element).elements[0].operates == operates


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("title = ", ":1:8: error: this is not TOML"),
        ('title = "x"\n', ":1:1: error: a page needs elements"),
        ("titel = 1\n" + VALUE, ":1:1: error: there is no 'titel' here; did you mean title?"),
        ("columns = 13\n" + VALUE, ":1:11: error: columns is 13; it can be 1 to 12"),
        ("[[elements]]\n", ":1:3: error: there is no 'elements' here; did you mean element?"),
        ('[[element]]\nvariable = "Main.n"\n', ":1:1: error: [element] needs kind"),
        (VALUE.replace("value", "vlaue"), ":2:8: error: kind cannot be 'vlaue'; did you mean value?"),
        ('[[element]]\nkind = "value"\n', ":1:1: error: [element] needs variable"),
        (VALUE + "unti = 1\n", ":4:1: error: there is no 'unti' here; did you mean unit?"),
        (VALUE + "operate = true\n", ":4:1: error: there is no 'operate' here"),
        (VALUE + "decimals = 10\n", ":4:12: error: decimals is 10; it can be 0 to 9"),
        (VALUE + "width = 5\n", ":4:9: error: width is 5; it can be 1 to 4"),
        (VALUE + 'text = "a\\u0000b"\n', ":4:8: error: text has to be one line"),
        (VALUE + "words = { TRUE = 1 }\n", ":4:18: error: the word for TRUE has to be a text in quotes"),
        (VALUE + 'colours = [{ colour = "red" }]\n', ":4:12: error: a colour needs one condition"),
        (VALUE + 'colours = [{ is = 1, below = 2, colour = "red" }]\n', ":4:12: error: a colour needs one condition"),
        (VALUE + 'colours = [{ is = 1, colour = "rde" }]\n', ":4:31: error: colour cannot be 'rde'; it can be"),
        (VALUE.replace("value", "bar") + "high = 1\n", ":1:1: error: [element] needs low"),
        (VALUE.replace("value", "bar") + "low = 2\nhigh = 2\n", ":4:7: error: low is 2 and high is 2"),
        (VALUE.replace("value", "bar") + "low = nan\nhigh = 2\n", ":4:7: error: low has to be a number"),
        (VALUE.replace("value", "bar") + 'low = "0"\nhigh = 2\n', ":4:7: error: low has to be a number"),
        (VALUE.replace("value", "slider") + "low = 0\nhigh = 2\nstep = 0\n", ":6:8: error: step has to be above 0"),
        ("operate = false\n" + BUTTON + "operate = true\n", ":5:11: error: the page says operate = false"),
        (BUTTON + 'mode = "hold"\n', ":4:8: error: mode cannot be 'hold'"),
        (BUTTON + 'mode = "set"\n', ':1:1: error: a button that sets needs a value'),
        (BUTTON + "value = true\n", ':4:1: error: value cannot be here: only a button with mode = "set"'),
        ('[[element]]\nkind = "trend"\n', ":1:1: error: a trend needs rows"),
        ('[[element]]\nkind = "list"\nrows = [1]\n', ":3:8: error: rows is a list; write a table [[element.rows]]"),
        ('[[element]]\nkind = "picture"\n', ":1:1: error: [element] needs file"),
        ('[[element]]\nkind = "picture"\nfile = "plant.st"\n', ":3:8: error: 'plant.st' has to be a file with one of"),
        ('[[element]]\nkind = "picture"\nfile = "no.png"\n', ":3:8: error: 'no.png' cannot be read: No such file"),
        ('[[element]]\nkind = "picture"\nfile = "../x.png"\n', ":3:8: error: '../x.png' is outside the folder"),
        (
            '[[element]]\nkind = "picture"\nfile = "plant.svg"\nplaces = [{ variable = "Main.n", x = 101, y = 0 }]\n',
            ":4:38: error: x is 101; it can be 0 to 100",
        ),
        (VALUE * 101, ": error: there are 101 elements; a page has at most 100"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_line(folder: Path, text: str, expected: str) -> None:
    assert expected in mistakes(folder, text)


def of(kind: str, variable: str, more: str = "") -> str:
    return f'operate = true\n[[element]]\nkind = "{kind}"\nvariable = "{variable}"\n{more}'


LIMITS = "low = 0\nhigh = 1\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (of("value", "Main.tnks"), ":4:12: error: there is no variable Main.tnks. Did you mean Main.tanks?"),
        (of("value", "Main.tanks[3].level"), ":4:12: error: Main.tanks has the elements 1 to 2, not 3"),
        (of("value", "Main.tanks[1]"), ":4:12: error: Main.tanks[1] has no value of its own; show its parts"),
        (of("value", "%IX0.0"), ":4:12: error: the page shows declared variables, not addresses"),
        (of("bar", "Main.text", LIMITS), ":4:12: error: Main.text is of type STRING[80]; a bar needs a number"),
        (of("slider", "Main.auto", LIMITS), ":4:12: error: Main.auto is of type BOOL; a slider needs a number"),
        (of("setpoint", "Main.mode", LIMITS), ":4:12: error: Main.mode is of type Mode; only a number has low"),
        (of("setpoint", "LIMIT"), ":4:12: error: LIMIT is a constant"),
        (of("lamp", "Main.n"), ":4:12: error: Main.n is of type DINT; a lamp needs a BOOL, or colours"),
        (of("button", "Main.n"), ":4:12: error: Main.n is of type DINT; a button needs a BOOL"),
        (of("button", "Main.n", 'mode = "set"\nvalue = "x"\n'), ":6:9: error: 'x' is not a value of DINT"),
        (
            '[[element]]\nkind = "trend"\nrows = [{ variable = "Main.text" }]\n',
            ":3:22: error: Main.text is of type STRING[80]; a trend needs numbers or BOOL",
        ),
        (
            '[[element]]\nkind = "list"\nonly_true = true\nrows = [{ variable = "Main.n" }]\n',
            ":4:22: error: Main.n is of type DINT; a list with only_true needs BOOL",
        ),
        (
            '[[element]]\nkind = "trend"\nrows = [{ variable = "Main.alarms" }, { variable = "Main.alarms" },'
            ' { variable = "Main.n" }]\n',
            ":3:82: error: the trend has 7 variables; it can have 6",
        ),
    ],
)  # fmt: skip
def test_a_name_that_does_not_fit_the_program_is_named_with_its_line(
    folder: Path, table: SymbolTable, text: str, expected: str
) -> None:
    assert expected in mistakes(folder, text, table)


def test_all_mistakes_are_reported_at_once(folder: Path, table: SymbolTable) -> None:
    found = mistakes(folder, of("value", "Main.a") + of("value", "Main.b").removeprefix("operate = true\n"), table)
    assert ":4:12:" in found
    assert ":7:12:" in found


@pytest.mark.parametrize("text", ['operate = "yes"\n' + VALUE, "element = 3\n", "\n"])
def test_a_mistake_is_reported_once(folder: Path, text: str) -> None:
    assert mistakes(folder, text).count("error:") == 1


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no\.toml cannot be read: No such file"):
        read_layout(tmp_path / "no.toml")
