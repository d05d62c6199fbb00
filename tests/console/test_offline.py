"""A connection that is silent: the page says so soon, and what is clicked meanwhile is not carried out later."""

import re
import select
import signal
import socket
import threading
import time
from contextlib import contextmanager

import pytest
from playwright.sync_api import expect

from lab import Launch, eventually, free_port, start_console

pytestmark = pytest.mark.thorough

NOTICED_S = 3.0
# Browser and test share the machine with others.
SLACK_S = 1.0


@contextmanager
def stopped(process):
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.send_signal(signal.SIGCONT)


class SilentProxy:
    """Forwards to a port, and keeps what it has while it is silent."""

    def __init__(self, port):
        self.port = port
        self.speaks = threading.Event()
        self.speaks.set()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.own_port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                client, _ = self.listener.accept()
            except OSError:
                return
            server = socket.create_connection(("127.0.0.1", self.port))
            for one, other in ((client, server), (server, client)):
                threading.Thread(target=self.copy, args=(one, other), daemon=True).start()

    def copy(self, source, target):
        try:
            while data := source.recv(65536):
                self.speaks.wait()
                target.sendall(data)
        except OSError:
            pass
        for end in (source, target):
            end.close()

    @contextmanager
    def silence(self):
        self.speaks.clear()
        try:
            yield
        finally:
            self.speaks.set()


def connected(page):
    expect(page.get_by_test_id("connection")).to_have_text("connected")
    expect(page.get_by_test_id("tick")).not_to_have_text("–")


def click_and_wait_until_lost(page, begun):
    """Clicks at once, when the page cannot know yet, and again when it does."""
    page.get_by_test_id("btn-step").click()
    expect(page.locator("#gone")).to_be_visible()
    assert time.monotonic() - begun < NOTICED_S + SLACK_S
    expect(page.get_by_test_id("message")).to_contain_text("is not done later")

    page.evaluate("document.querySelector('[data-testid=btn-step]').disabled || document.querySelector('[data-testid=btn-step]').click()")
    page.keyboard.press(".")


def nothing_is_done_later(page, run):
    connected(page)
    # What was on its way has arrived by then.
    time.sleep(1.0)
    assert run.status()["tick"] == 0
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("1")


def test_a_server_that_is_stopped_is_noticed_and_does_nothing_later(launch, open_quietly, screenshots):
    run = launch()
    page = open_quietly(run.address)
    connected(page)

    with stopped(run.processes.all[-1]):
        begun = time.monotonic()
        click_and_wait_until_lost(page, begun)
        page.screenshot(path=screenshots / "offline.png")
        time.sleep(max(0.0, begun + 6.0 - time.monotonic()))
    nothing_is_done_later(page, run)


def test_a_simulator_that_is_stopped_does_nothing_later(launch, open_quietly):
    run = launch()
    page = open_quietly(run.address)
    connected(page)

    with stopped(run.simulator):
        page.get_by_test_id("btn-step").click()
        expect(page.get_by_test_id("message")).to_contain_text("is not done later", timeout=10_000)
    nothing_is_done_later(page, run)


def test_a_network_that_is_silent_is_noticed_and_delivers_nothing_later(launch, open_quietly):
    run = launch()
    port = free_port()
    proxy = SilentProxy(port)
    address = start_console(
        run.processes, "--allow-host", f"127.0.0.1:{proxy.own_port}", bind=f"127.0.0.1:{port}", environment=run.environment
    )
    page = open_quietly(address.replace(f":{port}/", f":{proxy.own_port}/"))
    connected(page)

    with proxy.silence():
        begun = time.monotonic()
        click_and_wait_until_lost(page, begun)
        time.sleep(max(0.0, begun + 6.0 - time.monotonic()))
    nothing_is_done_later(page, run)


def test_a_short_silence_loses_nothing(launch, open_quietly):
    run = launch()
    page = open_quietly(run.address)
    connected(page)
    with stopped(run.processes.all[-1]):
        page.get_by_test_id("btn-step").click()
        time.sleep(0.8)
    expect(page.get_by_test_id("tick")).to_have_text("1")
    expect(page.locator("#gone")).to_be_hidden()


def test_a_simulator_that_was_killed_is_told_with_what_to_type(launch, open_quietly):
    run = launch()
    page = open_quietly(run.address)
    connected(page)
    run.simulator.kill()
    expect(page.locator("#gone")).to_contain_text(f"cars launch --resume {run.RUN}")


def test_a_request_waits_as_long_as_the_console_is_told(launch, open_quietly):
    run = launch()
    address = start_console(run.processes, "--reply-timeout", "0.3", environment=run.environment)
    page = open_quietly(address)
    connected(page)
    with stopped(run.simulator):
        page.get_by_test_id("btn-init").click()
        expect(page.get_by_test_id("message")).to_contain_text(re.compile("no answer within|no simulator"))
