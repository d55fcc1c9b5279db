"""Diagrams on the page: listed for each instance, drawn with the variables that the page asks for."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from chromium import chromium, needs_chromium
from conftest import Browser, Page
from selenium.webdriver.common.by import By

from plctool.testing.waiting import eventually

sys.path.append(str(Path(__file__).parents[1] / "compiler"))

from twincat_archive import archive, assign, given, network, unit

CHART = """PROGRAM Main
VAR one, two : FB; go : BOOL; END_VAR
INITIAL_STEP Wait: END_STEP
STEP Work: Run(N); END_STEP
TRANSITION FROM Wait TO Work := go; END_TRANSITION
TRANSITION FROM Work TO Wait := NOT go; END_TRANSITION
ACTION Run: one(); two(); END_ACTION
END_PROGRAM
"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    folder = tmp_path_factory.mktemp("drawn")
    body = archive(network(assign(given("a"), ("o", 0))), mode="Ld")
    (folder / "FB.TcPOU").write_text(unit("FUNCTION_BLOCK FB\nVAR a, o : BOOL; END_VAR", body, "", "FB"))
    (folder / "main.st").write_text(CHART)
    (folder / "plc.toml").write_text('sources = ["main.st", "FB.TcPOU"]\n')
    page = Page(folder, "--sim")
    yield page
    page.end()


@pytest.fixture
def drawn(page: Page) -> Iterator[Browser]:
    browser = Browser(page)
    with browser.socket:
        yield browser.ready()


def test_diagrams_are_listed_for_each_instance(drawn: Browser) -> None:
    found = drawn.ask("diagrams")["result"]
    assert [(d["name"], d["pou"], d["language"]) for d in found] == [
        ("Main", "Main", "SFC"),
        ("Main.one", "FB", "LD"),
        ("Main.two", "FB", "LD"),
    ]


def test_a_diagram_names_the_variables_of_its_instance(drawn: Browser) -> None:
    found = drawn.ask("diagram", name="Main.two")["result"]
    assert found["names"] == ["Main.two.a", "Main.two.o"]
    assert found["svg"].startswith("<svg ") and 'data-variable="Main.two.o"' in found["svg"]
    assert drawn.ask("diagram", name="Main")["result"]["names"] == ["Main.Wait.X", "Main.Work.X"]


def test_the_values_of_a_diagram_come_as_those_of_other_variables(drawn: Browser) -> None:
    drawn.ask("write", name="Main.go", text="TRUE")
    drawn.ask("show", names=["Main.Wait.X", "Main.Work.X"], views=[])
    drawn.until(lambda b: [b.values.get(f"Main.{s}.X", [""])[0] for s in ("Wait", "Work")] == ["FALSE", "TRUE"])


@pytest.mark.parametrize("name", ["Main.three", "../plc.toml", "<svg>", ""])
def test_a_diagram_that_does_not_exist_is_refused(drawn: Browser, name: str) -> None:
    assert drawn.ask("diagram", name=name)["error"] == f"{name} has no diagram."


@needs_chromium
def test_the_page_shows_a_diagram_with_its_values(page: Page, drawn: Browser, tmp_path: Path) -> None:
    drawn.ask("write", name="Main.go", text="TRUE")
    driver = chromium(tmp_path)
    try:
        driver.get(page.url)
        driver.find_element(By.ID, "tab-diagrams").click()
        eventually(lambda: driver.find_elements(By.CSS_SELECTOR, "#diagrams .step.on"))
        assert driver.find_element(By.CSS_SELECTOR, ".step.on").get_attribute("data-variable") == "Main.Work.X"
        driver.execute_script("const s = document.getElementById('drawn'); s.value = 'Main.one'; s.onchange()")
        drawn.ask("write", name="Main.one.a", text="TRUE")
        eventually(lambda: len(driver.find_elements(By.CSS_SELECTOR, "#diagrams .value.on")) == 2)
    finally:
        driver.quit()
