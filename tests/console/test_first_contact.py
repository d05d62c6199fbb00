"""A console without a simulator, one whose simulator goes, and what the log says."""

import shlex
import signal

import pytest
from playwright.sync_api import expect

from lab import PATIENCE_S, free_port, start_console, until

pytestmark = pytest.mark.thorough


def test_the_advice_works_when_it_is_typed(processes, open_page, tmp_path, screenshots):
    address = start_console(processes, "--run", "typed", "--connect", f"tcp/127.0.0.1:{free_port()}")
    page = open_page(address)
    advice = page.get_by_test_id("advice")
    expect(advice).to_contain_text("typed")
    page.screenshot(path=screenshots / "advice.png")

    program, *arguments = shlex.split(advice.inner_text())
    assert program == "cars"
    launching = processes.start("cars", *arguments, "--out", tmp_path / "runs", stdout=-3, start_new_session=True)
    expect(page.get_by_test_id("connection")).to_have_text("connected")
    until(page, "window.carsConsole.frame() !== null")
    assert page.evaluate("window.carsConsole.frame().run") == "typed"

    # A launch ends its processes.
    launching.send_signal(signal.SIGINT)
    launching.wait(PATIENCE_S)
    expect(page.get_by_test_id("connection")).to_have_text("no simulator")


def test_nothing_is_green_when_the_simulator_is_gone(launch, open_page, screenshots):
    run = launch(options=("--speed", "20"))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, "window.carsConsole.frame()?.tick > 3")
    expect(page.locator(".bar .dot.good")).to_have_count(1)
    expect(page.locator(".panel .dot.good")).to_have_count(2)

    run.simulator.send_signal(signal.SIGKILL)
    run.simulator.wait()
    expect(page.get_by_test_id("connection")).to_have_text("no simulator")
    expect(page.locator(".dot.good, .pill.phase-running")).to_have_count(0)
    page.screenshot(path=screenshots / "gone.png")


def test_a_simulator_that_hangs_is_not_shown_as_connected(launch, open_page):
    run = launch()
    page = open_page(run.address)
    expect(page.get_by_test_id("connection")).to_have_text("connected")
    run.simulator.send_signal(signal.SIGSTOP)
    try:
        expect(page.get_by_test_id("connection")).to_have_text("no simulator")
    finally:
        run.simulator.send_signal(signal.SIGCONT)


def test_a_refused_speed_goes_back(launch, open_page):
    run = launch(options=("--speed", "2"))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    expect(page.get_by_test_id("speed")).to_have_value("2")
    run.simulator.kill()
    run.simulator.wait()
    expect(page.get_by_test_id("connection")).to_have_text("no simulator")

    page.get_by_test_id("speed").select_option("20")
    expect(page.get_by_test_id("message")).to_contain_text("no simulator")
    expect(page.get_by_test_id("speed")).to_have_value("2")


def test_the_network_filter_shows_lost_commands(launch, open_page):
    run = launch()
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    lines = (
        ("command", "Leguin", "command 3 of Butler was lost on the way, because of a cut"),
        ("command", "Leguin", "command 4 of Butler is held back until tick 9"),
        ("command", "Leguin", "receives command 2 of Butler"),
        ("network", "simulator", "commands from Butler to Leguin are cut"),
    )
    for kind, source, text in lines:
        run.put("log", {"epoch": 1, "tick": 0, "time_s": 0.0, "source": source, "kind": kind, "text": text})
    log = page.get_by_test_id("log")
    expect(log).to_contain_text("are cut")

    page.get_by_test_id("log-filter-kind").select_option("network")
    expect(log.locator(".text")).to_have_text([lines[0][2], lines[1][2], lines[3][2]])
    page.get_by_test_id("log-filter-kind").select_option("command")
    expect(log).to_contain_text("was lost on the way")
    expect(log).not_to_contain_text("are cut")


def test_epochs_are_divided_in_the_log(launch, open_page, screenshots):
    run = launch()
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("1")
    expect(page.get_by_test_id("log-epoch")).to_have_count(0)

    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("end-run").click()
    expect(page.get_by_test_id("log-epoch")).to_have_text(["epoch 2"])
    page.get_by_test_id("btn-init").click()
    expect(page.get_by_test_id("log-epoch")).to_have_text(["epoch 2", "epoch 3"])
    page.get_by_test_id("log-filter-kind").select_option("run")
    expect(page.get_by_test_id("log-epoch")).to_have_text(["epoch 2", "epoch 3"])
    page.screenshot(path=screenshots / "epochs.png")


def test_a_button_leads_to_the_newest_line(launch, open_page):
    run = launch(options=("--speed", "max", "--duration", "100000 s"))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, "window.carsConsole.frame()?.tick > 300")
    log = page.get_by_test_id("log")
    expect(page.get_by_test_id("log-follow")).to_be_hidden()

    log.hover()
    page.mouse.wheel(0, -300)
    expect(page.get_by_test_id("log-follow")).to_be_visible()
    page.get_by_test_id("btn-pause").click()
    page.get_by_test_id("log-follow").click()
    expect(page.get_by_test_id("log-follow")).to_be_hidden()
    at_end = "(() => { const log = document.querySelector('[data-testid=log]');"
    until(page, at_end + " return log.scrollHeight - log.scrollTop - log.clientHeight < 12; })()")
