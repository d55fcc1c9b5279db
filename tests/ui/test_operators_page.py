"""The page of operators in a headless Chromium: each element against the simulator."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from chromium import chromium, needs_chromium
from conftest import Browser, Page
from operators import KINDS, make_folder
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.select import Select

from plctool.testing.waiting import eventually

pytestmark = needs_chromium


class Shown:
    """The page in a browser."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def part(self, kind: str, of: str = "") -> WebElement:
        """An element of the page by its name in `KINDS`, or a part of it."""
        selector = f'.element[data-number="{KINDS.index(kind)}"] {of}'
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def text(self, kind: str, of: str = ".reading .text") -> str:
        return self.part(kind, of).text

    def run(self, script: str, *arguments: Any) -> Any:
        return self.driver.execute_script(script, *arguments)


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    made = chromium(tmp_path_factory.mktemp("chromium"))
    yield made
    made.quit()


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_folder(tmp_path_factory.mktemp("operators"))


@pytest.fixture(scope="module")
def operated(plant: Path) -> Iterator[Page]:
    page = Page(plant, "--sim", "plant.cdl", "--page", "operate.toml")
    yield page
    assert page.end() == 0


@pytest.fixture
def shown(driver: webdriver.Chrome, operated: Page) -> Iterator[Shown]:
    yield from opened(driver, operated)


def opened(driver: webdriver.Chrome, page: Page) -> Iterator[Shown]:
    driver.get(page.url)
    made = Shown(driver)
    eventually(lambda: driver.find_element(By.ID, "state").text == "Running")
    eventually(lambda: made.text("value") == "42.3")
    yield made
    assert [entry for entry in driver.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_a_value_has_its_decimals_unit_and_colour(shown: Shown) -> None:
    assert shown.text("value", ".unit") == "%"
    assert shown.part("value", ".reading").get_attribute("data-colour") == "red"


def test_markup_in_texts_and_values_is_text(shown: Shown) -> None:
    assert shown.driver.find_element(By.ID, "title").text == "Plant <b>1</b>"
    assert shown.text("value", "h2") == "<i>Level</i>"
    eventually(lambda: shown.text("picture") == "<b>bold</b>")
    assert shown.driver.find_elements(By.CSS_SELECTOR, "b, i:not(.swatch)") == []


def test_a_bar_is_as_long_as_its_value(shown: Shown) -> None:
    share = "const [f, t] = arguments; return f.getBoundingClientRect().width / t.getBoundingClientRect().width"
    eventually(lambda: abs(shown.run(share, shown.part("bar", ".fill"), shown.part("bar", ".track")) - 0.42) < 0.02)


def test_a_toggle_switches_and_a_lamp_shows_it(shown: Shown) -> None:
    eventually(lambda: shown.text("lamp", ".word") == "stands")
    assert shown.part("lamp", ".bulb").get_attribute("data-colour") is None
    shown.part("toggle", "button").click()
    eventually(lambda: shown.text("lamp", ".word") == "runs")
    eventually(lambda: shown.part("lamp", ".bulb").get_attribute("data-colour") == "green")
    eventually(lambda: shown.part("picture", ".bulb").get_attribute("data-colour") == "green")
    assert shown.part("toggle", "button").get_attribute("aria-pressed") == "true"
    shown.part("toggle", "button").click()
    eventually(lambda: shown.text("lamp", ".word") == "stands")


def is_pressed(shown: Shown, kind: str) -> bool:
    return shown.part(kind, "button").get_attribute("aria-pressed") == "true"


def test_a_button_is_true_while_it_is_held(shown: Shown) -> None:
    button = shown.part("press", "button")
    ActionChains(shown.driver).click_and_hold(button).perform()
    eventually(lambda: is_pressed(shown, "press"))
    ActionChains(shown.driver).release().perform()
    eventually(lambda: not is_pressed(shown, "press"))
    ActionChains(shown.driver).key_down(Keys.SPACE).perform()  # it has the focus
    eventually(lambda: is_pressed(shown, "press"))
    ActionChains(shown.driver).key_up(Keys.SPACE).perform()
    eventually(lambda: not is_pressed(shown, "press"))


def test_a_button_that_sets_shows_that_its_value_is_there(shown: Shown) -> None:
    assert not is_pressed(shown, "set")
    shown.part("set", "button").click()
    eventually(lambda: is_pressed(shown, "set"))


def test_a_slider_follows_and_writes(shown: Shown) -> None:
    eventually(lambda: shown.part("slider", "input").get_attribute("value") == "10")
    shown.part("slider", "input").send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    eventually(lambda: shown.text("slider") == "12.0")
    shown.part("slider", "input").send_keys(Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    eventually(lambda: shown.text("slider") == "10.0")


def enter(shown: Shown, text: str) -> None:
    field = shown.part("setpoint", "input")
    field.clear()
    field.send_keys(text, Keys.ENTER)


def test_a_set_point_is_written_or_its_refusal_explained(shown: Shown) -> None:
    enter(shown, "55")
    eventually(lambda: shown.text("setpoint") == "55")
    enter(shown, "61")
    eventually(lambda: shown.text("setpoint", ".error") == "61 is above 60, the limit here.")
    enter(shown, "50")
    eventually(lambda: shown.text("setpoint") == "50")
    eventually(lambda: shown.run("return arguments[0].textContent", shown.part("setpoint", ".error")) == "")


def test_an_enumeration_is_chosen_by_name(shown: Shown) -> None:
    eventually(lambda: shown.text("choice") == "Automatic")
    choice = Select(shown.part("choice", "select"))
    assert [option.text for option in choice.options] == ["Off", "Automatic", "Manual"]
    choice.select_by_visible_text("Manual")
    shown.part("choice", "form button").click()
    eventually(lambda: shown.text("choice") == "Manual")


def test_a_trend_draws_its_variables(shown: Shown) -> None:
    eventually(lambda: shown.text("trend", "ul").splitlines()[:2] == ["Level", "42.256"])
    drawn = (
        "const c = arguments[0]; return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v)"
    )
    eventually(lambda: shown.run(drawn, shown.part("trend", "canvas")))
    assert shown.driver.find_elements(By.CSS_SELECTOR, ".is-trend button") == []


def test_a_list_shows_only_what_is_true(shown: Shown) -> None:
    eventually(lambda: shown.text("list", "ul") == "Alarm[2]")
    assert not shown.part("list", ".none").is_displayed()


def test_an_alarm_is_shown_and_acknowledged(shown: Shown) -> None:
    assert shown.text("alarms", "h2") == "All alarms"
    shown.part("toggle", "button").click()
    eventually(lambda: "<b>Fire</b>\nactive, new" in shown.text("alarms", "ul"))
    shown.part("alarms", "button").click()
    eventually(lambda: shown.text("alarms", "ul") == "<b>Fire</b>\nactive")
    shown.part("toggle", "button").click()
    eventually(lambda: shown.text("alarms", ".none") == "None")


def test_a_picture_has_its_values_at_their_places(shown: Shown) -> None:
    eventually(lambda: shown.run("return arguments[0].naturalWidth", shown.part("picture", "img")) > 0)
    middle = """
        const [place, frame] = [...arguments].map((node) => node.getBoundingClientRect());
        const [x, y] = [place.x + place.width / 2, place.y + place.height / 2];
        return [(x - frame.x) / frame.width, (y - frame.y) / frame.height];
    """
    for place, x in ((".place:nth-of-type(1)", 0.25), (".place:nth-of-type(2)", 0.75)):
        found = shown.run(middle, shown.part("picture", place), shown.part("picture", ".frame"))
        assert found == pytest.approx([x, 0.5], abs=0.02)


def on_a_phone(shown: Shown, question: Callable[[], Any]) -> None:
    phone = {"width": 360, "height": 740, "deviceScaleFactor": 2, "mobile": True}
    shown.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", phone)
    try:
        eventually(question)
    finally:
        shown.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_no_element_is_wider_than_a_phone(shown: Shown) -> None:
    ends = "[...document.querySelectorAll('body *')].map((node) => node.getBoundingClientRect().right)"
    widest = f"return Math.max(...{ends})"
    on_a_phone(shown, lambda: shown.run("return document.documentElement.scrollWidth") <= 360)
    on_a_phone(shown, lambda: shown.run(widest) <= 360)


def test_a_page_that_only_views_has_no_controls_to_use(driver: webdriver.Chrome, plant: Path) -> None:
    page = Page(plant, "--sim", "plant.cdl", "--page", "view.toml")
    for shown in opened(driver, page):
        controls = shown.driver.find_elements(By.CSS_SELECTOR, "main button, main input, main select")
        assert len(controls) >= 6
        assert not [control for control in controls if control.is_enabled()]
    driver.get("about:blank")
    assert page.end() == 0


def test_the_page_of_all_variables_has_a_view_of_alarms(driver: webdriver.Chrome, plant: Path) -> None:
    page = Page(plant, "--sim", "plant.cdl")
    browser = Browser(page)
    driver.get(page.url)
    eventually(lambda: driver.find_element(By.ID, "state").text == "Running")
    driver.find_element(By.ID, "tab-alarms").click()
    eventually(lambda: "No alarms." in driver.find_element(By.ID, "alarms").text)
    with browser.socket:
        browser.ask("write", name="Main.auto", text="TRUE")
    eventually(lambda: "Main.fire" in driver.find_element(By.ID, "alarms").text)
    driver.find_element(By.CSS_SELECTOR, "#alarms button").click()
    eventually(lambda: "active error" in driver.find_element(By.ID, "alarms").text)
    driver.get("about:blank")
    assert page.end() == 0


def test_the_page_of_the_tanks_fits_its_program(driver: webdriver.Chrome, tmp_path: Path) -> None:
    tanks = Path(__file__).parents[2] / "examples" / "tanks"
    build = [sys.executable, "-m", "plctool", "build", str(tanks), "-o", str(tmp_path / "tanks.cdl")]
    subprocess.run(build, check=True, capture_output=True)
    page = Page(tmp_path, "--sim", "tanks.cdl", "--plant", str(tanks / "plant.py"), "--page", str(tanks / "page.toml"))
    driver.get(page.url)
    bars = ".is-bar .reading"  # there are none before the page has the list of variables
    eventually(lambda: [e for e in driver.find_elements(By.CSS_SELECTOR, bars) if "%" in e.text])
    eventually(lambda: driver.find_element(By.CSS_SELECTOR, f"{bars} .text").text not in ("–", ""))
    assert driver.title == "Tanks"
    driver.get("about:blank")
    assert page.end() == 0
