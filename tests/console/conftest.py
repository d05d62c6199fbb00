"""One Chromium for all tests; launches and pages for each."""

import os
import pathlib

import pytest
from playwright.sync_api import expect, sync_playwright

from lab import ROOT, Launch, Launched, Processes

# The shell is the same engine without windows, and needs a third less processor time.
SHELL = "/usr/bin/chromium-headless-shell"
CHROMIUM = SHELL if os.path.exists(SHELL) else "/usr/bin/chromium"
SCREENSHOTS = pathlib.Path(os.environ.get("CARS_SCREENSHOTS", ROOT / "target" / "console-screenshots"))

expect.set_options(timeout=30_000)

# Tests in Rust that run at the same time end all processes of a run with the name of theirs that no other test has marked.
os.environ["CARS_TEST"] = f"{os.getpid()}/pytest"


def pytest_configure(config):
    config.addinivalue_line("markers", "thorough: for CI; a file of such tests says so in its head")


@pytest.fixture(scope="session")
def browser():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def launch(tmp_path):
    """Starts launches and ends them with the test."""
    started = []

    def start(kind=Launch, **options):
        folder = tmp_path / f"launch-{len(started)}"
        folder.mkdir()
        started.append(kind(folder, **options))
        return started[-1]

    yield start

    for one in started:
        one.end()
        print(one.processes.logs())


@pytest.fixture
def launched(tmp_path):
    """Starts launches by `cars launch` and ends them with the test."""
    started = []

    def start(*options):
        folder = tmp_path / f"launched-{len(started)}"
        folder.mkdir()
        started.append(Launched(folder, *options))
        return started[-1]

    yield start

    for one in started:
        one.end()
        print(one.output())


@pytest.fixture
def processes(tmp_path):
    """Starts programs and ends them with the test."""
    processes = Processes(tmp_path)
    yield processes
    processes.end()
    print(processes.logs())


@pytest.fixture
def open_page(browser, launch, launched, processes):
    """Opens pages. A test fails if one of them logs an error or warning, throws, or opens a dialog. Pages are closed before the
    runs that they show end, which they would log: `launch`, `launched` and `processes` are here for that."""
    contexts = []
    errors = []

    def on_console(message):
        if message.type in ("error", "warning"):
            errors.append(f"console: {message.text} ({message.location})")

    def on_dialog(dialog):
        errors.append(f"dialog: {dialog.message}")
        dialog.dismiss()

    def open_at(address, width=1440, height=900, scheme="light", **options):
        viewport = {"width": width, "height": height}
        context = browser.new_context(viewport=viewport, color_scheme=scheme, **options)
        contexts.append(context)

        page = context.new_page()
        page.on("console", on_console)
        page.on("pageerror", lambda error: errors.append(f"thrown: {error}"))
        page.on("dialog", on_dialog)
        page.goto(address)
        return page

    yield open_at

    for context in contexts:
        context.close()
    assert errors == []


@pytest.fixture
def open_quietly(browser):
    """Opens pages of consoles that go: their browsers log that a connection is lost."""
    contexts = []

    def open_at(address, scheme="light", width=1440):
        contexts.append(browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme))
        page = contexts[-1].new_page()
        page.goto(address)
        return page

    yield open_at

    for context in contexts:
        context.close()


@pytest.fixture(scope="session")
def screenshots():
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    yield SCREENSHOTS
    print(f"\nscreenshots: {SCREENSHOTS}")
