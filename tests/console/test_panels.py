"""What a panel shows without one of the robot's own, what it folds, and the list of many robots."""

import pytest
from playwright.sync_api import expect

from lab import Crowd, eventually, until

pytestmark = pytest.mark.thorough

THREE = {"scenario": "configs/three_robots.toml", "robots": ("Butler", "Leguin", "Vonda")}


def opened(open_page, run, **options):
    page = open_page(run.address, **options)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    return page


def step(page, tick):
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text(str(tick))


def test_a_panel_has_content_before_the_first_tick(launch, open_page, screenshots):
    page = opened(open_page, launch(**THREE))
    for robot in page.evaluate("window.carsConsole.frame().robots"):
        panel = page.get_by_test_id(f"panel-{robot['name']}")
        expect(panel.locator("tr", has_text="class")).to_contain_text(robot["name"])
        expect(panel.locator(".pair", has_text="emotion").locator(".badge")).to_have_text(robot["emotion_state"] or "none yet")
        expect(panel.locator(".pair", has_text="behavior").locator(".badge")).to_have_text(robot["behavior_state"] or "none yet")
        expect(panel.locator(".where")).to_contain_text("ft/s")
        expect(panel.locator(".text")).to_contain_text("last commands")
    page.screenshot(path=screenshots / "panels-tick-0.png")


def test_a_robot_that_has_said_nothing_has_a_panel_too(launch, open_page):
    page = opened(open_page, launch())
    known = page.evaluate(
        """() => import('./assets/known.js').then(({generic}) => generic(
            {...window.carsConsole.frame().robots[0], emotion_state: '', behavior_state: '', state_variables: {}},
            {className: '', commands: [], isBegun: false}))"""
    )
    assert [widget.get("text") for widget in known["widgets"] if widget["widget"] == "badge"] == ["none yet", "none yet"]
    assert known["details"] == [], "there is nothing to unfold"


def test_a_robot_without_emotions_has_no_badge_of_one(launch, open_page):
    page = opened(open_page, launch())
    known = page.evaluate(
        """() => import('./assets/known.js').then(({generic}) => generic(
            {...window.carsConsole.frame().robots[0], emotion_state: '', behavior_state: 'GO', state_variables: {}},
            {className: '', commands: [], isBegun: true}))"""
    )
    badges = [(widget["label"], widget["text"]) for widget in known["widgets"] if widget["widget"] == "badge"]
    assert badges == [("behavior", "GO")]


def test_a_list_of_robots_without_emotions_has_no_columns_of_them(launch, open_page):
    page = opened(open_page, launch())
    lines = page.evaluate(
        """() => import('./assets/robot-list.js').then(({RobotList}) => {
            const list = new RobotList({choose() {}, changed() {}});
            document.querySelector(".panels, #panels, body").append(list.place);
            const line = (emotion) => ({name: "S1", emotion, intensity: null, behavior: "GO", held: "", badness: 0, isAbsent: false});
            return ["", "HAPPY"].map((emotion) => {
                list.render([line(emotion)], null);
                return [...list.place.querySelectorAll(".list-head button")].filter((head) => head.offsetParent).length;
            });
        })"""
    )
    assert lines == [3, 5]


def test_an_empty_panel_is_replaced_by_what_is_known(launch, open_page):
    run = launch()
    page = opened(open_page, run)
    step(page, 1)
    panel = page.get_by_test_id("panel-Leguin")
    expect(panel).to_contain_text("why")
    panel.get_by_test_id("button-refill").click()
    expect(page.get_by_test_id("message")).to_contain_text("refill")
    step(page, 2)
    step(page, 3)
    expect(panel.locator(".pair", has_text="behavior")).to_contain_text("REFILL")
    expect(page.get_by_test_id("log")).to_contain_text("-> Leguin: refill")

    run.put_panel("Leguin", [])
    expect(panel.locator(".text", has_text="last commands")).to_contain_text("from operator: refill")
    expect(panel.locator("tr", has_text="class")).to_contain_text("Leguin")
    expect(panel.locator(".pair", has_text="behavior")).to_contain_text("REFILL")
    expect(panel.get_by_test_id("face")).to_be_visible()
    expect(panel.locator(".gauge", has_text="intensity")).to_be_visible()
    panel.locator("summary", has_text="Details").click()
    expect(panel.locator("tr", has_text="trips")).to_be_visible()

    # A panel with nothing but buttons has them below what is known.
    run.put_panel("Leguin", [{"widget": "button", "label": "Hurry", "command": "hurry"}])
    expect(panel.get_by_test_id("button-hurry")).to_be_visible()
    expect(panel.locator("tr", has_text="class")).to_contain_text("Leguin")


def test_details_are_folded_until_they_are_asked_for(launch, open_page):
    page = opened(open_page, launch())
    step(page, 1)
    panel = page.get_by_test_id("panel-Butler")
    expect(panel.get_by_test_id("face")).to_be_visible()
    expect(panel).to_contain_text("why")
    expect(panel).not_to_contain_text("controllability")

    panel.locator("summary", has_text="Emotion").click()
    expect(panel.locator("tr", has_text="controllability")).to_be_visible()
    step(page, 2)
    expect(panel.locator("tr", has_text="controllability")).to_be_visible()
    expect(page.get_by_test_id("panel-Leguin")).not_to_contain_text("controllability")
    panel.locator("summary", has_text="Emotion").click()
    expect(panel).not_to_contain_text("controllability")


def test_the_third_panel_is_seen_on_a_small_laptop(launch, open_page, screenshots):
    page = opened(open_page, launch(**THREE), width=1280, height=720)
    step(page, 1)
    for name in THREE["robots"]:
        panel = page.get_by_test_id(f"panel-{name}")
        for part in (panel.get_by_test_id("face"), panel.locator(".badge").nth(1), panel.locator(".text p").first):
            expect(part).to_be_in_viewport(ratio=1)
    page.screenshot(path=screenshots / "three-1280x720.png")


@pytest.mark.parametrize("width, height", [(1280, 720), (390, 844)])
def test_all_of_a_why_can_be_read(launch, open_page, width, height):
    run = launch(**THREE)
    page = opened(open_page, run, width=width, height=height)
    step(page, 1)
    text = page.get_by_test_id("panel-Vonda").locator(".text p").first
    for words in (40, 300):
        why = " ".join(f"reason{number}" for number in range(words))
        run.put_panel("Vonda", [{"widget": "text", "label": "why", "text": why}])
        expect(text).to_have_text(f"At 0.0 s, when this began: {why}")
        hidden = text.evaluate(
            "(p) => { p.scrollTop = p.scrollHeight; const range = document.createRange();"
            " const texts = [...p.childNodes].filter((node) => node.nodeType === 3 && node.length); const end = texts.at(-1);"
            " range.setStart(end, end.length - 3); range.setEnd(end, end.length);"
            " return range.getBoundingClientRect().bottom - p.getBoundingClientRect().bottom; }"
        )
        assert hidden <= 1, "the last words are below the edge"


@pytest.fixture
def crowd(launch):
    return launch(kind=Crowd, robots=12, guests=20)


def names(page):
    return page.locator(".list-line .full").all_inner_texts()


def test_many_robots_are_a_list_that_is_sorted_and_filtered(crowd, open_page, screenshots):
    page = opened(open_page, crowd)
    step(page, 1)
    refillers = [f"Leguin{number}" for number in range(1, 12)]
    lines = page.get_by_test_id("list-lines").locator("li")
    expect(lines).to_have_count(12)
    expect(page.locator(".panel")).to_have_count(0)
    assert names(page) == ["Butler", *refillers], "numbers count as numbers"

    page.get_by_test_id("sort-name").click()
    expect(page.locator(".list-line .full").first).to_have_text("Leguin11")
    assert names(page) == [*reversed(refillers), "Butler"]
    page.get_by_test_id("sort-behavior").click()
    expect(page.locator(".list-line .full").first).to_have_text("Butler")
    page.get_by_test_id("sort-intensity").click()
    expect(page.get_by_test_id("sort-intensity")).to_have_attribute("aria-pressed", "true")
    strengths = lambda: [float(text) for text in page.locator(".list-line .intensity").all_inner_texts()]
    eventually("the strongest first", lambda: strengths() == sorted(strengths(), reverse=True))

    page.get_by_test_id("list-find").fill("leguin1")
    expect(lines).to_have_count(3)
    expect(page.get_by_test_id("list-count")).to_have_text("3 of 12 robots")
    page.get_by_test_id("list-find").fill("serve")
    expect(lines).to_have_count(1)
    page.get_by_test_id("list-find").fill("")
    emotion = page.get_by_test_id("line-Leguin1").locator(".badge").inner_text()
    page.get_by_test_id("list-emotion").select_option(emotion)
    for badge in page.locator(".list-line .badge").all_inner_texts():
        assert badge == emotion
    page.get_by_test_id("list-emotion").select_option("")
    page.get_by_test_id("list-find").fill("nobody")
    expect(lines).to_have_count(0)
    page.screenshot(path=screenshots / "list-none.png")


def test_one_click_opens_the_panel_of_a_robot_in_the_list(crowd, open_page, screenshots):
    page = opened(open_page, crowd)
    step(page, 1)
    page.get_by_test_id("line-Leguin7").click()
    panel = page.get_by_test_id("panel-Leguin7")
    expect(panel).to_be_in_viewport()
    expect(panel.get_by_test_id("face")).to_be_in_viewport(ratio=1)
    expect(page.get_by_test_id("line-Leguin7")).to_have_attribute("aria-pressed", "true")
    page.screenshot(path=screenshots / "list-open.png")
    page.get_by_test_id("line-Butler").click()
    expect(page.locator(".panel")).to_have_count(1)
    expect(page.get_by_test_id("panel-Butler")).to_be_visible()
    page.get_by_test_id("line-Butler").click()
    expect(page.locator(".panel")).to_have_count(0)


def test_who_is_held_up_comes_first(crowd, open_page):
    page = opened(open_page, crowd)
    step(page, 1)
    page.get_by_test_id("btn-start").click()
    until(page, "window.carsConsole.frame()?.tick > 2")
    crowd.kill("Butler")
    page.get_by_test_id("sort-held").click()
    expect(page.get_by_test_id("line-Butler")).to_contain_text("gone")
    expect(page.locator(".list-line .full").first).to_have_text("Butler")


def test_log_and_set_up_are_near_on_a_phone_with_many_robots(launch, open_page, screenshots):
    run = launch(kind=Crowd, robots=64, guests=50)
    page = opened(open_page, run, width=390, height=844)
    step(page, 1)
    expect(page.get_by_test_id("list-lines").locator("li")).to_have_count(64)
    below = page.get_by_test_id("tab-setup").evaluate("(tab) => tab.getBoundingClientRect().top + window.scrollY")
    page.screenshot(path=screenshots / "phone-64.png", full_page=True)
    assert below < 2.2 * 844, f"the tabs are {below} px down"
    page.get_by_test_id("line-Butler").click()
    expect(page.get_by_test_id("panel-Butler").get_by_test_id("face")).to_be_in_viewport()
    until(page, "document.documentElement.scrollWidth <= window.innerWidth")
