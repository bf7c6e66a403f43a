"""A headless browser, as Debian has it, for tests of pages."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SWITCHES = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--window-size=1400,1000"),
)
PATIENCE = 60
"""Seconds until a page must be drawn, on a machine that does other things as well."""


class Browser:
    """A browser with one page open.

    Args:
        driver: of Selenium.
    """

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(self, page: Path, *, whole: bool = True) -> Browser:
        """Open a page and wait until all that is open on it is drawn, or only what is in sight."""
        from selenium.webdriver.support.ui import WebDriverWait

        self.complaints()
        self.driver.get(page.as_uri())
        drawn = "return document.documentElement.dataset.ready"
        if not whole:
            drawn = "return vsacli.charts.cards.every(card => card.figure || !card.visible)"
        WebDriverWait(self.driver, PATIENCE).until(lambda _: self.run(drawn))
        return self

    def run(self, script: str, *arguments: Any) -> Any:
        """What a script returns."""
        return self.driver.execute_script(script, *arguments)

    def settled(self, script: str, *arguments: Any) -> Any:
        """The same, two frames later."""
        self.driver.execute_async_script(
            "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()));"
        )
        return self.run(script, *arguments)

    def press(self, keys: str) -> None:
        """Press keys, on nothing in particular."""
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.driver).send_keys(keys).perform()

    def find(self, selector: str) -> Any:
        """The first element."""
        return self.driver.find_element("css selector", selector)

    def texts(self, selector: str) -> list[str]:
        """What elements say."""
        return [each.text for each in self.driver.find_elements("css selector", selector)]

    def complaints(self) -> list[str]:
        """Warnings and errors on the console since the last call."""
        return [each["message"] for each in self.driver.get_log("browser") if each["level"] != "INFO"]

    def media(self, **features: str) -> None:
        """Pretend what a reader prefers, such as `prefers_color_scheme="dark"`."""
        named = [{"name": name.replace("_", "-"), "value": value} for name, value in features.items()]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": named})


@contextlib.contextmanager
def browsing(profile: Path) -> Iterator[Browser]:
    """A browser with a profile of its own, closed at the end."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for switch in (*SWITCHES, f"--user-data-dir={profile}"):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=shutil.which("chromedriver"))
    driver = webdriver.Chrome(options=options, service=service)
    try:
        yield Browser(driver)
    finally:
        driver.quit()
