"""What decided a run: answers of `cars why` in its folder are shown over the time line."""

import json
import subprocess

import pytest
from playwright.sync_api import expect

from lab import BIN, PATIENCE_S, ROOT, eventually, scrub, start_console, until
from test_access import axe, violations  # noqa: F401, a fixture
from test_replay import RUN, replay  # noqa: F401, a fixture

SENTENCE = (
    '"a call is answered or escalated" fails. It was decided at 30 s (tick 60): 12 % (9 to 15), n = 400 -> 94 % (91 to 96), n = 400, '
    "because command 9 from Butler to Leguin was lost; without that it is 10 % (7 to 15), n = 200."
)
LAST = 200


def outcomes(value, n=400):
    """An expected outcome as an answer has it."""
    return {"n": n, "value": value, "low": max(0.0, value - 0.04), "high": min(1.0, value + 0.04)}


def answer(folder, **changes):
    """An answer about a run of 200 ticks, with two jumps."""
    events = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    digest = next(event["digest"] for event in reversed(events) if event["event"] == "tick")
    steps = [(0, 0.1), (20, 0.11), (40, 0.12), (59, 0.12), (60, 0.94), (100, 0.93), (119, 0.9), (120, 0.6), (150, 0.65), (180, 0.7)]
    curve = [{"tick": tick, **outcomes(value, 64)} for tick, value in steps]
    curve.append({"tick": LAST, "n": 1, "value": 1.0, "low": None, "high": None})
    cause = {"what": "command 9 from Butler to Leguin was lost", "is_event": True, "without": outcomes(0.1, 200)}
    jumps = [
        {"tick": 60, "before": outcomes(0.12), "after": outcomes(0.94), "p": 0.0001, "events": ["a"], "cause": cause, "tried": []},
        {"tick": 120, "before": outcomes(0.9), "after": outcomes(0.6), "p": 0.001, "events": [], "cause": None, "tried": []},
    ]
    return {
        "version": "0.1.0", "run": folder.name, "digest": digest,
        "question": {"kind": "expectation", "name": "a call is answered or escalated", "or_undecided": False},
        "is_share": True, "recorded": 1.0, "tick_s": 0.5, "last": LAST, "curve": curve, "jumps": jumps, "kinds": [], "planned": [],
        "least_jump": 0.1, "forks": 6000, "is_complete": True, "sentence": SENTENCE, **changes,
    }  # fmt: skip


def write(folder, name, text):
    (folder / "why").mkdir(exist_ok=True)
    (folder / "why" / f"{name}.json").write_text(text if isinstance(text, str) else json.dumps(text))


@pytest.fixture
def folder(tmp_path):
    """The folder of a run of 200 ticks."""
    command = [BIN / "cars", "run", "configs/hors_doeuvres.toml", "-q", "--duration", "100 s", "--run", "hall", "--out", tmp_path / "runs"]
    # What the scenario expects is not decided after 100 s, which its exit status says.
    subprocess.run(command, capture_output=True, timeout=PATIENCE_S, cwd=ROOT)
    return tmp_path / "runs" / "hall"


def show(processes, open_page, folder, **options):
    page = open_page(start_console(processes, "--recording", folder), **options)
    until(page, "window.carsConsole.frame()?.tick === 0")
    return page


def test_a_click_on_a_jump_shows_its_tick(folder, processes, open_page):
    write(folder, "a", answer(folder))
    page = show(processes, open_page, folder)
    expect(page.get_by_test_id("why-sentence")).to_have_text(SENTENCE)
    expect(page.get_by_test_id("why-question")).to_have_count(0)
    expect(page.get_by_test_id("why-picture")).to_have_accessible_name(f"probability that it fails over the run: {SENTENCE}")

    # The axis of the band is that of the time line.
    band = page.get_by_test_id("why-band").bounding_box()
    lane = page.get_by_test_id("timeline").bounding_box()
    assert (band["x"], band["width"]) == (lane["x"], lane["width"])
    marks = page.get_by_test_id("why-mark")
    expect(marks).to_have_count(2)
    box = marks.first.bounding_box()
    end = int(page.get_by_test_id("scrub").get_attribute("max"))
    assert box["x"] + box["width"] / 2 == pytest.approx(band["x"] + band["width"] * 60 / end, abs=1)
    assert page.locator(".why-curve").get_attribute("d").count("L") == 10, "the outcome of the run is the last one of 11 points"

    marks.first.click()
    until(page, "window.carsConsole.frame()?.tick === 60")
    jumps = page.get_by_test_id("why-jump")
    told = "30 s, tick 60: 12 % → 94 %, because command 9 from Butler to Leguin was lost; without it 10 %"
    expect(jumps).to_have_text([told, "60 s, tick 120: 90 % → 60 %"])
    jumps.nth(1).focus()
    page.keyboard.press("Enter")
    until(page, "window.carsConsole.frame()?.tick === 120")


@pytest.mark.thorough
def test_several_questions_are_a_choice(folder, processes, open_page):
    write(folder, "a", answer(folder))
    other = {"kind": "summary", "path": "robots.Butler.blocked"}
    write(folder, "b", answer(folder, question=other, is_share=False, jumps=[], sentence="robots.Butler.blocked is 1. Nothing decided it."))
    page = show(processes, open_page, folder)
    expect(page.get_by_test_id("why-mark")).to_have_count(2)
    page.get_by_test_id("why-question").select_option("robots.Butler.blocked")
    expect(page.get_by_test_id("why-sentence")).to_contain_text("Nothing decided it")
    expect(page.get_by_test_id("why-mark")).to_have_count(0)
    expect(page.locator(".why-axis")).to_have_text("expected robots.Butler.blocked")

    page.get_by_test_id("why-fold").click()
    expect(page.get_by_test_id("why-band")).to_be_hidden()
    page.reload()
    expect(page.get_by_test_id("why-sentence")).to_be_visible()
    expect(page.get_by_test_id("why-band")).to_be_hidden()


@pytest.mark.thorough
def test_what_is_damaged_is_said_and_what_comes_later_is_shown(folder, processes, open_page):
    write(folder, "a", "{")
    write(folder, "b", answer(folder, digest="of another run", sentence="not this run"))
    page = show(processes, open_page, folder)
    expect(page.get_by_test_id("why-note")).to_contain_text("why/a.json cannot be shown")
    expect(page.get_by_test_id("why-band")).to_be_hidden()
    scrub(page, 50)
    until(page, "window.carsConsole.frame()?.tick === 50")

    # The question is asked while the page is open.
    write(folder, "a", answer(folder, sentence="<b>first</b> asked"))
    expect(page.get_by_test_id("why-sentence")).to_have_text("<b>first</b> asked")
    expect(page.get_by_test_id("why-note")).to_have_count(0)


@pytest.mark.thorough
def test_a_run_in_progress_has_its_answer_when_it_is_over(launch, open_page):
    run = launch(options=("--speed", "max", "--duration", "100 s"))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    run.control("start")
    expect(page.get_by_test_id("tick")).to_have_text(str(LAST))
    eventually("the end", lambda: run.events()[-1]["event"] == "end")
    write(run.run_folder, "a", answer(run.run_folder))
    page.get_by_test_id("why-mark").first.click()
    until(page, "window.carsConsole.frame()?.tick === 60")


@pytest.mark.thorough
def test_a_replay_has_the_answer_about_its_run(replay, open_page):  # noqa: F811
    recorded = replay.out / RUN
    write(recorded, "a", answer(recorded))
    page = open_page(start_console(replay.processes, "--folder", recorded, environment=replay.environment))
    expect(page.get_by_test_id("why-sentence")).to_have_text(SENTENCE)
    expect(page.get_by_test_id("why-mark")).to_have_count(2)

    # A click shows the tick of the recording; the replay stays where it is.
    page.get_by_test_id("why-mark").first.click()
    until(page, "window.carsConsole.frame()?.tick === 60")
    page.get_by_test_id("why-jump").nth(1).click()
    until(page, "window.carsConsole.frame()?.tick === 120")


@pytest.mark.thorough
def test_without_an_answer_there_is_nothing(folder, processes, open_page):
    page = show(processes, open_page, folder)
    with page.expect_response(lambda response: "recording/decisions" in response.url):
        pass
    expect(page.get_by_test_id("why")).to_be_hidden()


@pytest.mark.thorough
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width, height, forced", [(1440, 900, "none"), (1024, 700, "none"), (1024, 700, "active"), (390, 844, "none")])
def test_it_can_be_seen_and_read(folder, processes, open_page, axe, screenshots, width, height, forced, scheme):  # noqa: F811
    write(folder, "a", answer(folder))
    write(folder, "b", answer(folder, question={"kind": "measure", "name": "waited"}))
    page = show(processes, open_page, folder, width=width, height=height, scheme=scheme, forced_colors=forced)
    expect(page.get_by_test_id("why-mark")).to_have_count(2)
    page.get_by_test_id("why-jump").first.click()
    until(page, "window.carsConsole.frame()?.tick === 60")
    page.screenshot(path=screenshots / f"why-{width}x{height}-{scheme}{'-forced' if forced == 'active' else ''}.png", full_page=width < 1000)
    assert page.evaluate("document.documentElement.scrollWidth - window.innerWidth") <= 0
    plan = page.get_by_test_id("plan").bounding_box()
    assert plan["height"] > height / 5, "the plan keeps its place"
    assert violations(page, axe, "with an answer") == []
