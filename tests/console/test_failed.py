"""Wrong parameters set by hand are refused, and no robot's failure takes the page with it."""

import os
import signal
import subprocess

import pytest
from playwright.sync_api import expect

from lab import BIN, download, eventually

pytestmark = pytest.mark.thorough


def ready(page):
    expect(page.get_by_test_id("phase")).to_have_text("ready", ignore_case=True)


def step(page, tick):
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text(str(tick))


def test_a_parameter_that_a_robot_refuses_is_refused_before_anything_happens(launched, open_page, screenshots):
    run = launched("--paused", "--duration", "20 s", "--speed", "max")
    page = open_page(run.address)
    ready(page)
    step(page, 1)
    before = run.pid("cars-butler")
    page.get_by_test_id("tab-experiment").click()
    for robot, path, value, reason in [
        ("Butler", "policy", "nonsense", "Butler refuses these parameters: policy: unknown variant `nonsense`"),
        ("Butler", "polcy", "rules", "Butler refuses these parameters: polcy: unknown field `polcy`"),
        ("Leguin", "block_patience_s", "-1", "Leguin refuses these parameters: block_patience_s"),
    ]:
        set_parameter(page, robot, path, value)
        expect(page.get_by_test_id("message")).to_contain_text(reason)
    page.screenshot(path=screenshots / "refused.png")

    set_parameter(page, "Butler", "policy", "rules")
    expect(page.get_by_test_id("message")).to_contain_text("with the next tick")
    step(page, 2)
    step(page, 3)
    assert run.pid("cars-butler") != before
    changed = [event["set"] for event in run.events() if event["event"] == "changed"]
    assert len(changed) == 1 and "rules" in str(changed)
    page.get_by_test_id("btn-start").click()
    expect(page.get_by_test_id("phase")).to_have_text("ended", ignore_case=True)
    page.context.close()
    assert run.process.wait(timeout=60) == 0, run.output()
    assert run.verify().returncode == 0


def set_parameter(page, robot, path, value):
    page.get_by_test_id("experiment-robot").select_option(robot)
    page.get_by_test_id("experiment-path").fill(path)
    page.get_by_test_id("experiment-value").fill(value)
    page.get_by_test_id("do-set").click()


def test_a_failed_run_is_explained_and_resumed(launched, open_quietly, screenshots):
    run = launched("--paused", "--duration", "20 s", "--speed", "max")
    page = open_quietly(run.address)
    ready(page)
    step(page, 1)
    step(page, 2)
    os.kill(run.pid("cars-butler"), signal.SIGKILL)

    failed = page.get_by_test_id("failed")
    expect(failed).to_contain_text("Butler was ended by SIGKILL")
    expect(page.get_by_test_id("resume-command")).to_contain_text("cars launch --resume")
    page.screenshot(path=screenshots / "failed.png")
    dark = open_quietly(page.url, "dark", 900)
    dark.context.add_cookies(page.context.cookies())
    dark.goto(page.url)
    expect(dark.get_by_test_id("failed")).to_contain_text("Butler was ended by SIGKILL")
    dark.screenshot(path=screenshots / "failed-dark.png")
    dark.context.close()
    # The page may be loaded again.
    page.reload()
    expect(failed).to_be_visible()
    assert run.process.poll() is None

    page.get_by_test_id("resume").click()
    expect(failed).to_be_hidden()
    ready(page)
    expect(page.get_by_test_id("tick")).to_have_text("2")
    step(page, 3)
    page.get_by_test_id("btn-start").click()
    expect(page.get_by_test_id("phase")).to_have_text("ended", ignore_case=True)
    page.context.close()
    assert run.process.wait(timeout=60) == 0, run.output()
    assert run.verify().returncode == 0


def test_a_failed_run_ends_when_nobody_looks_any_more(launched, open_quietly):
    run = launched("--paused", "--duration", "20 s")
    page = open_quietly(run.address)
    ready(page)
    os.kill(run.pid("cars-leguin"), signal.SIGKILL)
    expect(page.get_by_test_id("failed")).to_contain_text("Leguin was ended by SIGKILL")
    page.context.close()
    assert run.process.wait(timeout=60) == 137, run.output()
    assert "can resume the run" in run.output()
    assert "Leguin was ended by SIGKILL" in run.output()


def test_a_parameter_that_is_refused_at_the_start_is_explained(launched, open_quietly, monkeypatch, screenshots):
    # A browser that is slow: it comes when the robot has failed.
    monkeypatch.setenv("BROWSER", "true")
    run = launched("--open", "--paused", "--set", "robot.Butler.params.policy=nonsense")
    eventually("the failure", lambda: "Butler ended with exit status 1" in run.output())
    page = open_quietly(run.address)
    failed = page.get_by_test_id("failed")
    expect(failed).to_contain_text("Butler ended with exit status 1")
    expect(page.get_by_test_id("failed-lines")).to_contain_text("parameters of Butler: policy: unknown variant `nonsense`")
    page.screenshot(path=screenshots / "failed-at-start.png")

    # The robot refuses it again.
    page.get_by_test_id("resume").click()
    eventually("the second failure", lambda: run.output().count("Butler ended with exit status 1: ending the run") == 2)
    expect(failed).to_contain_text("Butler ended with exit status 1")
    run.process.send_signal(signal.SIGINT)
    assert run.process.wait(timeout=60) == 1, run.output()


def test_a_failed_run_that_nobody_looks_at_ends_at_once(launched):
    run = launched("--set", "robot.Butler.params.policy=nonsense")
    assert run.process.wait(timeout=60) == 1, run.output()
    assert "can resume the run" not in run.output()


def test_a_scenario_that_a_robot_refuses_is_not_loaded(launch, open_page, tmp_path):
    run = launch()
    page = open_page(run.address)
    ready(page)
    page.get_by_test_id("tab-setup").click()
    saved = tmp_path / "saved.toml"
    download(page, "setup-save", saved)
    text = saved.read_text()
    now = 'policy = "emotion"'
    assert now in text

    changed = tmp_path / "changed.toml"
    change = '\n[[change]]\nat = "10 s"\nset = ["robot.Leguin.params.policy=nonsense"]\n'
    for robot, wrong in [("Butler", text.replace(now, 'policy = "nonsense"', 1)), ("Leguin", text + change)]:
        changed.write_text(wrong)
        page.get_by_test_id("setup-load").set_input_files(changed)
        expect(page.get_by_test_id("message")).to_contain_text(f"{robot} refuses these parameters: policy: unknown variant")
    assert run.status()["epoch"] == 1

    changed.write_text(text.replace(now, 'policy = "rules"', 1))
    page.get_by_test_id("setup-load").set_input_files(changed)
    eventually("the epoch", lambda: run.status()["epoch"] == 2)


def test_ctl_says_what_a_robot_refuses(launch):
    run = launch()
    command = [BIN / "cars", "ctl", "set", "robot.Butler.params.policy=nonsense", "--run", run.RUN, "--connect", run.endpoint]
    # No launcher is connected, which could start the robot again: that would be refused, too, but for another reason.
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=run.folder)
    assert done.returncode != 0
    assert "Butler refuses these parameters: policy: unknown variant" in done.stderr


def test_init_that_waits_for_a_dead_robot_says_so(launch, open_page):
    run = launch()
    page = open_page(run.address)
    ready(page)
    step(page, 1)
    run.kill("Leguin")
    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("end-run").click()
    expect(page.get_by_test_id("awaiting")).to_contain_text("Leguin")
    expect(page.get_by_test_id("phase")).to_have_text("gathering", ignore_case=True)
    page.get_by_test_id("btn-init").click()
    expect(page.get_by_test_id("message")).to_contain_text("the run is gathering")

    run.restart("Leguin")
    ready(page)
    assert run.status()["epoch"] == 2


def test_watch_again_and_init_after_a_fault_without_an_end(launched, open_page):
    fault = 'fault=[{robot="Leguin",do="crash",at="2 s"}]'
    run = launched("--paused", "--duration", "5 s", "--speed", "max", "--set", "on_late=continue", "--set", fault)
    page = open_page(run.address)
    ready(page)
    page.get_by_test_id("btn-start").click()
    expect(page.get_by_test_id("phase")).to_have_text("ended", ignore_case=True)
    page.get_by_test_id("watch-again").click()
    eventually("an earlier tick", lambda: int(page.get_by_test_id("tick").text_content()) < 10)
    expect(page.get_by_test_id("tick")).to_have_text("10", timeout=30_000)
    expect(page.get_by_test_id("message")).to_be_empty()
