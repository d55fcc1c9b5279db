"""The page of a trace in a browser, opened as a file: plot, zoom, cursors, and names that are no markup."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By

from plctool.debug.recording import Column, Recording
from plctool.iec.types import BOOL, LREAL
from plctool.trace_file import render

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason="chromium or chromedriver is not installed: ./bootstrap.sh --tests"
)
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-dev-shm-usage")
NAME = "</script><img src=x onerror=alert(1)>"


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[webdriver.Chrome]:
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM or ""
    for flag in (*FLAGS, "--window-size=1000,700", f"--user-data-dir={tmp_path / 'chromium'}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    try:
        made = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    except WebDriverException as error:
        pytest.skip(f"chromium does not start here: {error.msg}")
    recording = Recording("Main", 1000, [Column(NAME, LREAL), Column("Main.on", BOOL), Column("Main.nan", LREAL)])
    recording.times_ns = [i * 1_000_000 for i in range(1000)]
    recording.values = [[i / 10 for i in range(1000)], [i % 2 for i in range(1000)], [float("nan")] * 1000]
    recording.trigger, recording.complete = 100, True
    path = tmp_path / "trace.html"
    path.write_bytes(render(recording, path))
    made.get(path.as_uri())
    yield made
    assert [entry for entry in made.get_log("browser") if entry["level"] == "SEVERE"] == []
    made.quit()


def cells(driver: webdriver.Chrome, row: int) -> list[str]:
    return [cell.text for cell in driver.find_elements(By.CSS_SELECTOR, f"#rows tr:nth-child({row + 1}) td")]


def test_it_shows_values_at_cursors_and_zooms(driver):
    assert driver.find_element(By.ID, "title").text == "Trace of Main"
    assert driver.find_element(By.ID, "note").text == "1000 samples"
    assert cells(driver, 1)[0] == NAME
    assert driver.find_elements(By.TAG_NAME, "img") == []
    canvas = driver.find_element(By.TAG_NAME, "canvas")
    ActionChains(driver).move_to_element(canvas).click().perform()
    first = [float(cell) for cell in cells(driver, 1)[1:2]]
    assert 0 < first[0] < 100
    assert cells(driver, 0)[1] != ""
    before = driver.execute_script("return view[1] - view[0]")
    driver.execute_script(
        "canvas.dispatchEvent(new WheelEvent('wheel', {deltaY: -100, clientX: 400, clientY: 300, cancelable: true}))"
    )
    assert driver.execute_script("return view[1] - view[0]") == pytest.approx(before * 0.8)
    driver.find_element(By.ID, "all").click()
    assert driver.execute_script("return view[1] - view[0]") == pytest.approx(before)
    assert driver.execute_script("return context.getImageData(0, 0, canvas.width, canvas.height).data.some((v) => v)")


def test_a_name_hides_and_shows_its_plot(driver):
    row = driver.find_element(By.CSS_SELECTOR, "#rows tr:nth-child(3)")
    row.click()
    assert driver.find_element(By.CSS_SELECTOR, "#rows tr:nth-child(3)").get_attribute("class") == "hidden"
