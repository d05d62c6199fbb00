"""The page says which run it shows, and never shows another one by itself."""

import signal

import pytest
from playwright.sync_api import expect

from lab import PATIENCE_S, free_port, start_console

pytestmark = pytest.mark.thorough


@pytest.mark.parametrize("width, height", [(1440, 900), (390, 844)])
def test_the_name_of_the_run_is_always_visible(launch, open_page, screenshots, width, height):
    run = launch()
    page = open_page(run.address, width, height)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    expect(page.get_by_test_id("run")).to_have_text(run.RUN)
    expect(page.get_by_test_id("run")).to_be_visible()

    page.mouse.wheel(0, 2000)
    expect(page.get_by_test_id("run")).to_be_in_viewport()
    page.screenshot(path=screenshots / f"run-{width}.png")


class Address:
    """An address that one console has after the other. What a browser says when it cannot connect is expected."""

    def __init__(self, processes):
        self.processes = processes
        self.bind = f"127.0.0.1:{free_port()}"
        self.process = None

    def start(self, *arguments, **options):
        self.end()
        url = start_console(self.processes, *arguments, bind=self.bind, **options)
        self.process = self.processes.all[-1]
        return url

    def end(self):
        if self.process:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(PATIENCE_S)


@pytest.fixture
def context(browser):
    """A context whose pages may lose their server."""
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    yield context
    context.close()


def test_a_page_keeps_its_run_until_the_reader_chooses_another(launch, context, screenshots):
    """A server names another run after the connection was lost: here the connection itself changes the name."""
    run = launch()
    names = [run.RUN]
    sockets = []

    def relay(socket):
        server = socket.connect_to_server()
        server.on_message(lambda text: socket.send(text.replace(f'"run":"{run.RUN}"', f'"run":"{names[-1]}"')))
        sockets.append(socket)

    def reconnect(name):
        names.append(name)
        sockets[-1].close()

    page = context.new_page()
    page.route_web_socket("**/ws", relay)
    page.goto(run.address)
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("1")
    expect(page.get_by_test_id("connection")).to_have_text("connected")

    reconnect("other")
    expect(page.get_by_test_id("stranger")).to_contain_text("other")
    expect(page.get_by_test_id("connection")).to_have_text("another run has the address")
    expect(page.get_by_test_id("run")).to_have_text(run.RUN)
    expect(page.get_by_test_id("tick")).to_have_text("1")
    expect(page.get_by_test_id("panel-Butler")).to_be_visible()
    page.screenshot(path=screenshots / "another-run.png")
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("message")).to_contain_text("nothing was sent")
    assert run.status()["tick"] == 1

    page.get_by_test_id("stranger-keep").click()
    expect(page.get_by_test_id("stranger")).to_be_hidden()
    expect(page.get_by_test_id("connection")).to_have_text("another run has the address")

    # The first run is back.
    reconnect(run.RUN)
    expect(page.get_by_test_id("connection")).to_have_text("connected")
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("2")

    reconnect("other")
    page.get_by_test_id("stranger-show").click()
    expect(page.get_by_test_id("run")).to_have_text("other")


def test_a_page_that_is_refused_keeps_what_it_shows(launch, context):
    run = launch()
    address = Address(run.processes)
    page = context.new_page()
    page.goto(address.start(environment=run.environment))
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("1")

    address.start(environment=run.environment)
    expect(page.get_by_test_id("stranger")).to_contain_text("token")
    expect(page.get_by_test_id("panel-Butler")).to_be_visible()
    page.get_by_test_id("stranger-show").click()
    expect(page.get_by_role("heading", name="This console needs its token")).to_be_visible()
