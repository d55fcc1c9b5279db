"""The page in a headless Chromium. Left out, with the reason, where there is none (`./bootstrap.sh --tests`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from chromium import chromium, needs_chromium
from conftest import Page
from selenium import webdriver
from selenium.common.exceptions import JavascriptException
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement

from plctool.testing.waiting import eventually

pytestmark = needs_chromium
ROW = """
return [...document.querySelectorAll('.row')].find((row) => row.querySelector('.label').textContent === arguments[0])
"""
PART = """
const rows = [...document.querySelectorAll('.row')];
const row = rows.find((row) => row.querySelector('.label').textContent === arguments[0]);
const part = row?.querySelector(arguments[1]);
return part && !part.hidden ? part.textContent : '';
"""


class Shown:
    """The page in a browser. Rows are made again when the list changes, so they are looked up each time."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def row(self, label: str) -> WebElement | None:
        found: WebElement | None = self.driver.execute_script(ROW, label)
        return found

    def part(self, label: str, of: str) -> str:
        """The text of a part of a row; "" without that row, or if it is hidden."""
        return str(self.driver.execute_script(PART, label, of))

    def click(self, label: str, of: str) -> None:
        def clicked() -> bool:
            row = self.row(label)
            if row is None:
                return False
            self.driver.execute_script("arguments[0].querySelector(arguments[1]).click()", row, of)
            return True

        self.eventually(clicked)

    def eventually(self, question: Callable[[], Any]) -> Any:
        def asked() -> Any:
            try:
                return question()
            except JavascriptException:
                return False

        return eventually(asked)

    def by_id(self, name: str) -> WebElement:
        return self.driver.find_element(By.ID, name)

    def edit(self, label: str, text: str, button: str) -> None:
        self.click(label, ".value")
        self.eventually(lambda: self.by_id("edit").get_attribute("open"))
        field = self.by_id("edit-text")
        field.clear()
        field.send_keys(text)
        self.by_id(button).click()


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    made = chromium(tmp_path_factory.mktemp("chromium"))
    yield made
    made.quit()


@pytest.fixture
def shown(driver: webdriver.Chrome, page: Page) -> Iterator[Shown]:
    driver.get(page.url)
    made = Shown(driver)
    made.eventually(lambda: made.by_id("state").text == "Running")
    made.eventually(lambda: made.row("Main"))
    made.click("Main", ".label")
    made.eventually(lambda: made.row("still"))
    yield made
    assert [entry for entry in driver.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_values_live_in_the_tree(shown: Shown) -> None:
    first = shown.eventually(lambda: shown.part("n", ".value"))
    shown.eventually(lambda: shown.part("n", ".value") != first)
    assert shown.part("still", ".value") == "5"


def test_markup_in_values_is_text(shown: Shown) -> None:
    shown.eventually(lambda: shown.part("text", ".value") == "'<b>bold</b>'")
    assert shown.driver.find_elements(By.TAG_NAME, "b") == []
    shown.by_id("search").send_keys("<i>x</i>")
    shown.eventually(lambda: "No variable has “<i>x</i>” in its name." in shown.by_id("tree").text)
    assert shown.driver.find_elements(By.CSS_SELECTOR, "#tree i") == []


def test_a_value_is_written_and_forced_in_the_dialog(shown: Shown) -> None:
    shown.edit("still", "123", "edit-write")
    shown.eventually(lambda: shown.part("still", ".value") == "123")
    shown.edit("still", "9", "edit-force")
    shown.eventually(lambda: shown.part("still", ".mark") == "forced")
    shown.eventually(lambda: shown.by_id("forced").text.startswith("Forced: Main.still"))
    shown.click("still", ".value")
    shown.by_id("edit-unforce").click()
    shown.eventually(lambda: shown.part("still", ".mark") == "")
    shown.edit("still", "5", "edit-write")
    shown.eventually(lambda: shown.part("still", ".value") == "5")


def test_a_refused_value_is_explained_in_the_dialog(shown: Shown) -> None:
    shown.edit("still", "99999", "edit-write")
    shown.eventually(lambda: "99999" in shown.by_id("edit-error").text)
    shown.by_id("edit-cancel").click()
    shown.eventually(lambda: not shown.by_id("edit").get_attribute("open"))


def test_the_keyboard_is_enough(shown: Shown) -> None:
    body = shown.driver.find_element(By.TAG_NAME, "body")
    body.send_keys("/")
    shown.driver.switch_to.active_element.send_keys("main.still")
    shown.eventually(lambda: shown.row("Main.still"))
    shown.driver.switch_to.active_element.send_keys(Keys.ARROW_DOWN)
    shown.driver.switch_to.active_element.send_keys(" ")
    shown.eventually(lambda: "Main.still" in shown.by_id("legend").text)
    shown.driver.switch_to.active_element.send_keys(Keys.ENTER)
    shown.eventually(lambda: shown.by_id("edit").get_attribute("open"))
    shown.driver.switch_to.active_element.send_keys(Keys.ESCAPE)
    shown.eventually(lambda: not shown.by_id("edit").get_attribute("open"))


def test_long_lists_are_drawn_in_parts(shown: Shown) -> None:
    shown.click("list", ".label")
    shown.eventually(lambda: shown.row("[1]"))
    assert len(shown.driver.find_elements(By.CSS_SELECTOR, ".row")) < 60
    shown.driver.execute_script("document.querySelector('#tree').scrollTop = 1e6")
    shown.eventually(lambda: shown.row("text"))


def test_the_program_is_stopped_after_a_question(shown: Shown) -> None:
    shown.by_id("stop").click()
    assert shown.by_id("ask").text.startswith("Stop the program?")
    shown.by_id("ask-yes").click()
    shown.eventually(lambda: shown.by_id("state").text == "Stopped")
    shown.by_id("start").click()
    shown.by_id("ask-yes").click()
    shown.eventually(lambda: shown.by_id("state").text == "Running")


def test_an_exception_is_shown_in_its_source(shown: Shown) -> None:
    shown.edit("divisor", "0", "edit-write")
    shown.eventually(lambda: "ratio := 100 / divisor;" in shown.by_id("exception").text)
    assert shown.driver.find_element(By.CSS_SELECTOR, ".here").text.endswith("ratio := 100 / divisor;")
    shown.by_id("reset").click()
    shown.by_id("ask-yes").click()
    shown.eventually(lambda: shown.by_id("state").text == "Stopped")
    shown.by_id("start").click()
    shown.by_id("ask-yes").click()
    shown.eventually(lambda: shown.by_id("state").text == "Running")


@pytest.mark.parametrize("view", ["tasks", "log", "alarms", "io"])
def test_each_view_shows_what_it_has(shown: Shown, view: str) -> None:
    words = {
        "tasks": "Fast",
        "log": "Application",
        "alarms": "The program has no instances of ALARM",
        "io": "The program has no inputs and outputs but memory.",
    }
    shown.by_id(f"tab-{view}").click()
    shown.eventually(lambda: words[view] in shown.by_id(view).text)


PHONE = {"width": 360, "height": 740, "deviceScaleFactor": 2, "mobile": True}
DESKTOP = {"width": 1280, "height": 800, "deviceScaleFactor": 1, "mobile": False}
FAULTS = """
const seen = [...document.querySelectorAll('button, h1, h2, .chip, .value, td.number')].filter((e) => e.offsetParent);
const outside = seen.filter((e) => !e.closest('.scroll, #trend') && e.getBoundingClientRect().right > innerWidth);
const broken = seen.filter((e) => e.matches('.chip, .value, td.number')).filter((e) => {
  const text = document.createRange();
  text.selectNodeContents(e);
  return new Set([...text.getClientRects()].map((line) => Math.round(line.top))).size > 1;
});
const wide = document.documentElement.scrollWidth > innerWidth ? ['the page'] : [];
return [...outside, ...broken].map((e) => `${e.id || e.className}: ${e.textContent}`).concat(wide);
"""


@pytest.mark.parametrize("screen", [PHONE, DESKTOP], ids=["phone", "desktop"])
def test_nothing_is_outside_the_screen_or_broken_within_a_word(
    shown: Shown, screen: dict[str, object], tmp_path: Path
) -> None:
    shown.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    try:
        for view in ("tasks", "log", "alarms", "io", "diagrams", "variables"):
            shown.by_id(f"tab-{view}").click()
            shown.eventually(lambda view=view: shown.by_id(view).text)
            shown.driver.save_screenshot(str(tmp_path / f"{view}.png"))
            shown.eventually(lambda: shown.driver.execute_script("return innerWidth") == screen["width"])
            assert shown.driver.execute_script(FAULTS) == [], view
    finally:
        shown.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_the_end_of_plctool_is_shown(driver: webdriver.Chrome, folder: Path) -> None:
    page = Page(folder, "--sim", "app.cdl")
    driver.get(page.url)
    shown = Shown(driver)
    shown.eventually(lambda: shown.by_id("state").text == "Running")
    page.end()
    shown.eventually(lambda: shown.by_id("state").text == "Not connected")
    assert "plctool has ended" in shown.by_id("lost").text
    driver.get("about:blank")
    driver.get_log("browser")
