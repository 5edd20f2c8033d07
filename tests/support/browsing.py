"""The program `env2mjcf view` and a headless Chromium that looks at its page."""

from __future__ import annotations

import io
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from extras import skip_without
from interrupting import heed

ROOT = Path(__file__).parents[2]
# Drawn in software, without a screen, and without asking anybody for anything.
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip


def chromium() -> str | None:
    """Return the browser that CHROMIUM names, else one that is installed."""
    names = ("chromium", "chromium-browser", "google-chrome")
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, names)), None)


needs_chromium = pytest.mark.skipif(
    chromium() is None, reason="no Chromium: apt-get install chromium, or name one with CHROMIUM"
)


@contextmanager
def viewing(*arguments: str | Path) -> Iterator[str]:
    """Run `env2mjcf view`, and give the address that it prints; Ctrl-C must end it with status 0."""
    skip_without("view")
    command = [sys.executable, "-m", "env2mjcf", "view", *map(str, arguments), "--no-browser"]
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        preexec_fn=heed,  # noqa: PLW1509  it only sets a signal
    )
    assert process.stdout is not None
    try:
        address = process.stdout.readline().strip()
        if not address:
            pytest.fail(f"no address: {process.communicate()[1]}")
        yield address
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
        assert (process.returncode, out) == (0, ""), err
        assert "Traceback" not in err, err
    finally:
        process.kill()
        process.wait()


@contextmanager
def browser() -> Iterator[Any]:
    """Start Chromium with a profile of its own."""
    api = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install 'env2mjcf[dev]'")
    with api.sync_playwright() as playwright, tempfile.TemporaryDirectory() as profile:
        context = playwright.chromium.launch_persistent_context(
            profile, executable_path=chromium(), args=list(FLAGS), viewport={"width": 820, "height": 560}
        )
        try:
            yield context
        finally:
            context.close()


class Tab:
    """A tab that shows the page, and remembers every request that it makes."""

    def __init__(self, context: Any, address: str) -> None:
        self.page = context.new_page()
        self.requests: list[str] = []
        self.page.on("request", lambda r: self.requests.append(r.url))
        self.page.on("websocket", lambda w: self.requests.append(w.url))
        self.page.goto(address)
        self.page.wait_for_selector("#status", timeout=60_000)

    def slider(self, name: str) -> Any:
        """Return what is dragged of a degree of freedom."""
        label = self.page.locator("label").filter(has_text=name)
        return self.page.locator(f'[id="{label.get_attribute("for")}"]').get_by_role("slider")

    def numbers(self) -> dict[str, float]:
        """Return where every slider stands."""
        return self.page.evaluate(
            """() => Object.fromEntries([...document.querySelectorAll("label[for]")].map(label => [
                label.innerText,
                Number(document.getElementById(label.htmlFor)?.querySelector("[role=slider]")?.ariaValueNow)
            ]).filter(pair => !Number.isNaN(pair[1])))"""
        )

    def type(self, name: str, number: float) -> None:
        """Type a number into the box beside a slider."""
        self.slider(name).locator("xpath=ancestor::*[.//input[@type='text']][1]//input[@type='text']").fill(str(number))

    def drag(self, name: str, share: float) -> None:
        """Drag a slider with the mouse to a share of its way."""
        thumb = self.slider(name)
        track = thumb.locator("xpath=..").bounding_box()
        box = thumb.bounding_box()
        self.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        self.page.mouse.down()
        for part in (0.5, 1.0):
            start, end = box["x"], track["x"] + share * track["width"]
            self.page.mouse.move(start + part * (end - start), box["y"] + box["height"] / 2)
        self.page.mouse.up()

    def press(self, name: str) -> None:
        """Press a button."""
        self.page.get_by_role("button", name=name, exact=True).click()

    def wait_status(self, words: str) -> None:
        """Wait until the status line says this, and the contacts have been found."""
        self.page.wait_for_function(
            "words => document.querySelector('#status')?.innerText === words"
            " && !document.querySelector('#reasons').innerText.includes('looking')",
            arg=words,
            timeout=30_000,
        )

    def reasons(self) -> list[str]:
        """Return the lines on what touches."""
        return self.page.inner_text("#reasons").splitlines()

    def picture(self) -> np.ndarray:
        """Return what the drawing shows, (h, w, 3) uint8."""
        from PIL import Image

        shot = self.page.screenshot(clip={"x": 0, "y": 160, "width": 400, "height": 400})
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"))

    def wait_picture(self, wanted: Callable[[np.ndarray], bool]) -> np.ndarray:
        """Wait until the drawing, which lags behind the words, is as wanted, and return it."""
        for _ in range(100):
            picture = self.picture()
            if wanted(picture):
                return picture
            self.page.wait_for_timeout(100)
        raise AssertionError("the drawing never becomes what it should be")
