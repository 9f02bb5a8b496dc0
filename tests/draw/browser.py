"""A browser without a window, of this machine; a test that asks for one is skipped where there is none."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

ARGUMENTS = ("--headless", "--no-sandbox", "--no-first-run", "--hide-scrollbars")
ARGUMENTS += tuple(f"--disable-{part}" for part in ("gpu", "quic", "background-networking", "component-update", "sync"))
"""It asks nobody on the network for anything of its own."""


@contextmanager
def browser(*, width: int, scheme: str = "light") -> Iterator[Any]:
    """A page of this width in pixels, for those who prefer a `light` or `dark` scheme."""
    selenium = pytest.importorskip("selenium.webdriver", reason="selenium is not installed, which drives a browser")
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("chromium or chromedriver is not installed, in which pages are looked at")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        options = selenium.ChromeOptions()
        options.binary_location = chromium
        for argument in (*ARGUMENTS, f"--user-data-dir={profile}"):
            options.add_argument(argument)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        window = selenium.Chrome(options=options, service=selenium.ChromeService(driver))
        try:
            window.implicitly_wait(2)
            media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
            window.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
            metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
            window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
            yield window
        finally:
            window.quit()


def press(window: Any, keys: str) -> None:
    """Type on the element that has the focus."""
    window.switch_to.active_element.send_keys(keys)
    settle(window)


def settle(window: Any) -> None:
    """Wait for the frame in which the page follows."""
    window.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
