"""The token: who has opened the printed address may watch and control, and no other user or page."""

import http.server
import re
import threading
import urllib.error
import urllib.request

import pytest
from playwright.sync_api import expect

from lab import PATIENCE_S, eventually, free_port, start_console

pytestmark = pytest.mark.thorough


def token_of(address):
    return re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=([0-9a-f]{48})", address)[1]


def origin_of(address):
    return address.split("/?")[0]


def connected(page, phase="ready"):
    expect(page.get_by_test_id("phase")).to_have_text(phase, ignore_case=True)


def explains(page):
    """Waits for the page that asks for the token."""
    heading = page.get_by_role("heading", name="This console needs its token")
    expect(heading).to_be_visible(timeout=20_000)


@pytest.fixture
def context(browser):
    """A browser profile. Pages in it may log errors: these tests refuse them."""
    context = browser.new_context()
    yield context
    context.close()


def test_the_address_bar_and_the_history_have_no_token(launch, open_page):
    run = launch()
    token = token_of(run.address)
    page = open_page(run.address)
    connected(page)

    assert re.fullmatch(origin_of(run.address) + r"/[0-9a-f]{16}/", page.url)
    assert token not in page.content()
    assert page.evaluate("document.cookie") == ""
    stored = page.evaluate("JSON.stringify([localStorage, sessionStorage, performance.getEntries()])")
    assert token not in stored

    [cookie] = page.context.cookies()
    assert cookie["httpOnly"]
    assert cookie["sameSite"] == "Strict"
    assert cookie["expires"] == -1

    # The visit left one entry in the history.
    page.goto("about:blank")
    page.go_back()
    connected(page)
    assert token not in page.url
    page.go_back()
    assert page.url == "about:blank"


def test_a_reloaded_page_and_a_further_tab_need_no_token(launch, open_page):
    run = launch()
    page = open_page(run.address)
    connected(page)

    page.reload()
    connected(page)
    tab = page.context.new_page()
    tab.goto(page.url)
    connected(tab)
    tab.get_by_test_id("btn-step").click()
    eventually("the step", lambda: run.status()["tick"] == 1)


def test_another_browser_gets_a_page_that_explains_what_to_do(launch, open_page, context):
    run = launch()
    visited = open_page(run.address).url
    page = context.new_page()

    for address in (origin_of(run.address), origin_of(run.address) + "/?token=" + 48 * "0", visited + "ws"):
        answer = page.goto(address)
        assert answer.status == 403
        explains(page)
        expect(page.locator("pre")).to_contain_text("?token=")
        assert context.cookies() == []

    # Its path alone shows the files of the page, and nothing of the run.
    page.goto(visited)
    explains(page)
    assert page.url == origin_of(run.address) + "/"

    page.goto(run.address)
    connected(page)


def test_a_page_that_loses_its_cookie_says_so(launch, context):
    run = launch()
    page = context.new_page()
    page.goto(run.address)
    connected(page)

    context.clear_cookies()
    page.reload()

    explains(page)


def test_the_opened_file_leads_to_the_page(launch, open_page, tmp_path):
    run = launch()
    opened = tmp_path / "opened"
    browser = tmp_path / "browser.sh"
    browser.write_text(f'#!/bin/sh\necho "$@" > {opened}.writing\nmv {opened}.writing {opened}\n')
    browser.chmod(0o755)
    environment = {**run.environment, "BROWSER": str(browser)}
    start_console(run.processes, "--open", environment=environment, cwd=tmp_path)
    eventually("the browser", opened.exists)
    file = opened.read_text().strip()

    page = open_page(f"file://{file}")

    connected(page)
    page.get_by_test_id("btn-step").click()
    eventually("the step", lambda: run.status()["tick"] == 1)
    assert "token" not in page.url


def test_two_consoles_in_one_browser_do_not_disturb_each_other(launch, context):
    run = launch()
    other = start_console(run.processes, environment=run.environment)
    one_page = context.new_page()
    one_page.goto(run.address)
    connected(one_page)
    other_page = context.new_page()
    other_page.goto(other)
    connected(other_page)

    assert len(context.cookies()) == 2
    for page, phase, tick in ((one_page, "ready", 1), (other_page, "paused", 2)):
        page.reload()
        connected(page, phase)
        page.get_by_test_id("btn-step").click()
        eventually("the step", lambda: run.status()["tick"] == tick)


def test_a_page_of_an_ended_console_leads_to_the_new_ones_explanation(processes, context):
    port = free_port()
    arguments = ("--connect", "tcp/127.0.0.1:1")
    bind = f"127.0.0.1:{port}"
    first = start_console(processes, *arguments, bind=bind)
    page = context.new_page()
    page.goto(first)
    expect(page.get_by_test_id("connection")).to_have_text("no simulator")

    ended = processes.all[-1]
    ended.terminate()
    ended.wait(PATIENCE_S)
    expect(page.get_by_test_id("connection")).to_have_text("console not reachable")
    start_console(processes, *arguments, bind=bind)

    explains(page)


class Stranger(http.server.BaseHTTPRequestHandler):
    """A server of another user on another port, which writes down what a browser sends."""

    def do_GET(self):
        self.server.heads.append(f"{self.requestline}\n{self.headers}")
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.send_header("Set-Cookie", f"{self.server.tossed}=0; Path=/")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>stranger</title>")

    def log_message(self, *_):
        pass


@pytest.fixture
def stranger():
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Stranger)
    server.heads = []
    threading.Thread(target=server.serve_forever).start()
    yield server
    server.shutdown()
    server.server_close()


def test_a_server_on_another_port_gets_no_cookie_and_its_page_no_socket(launch, context, stranger):
    run = launch()
    token = token_of(run.address)
    page = context.new_page()
    page.goto(run.address)
    connected(page)
    path = page.url.removeprefix(origin_of(run.address))
    stranger.tossed = f"cars-console-{origin_of(run.address).rsplit(':')[-1]}"

    other = context.new_page()
    for requested in ("/", "/ws", "/recording", "/assets/app.js"):
        other.goto(f"http://127.0.0.1:{stranger.server_port}{requested}")
    assert len(stranger.heads) >= 4
    assert token not in "".join(stranger.heads)

    # Even with the path, which it cannot know: the browser sends the cookie, and the server refuses the origin.
    for url in (origin_of(run.address) + "/ws", page.url + "ws"):
        outcome = other.evaluate(
            """(url) => new Promise((resolve) => {
                const socket = new WebSocket(url);
                socket.onopen = () => resolve("open");
                socket.onerror = () => resolve("refused");
            })""",
            url.replace("http:", "ws:"),
        )
        assert outcome == "refused", url
    assert path not in "".join(stranger.heads)

    # A cookie of the same name that the stranger has set does not lock the owner out.
    page.reload()
    connected(page)


def test_a_link_from_another_page_admits_who_has_the_token_only(launch, context, stranger):
    run = launch()
    stranger.tossed = "other"
    page = context.new_page()

    for host in ("127.0.0.1", "localhost"):
        page.goto(f"http://{host}:{stranger.server_port}/")
        page.evaluate("(url) => { location.href = url }", run.address)
        connected(page)
        context.clear_cookies()
        page.goto(f"http://{host}:{stranger.server_port}/")
        page.evaluate("(url) => { location.href = url }", origin_of(run.address))
        explains(page)


def test_no_run_changes_by_what_a_program_without_token_sends(launch):
    run = launch()
    body = b'{"type":"control","id":1,"control":{"do":"step","n":1}}'
    for method in ("GET", "POST", "PUT", "DELETE"):
        for path in ("/", "/ws", "/control", "/step", "/?token=", "//"):
            request = urllib.request.Request(origin_of(run.address) + path, data=body, method=method)
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(request, timeout=PATIENCE_S)
            assert refused.value.code == 403

    assert run.status()["tick"] == 0
