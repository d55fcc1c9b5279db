"""What the server of an operators' page lets browsers do, hostile requests included."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import Browser, Page
from operators import KINDS, PICTURE, make_folder

from plctool.testing.waiting import PATIENCE

NUMBER = {kind: number for number, kind in enumerate(KINDS)}
NAMES = ["Main.auto", "Main.manual", "Main.mode", "Main.recipe", "Main.start_now", "Main.wanted"]


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_folder(tmp_path_factory.mktemp("operators"))


@pytest.fixture(scope="module")
def operated(plant: Path) -> Iterator[Page]:
    shown = Page(plant, "--sim", "plant.cdl", "--page", "operate.toml")
    yield shown
    assert shown.end() == 0


@pytest.fixture
def operator(operated: Page) -> Iterator[Browser]:
    made = Browser(operated)
    with made.socket:
        made.ready().ask("show", names=NAMES, views=[])
        made.until(lambda b: len(b.values) == len(NAMES))
        yield made


def operate(browser: Browser, kind: str, text: str) -> str:
    """Returns the error, "" if the server does it."""
    error: str = browser.ask("operate", element=NUMBER[kind], text=text).get("error", "")
    return error


def test_the_browser_gets_the_layout(operator: Browser) -> None:
    assert operator.topics["page"]["title"] == "Plant <b>1</b>"
    assert len(operator.topics["page"]["elements"]) == len(KINDS)


@pytest.mark.parametrize(
    ("kind", "text", "name", "value"),
    [
        ("press", "TRUE", "Main.start_now", "TRUE"),
        ("press", "FALSE", "Main.start_now", "FALSE"),
        ("toggle", "TRUE", "Main.auto", "TRUE"),
        ("set", "3", "Main.recipe", "3"),
        ("slider", "12.5", "Main.manual", "12.5"),
        ("setpoint", "60", "Main.wanted", "60"),
        ("choice", "Manual", "Main.mode", "Manual"),
    ],
)
def test_an_element_writes_its_variable(operator: Browser, kind: str, text: str, name: str, value: str) -> None:
    assert operate(operator, kind, text) == ""
    operator.until(lambda b: b.values[name][0] == value)


def test_alarms_of_the_page_are_shown_and_acknowledged(operator: Browser) -> None:
    operator.ask("show", names=NAMES, views=["alarms"])
    assert operate(operator, "toggle", "TRUE") == ""
    operator.until(lambda b: b.topics.get("alarms"))
    (alarm,) = operator.topics["alarms"]
    assert (alarm["name"], alarm["state"], alarm["text"]) == ("Main.fire", "UNACKNOWLEDGED", "<b>Fire</b>")
    assert alarm["since"]
    assert "no alarm Main.auto" in operate(operator, "alarms", "Main.auto")
    assert operate(operator, "alarms", "Main.fire") == ""
    operator.until(lambda b: b.topics["alarms"][0]["state"] == "ACKNOWLEDGED")
    assert operate(operator, "toggle", "FALSE") == ""
    operator.until(lambda b: b.topics["alarms"] == [])


@pytest.mark.parametrize("kind", ["value", "bar", "lamp", "trend", "list", "picture"])
def test_an_element_that_only_shows_writes_nothing(operator: Browser, kind: str) -> None:
    assert operate(operator, kind, "1") == "This element only shows; page.toml does not let it operate."


@pytest.mark.parametrize(
    ("kind", "text", "expected"),
    [
        ("setpoint", "61", "61 is above 60, the limit here."),
        ("setpoint", "-1", "-1 is below 0, the limit here."),
        ("slider", "20.5", "20.5 is above 20, the limit here."),
        ("slider", "nan", "NaN cannot be written here; write a number."),
        ("setpoint", "<b>", "<b>"),
        ("set", "4", "This button writes 3 only."),
        ("choice", "Nothing", "Nothing"),
        ("toggle", "perhaps", "perhaps"),
    ],
)
def test_a_value_that_the_element_cannot_write_is_refused(
    operator: Browser, kind: str, text: str, expected: str
) -> None:
    assert expected in operate(operator, kind, text)


@pytest.mark.parametrize("number", [len(KINDS), 1 << 30, -1, True, "0", None])
def test_an_element_that_does_not_exist_is_refused(operator: Browser, number: object) -> None:
    assert "error" in operator.ask("operate", element=number, text="1")


@pytest.mark.parametrize(
    ("verb", "fields"),
    [
        ("write", {"name": "Main.wanted", "text": "1"}),
        ("write", {"name": "Main.hidden", "text": "1"}),
        ("force", {"name": "Main.wanted", "text": "1"}),
        ("unforce", {"name": "Main.wanted"}),
        ("unforce_all", {}),
        ("start", {}),
        ("stop", {}),
        ("reset", {}),
        ("children", {"path": "", "start": 0}),
        ("search", {"text": "hidden"}),
        ("show", {"names": ["Main.hidden"], "views": []}),
        ("show", {"names": [], "views": ["log"]}),
        ("show", {"names": [], "views": ["alarms", "log"]}),
        ("acknowledge", {"name": "Main.fire"}),
    ],
)
def test_what_the_page_does_not_lay_out_is_refused(operator: Browser, verb: str, fields: dict[str, object]) -> None:
    reply = operator.ask(verb, **fields)
    assert reply["error"] == "This page shows and operates only what its page.toml lays out."


def test_a_page_that_only_views_writes_nothing(plant: Path) -> None:
    page = Page(plant, "--sim", "plant.cdl", "--page", "view.toml")
    browser = Browser(page)
    with browser.socket:
        browser.ready()
        for kind in KINDS:
            assert operate(browser, kind, "1") == "This element only shows; page.toml does not let it operate."
        browser.ask("show", names=NAMES, views=[])
        browser.until(lambda b: len(b.values) == len(NAMES))
        assert [browser.values[name][0] for name in NAMES] == ["FALSE", "10.0", "Automatic", "0", "FALSE", "50"]
    assert page.end() == 0


def test_a_button_is_released_when_its_browser_leaves(operated: Page, operator: Browser) -> None:
    other = Browser(operated)
    with other.socket:
        assert operate(other.ready(), "press", "TRUE") == ""
        operator.until(lambda b: b.values["Main.start_now"][0] == "TRUE")
    operator.until(lambda b: b.values["Main.start_now"][0] == "FALSE")


def test_pictures_are_served_by_the_number_of_their_element(operated: Page) -> None:
    reply = operated.get(f"{operated.path}picture/{NUMBER['picture']}")
    assert (reply.status, reply.headers["content-type"]) == (200, "image/svg+xml")
    assert reply.read() == PICTURE.encode()
    assert reply.headers["content-security-policy"].startswith("default-src 'none'")
    for other in ("0", "99", "-1", "x", "../plant.st", "9" * 30):
        assert operated.get(f"{operated.path}picture/{other}").status == 404
    assert operated.get(f"/wrong/picture/{NUMBER['picture']}").status == 403


def test_the_page_of_all_variables_has_no_elements(browser: Browser) -> None:
    reply = browser.ask("operate", element=0, text="1")
    assert reply["error"] == "Only an operators' page has elements; start 'plctool ui' with --page."


def test_a_name_that_the_program_lacks_ends_the_start(plant: Path) -> None:
    (plant / "bad.toml").write_text('[[element]]\nkind = "value"\nvariable = "Main.wnted"\n')
    command = [sys.executable, "-m", "plctool", "ui", "--sim", "plant.cdl", "--page", "bad.toml"]
    done = subprocess.run(command, cwd=plant, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode != 0
    assert done.stdout == ""
    assert "bad.toml:3:12: error: there is no variable Main.wnted. Did you mean Main.wanted?" in done.stderr
