"""One Chromium for all tests; a launch, and pages that must not complain, for each."""

import os
import pathlib

import pytest
from playwright.sync_api import expect, sync_playwright

from lab import ROOT, Launch

CHROMIUM = "/usr/bin/chromium"
SCREENSHOTS = pathlib.Path(os.environ.get("CARS_SCREENSHOTS", ROOT / "target" / "console-screenshots"))

expect.set_options(timeout=10_000)


@pytest.fixture(scope="session")
def browser():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def launch(tmp_path):
    """Starts launches; they end with the test."""
    started = []

    def start(**options):
        started.append(Launch(tmp_path, **options))
        return started[-1]

    yield start
    for one in started:
        one.end()
        print(one.processes.logs())


@pytest.fixture
def open_page(browser):
    """Opens pages. None of them may print an error, throw one, or ask anything in a dialog."""
    contexts, complaints = [], []

    def complain(message):
        if message.type in ("error", "warning"):
            complaints.append(f"console: {message.text} ({message.location})")

    def open_at(address, width=1440, height=900, scheme="light", **options):
        viewport = {"width": width, "height": height}
        context = browser.new_context(viewport=viewport, color_scheme=scheme, **options)
        contexts.append(context)
        page = context.new_page()
        page.on("console", complain)
        page.on("pageerror", lambda error: complaints.append(f"thrown: {error}"))
        page.on("dialog", lambda dialog: (complaints.append(f"dialog: {dialog.message}"), dialog.dismiss()))
        page.goto(address)
        return page

    yield open_at
    for context in contexts:
        context.close()
    assert complaints == []


@pytest.fixture(scope="session")
def screenshots():
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    yield SCREENSHOTS
    print(f"\nscreenshots: {SCREENSHOTS}")
