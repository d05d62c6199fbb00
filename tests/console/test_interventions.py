"""Experiments by hand in a browser: what is done is seen, can be undone, and is in the record."""

import pytest
from playwright.sync_api import expect

from lab import download, eventually, scrub

pytestmark = pytest.mark.thorough


def open_menu(page):
    expect(page.get_by_test_id("phase")).to_have_text("ready", ignore_case=True)
    page.get_by_test_id("tab-experiment").click()
    expect(page.get_by_test_id("experiment-menu")).to_be_visible()


def step(page, tick):
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text(str(tick))


def kinds(run):
    return [(event["tick"], event["event"]) for event in run.events()]


def test_a_link_is_cut_and_healed(launch, open_page):
    run = launch(options=("--set", "guests.count=0"))
    page = open_page(run.address)
    open_menu(page)
    expect(page.get_by_test_id("do-cut")).to_be_disabled()
    page.get_by_test_id("from-Butler").click()
    page.get_by_test_id("to-Leguin").click()
    page.get_by_test_id("do-cut").click()
    expect(page.get_by_test_id("message")).to_contain_text("with the next tick")
    expect(page.get_by_test_id("effects")).to_be_hidden()

    step(page, 1)
    effects = page.get_by_test_id("effects")
    expect(effects).to_contain_text("Butler – Leguin is cut")
    page.get_by_test_id("do-cut").click()
    expect(page.get_by_test_id("message")).to_contain_text("cut already")

    effects.get_by_test_id("undo-effect").click()
    step(page, 2)
    expect(effects).to_be_hidden()
    assert (1, "link_cut") in kinds(run)
    assert (2, "link_healed") in kinds(run)

    page.get_by_test_id("experiment-one-way").check()
    page.get_by_test_id("do-cut").click()
    step(page, 3)
    expect(effects).to_contain_text("Butler → Leguin is cut")
    # Another browser sees it, too, and can undo it.
    other = open_page(run.address)
    other.get_by_test_id("effects").get_by_test_id("undo-effect").click()
    step(page, 4)
    expect(effects).to_be_hidden()


def test_what_cannot_be_done_is_refused_where_it_was_asked(launch, open_page):
    run = launch(options=("--set", "guests.count=0"))
    page = open_page(run.address)
    open_menu(page)
    page.get_by_test_id("do-hang").click()
    expect(page.get_by_test_id("message")).to_contain_text("no launcher is connected")
    page.get_by_test_id("experiment-path").fill("policy")
    page.get_by_test_id("experiment-value").fill("")
    page.get_by_test_id("do-set").click()
    assert run.status()["tick"] == 0
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("experiment-menu")).to_be_hidden()


def test_a_robot_is_stopped_and_goes_on_and_the_record_says_so(launched, open_page):
    run = launched("--paused", "--set", "on_late=continue", "--set", "deadline=60 s", "--duration", "20 s", "--speed", "max")
    page = open_page(run.address)
    open_menu(page)
    page.get_by_test_id("experiment-robot").select_option("Leguin")

    def hang():
        page.get_by_test_id("do-hang").click()
        message = page.get_by_test_id("message")
        expect(message).not_to_be_empty()
        return "with the next tick" in message.inner_text()

    eventually("the launcher", hang)
    step(page, 1)
    effects = page.get_by_test_id("effects")
    expect(effects).to_contain_text("Leguin is stopped")
    step(page, 2)
    expect(page.get_by_test_id("do-recover")).to_be_visible()
    effects.get_by_role("button", name="Go on").click()
    step(page, 3)
    expect(effects).to_be_hidden()
    page.get_by_test_id("do-restart").click()
    expect(page.get_by_test_id("message")).to_contain_text("with the next tick")
    step(page, 4)
    expect(page.get_by_test_id("panel-Leguin").get_by_test_id("presence")).to_have_text("returned")

    page.get_by_test_id("btn-start").click()
    eventually("the end", lambda: run.status()["phase"] == "ended")
    verified = run.verify()
    assert verified.returncode == 0, verified.stdout + verified.stderr
    assert "the same, 40 ticks to the end" in verified.stdout
    faults = [(event["tick"], event["kind"], event["begins"]) for event in run.events() if event["event"] == "fault"]
    assert faults == [(1, "hang", True), (3, "hang", False), (4, "restart", True), (4, "restart", False)]


def test_the_clock_goes_on_without_a_late_robot_and_waits_again(launched, open_page):
    run = launched("--paused", "--duration", "600 s", "--speed", "10")
    page = open_page(run.address)
    open_menu(page)
    page.get_by_test_id("experiment-robot").select_option("Leguin")

    def hang():
        page.get_by_test_id("do-hang").click()
        expect(page.get_by_test_id("message")).not_to_be_empty()
        return "with the next tick" in page.get_by_test_id("message").inner_text()

    eventually("the launcher", hang)
    page.get_by_test_id("btn-start").click()
    page.get_by_test_id("go-on-Leguin").click()
    effects = page.get_by_test_id("effects")
    expect(effects).to_contain_text("goes on without Leguin")
    eventually("ticks", lambda: run.status()["tick"] > 3)
    effects.get_by_role("button", name="Wait for it").click()
    expect(effects).not_to_contain_text("goes on without Leguin")


@pytest.mark.parametrize("kind, done", [("crash", "Start again"), ("hang", "Go on")])
def test_a_robot_without_which_the_clock_went_on_can_be_let_go_on(launched, open_page, kind, done):
    run = launched("--paused", "--duration", "120 s", "--speed", "5", "--set", "deadline=60 s")
    page = open_page(run.address)
    open_menu(page)
    page.get_by_test_id("experiment-robot").select_option("Leguin")
    # The launcher may not be connected yet: the order waits for it.
    page.get_by_test_id(f"do-{kind}").click()
    expect(page.get_by_test_id("message")).to_contain_text("with the next tick")
    page.get_by_test_id("btn-start").click()
    page.get_by_test_id("go-on-Leguin").click()
    # At once, and not after the deadline.
    eventually("ticks", lambda: run.status()["tick"] > 3, patience_s=10)
    effects = page.get_by_test_id("effects")
    effects.get_by_role("button", name=f"{done}:").click()
    expect(page.get_by_test_id("panel-Leguin").get_by_test_id("presence")).to_have_text("returned")
    expect(effects).not_to_contain_text(done)

    page.get_by_test_id("speed").select_option("max")
    expect(page.get_by_test_id("phase")).to_have_text("ended", ignore_case=True)
    verified = run.verify()
    assert verified.returncode == 0, verified.stdout + verified.stderr
    faults = [(event["kind"], event["begins"]) for event in run.events() if event["event"] == "fault"]
    assert faults == [(kind, True), (kind, False)]


def test_a_robots_menu_opens_on_the_plan_and_by_a_key(launch, open_page, screenshots):
    run = launch(options=("--set", "guests.count=0"))
    for scheme in ("light", "dark"):
        for width, height in ((1280, 720), (390, 844)):
            page = open_page(run.address, width=width, height=height, scheme=scheme)
            expect(page.get_by_test_id("tick")).not_to_have_text("–")
            menu = page.get_by_test_id("experiment-menu")

            # Until all of the page has arrived its parts still move, also between these two lines.
            def click():
                at = page.evaluate(
                    "(() => { const at = window.carsConsole.frame().robots.find(r => r.name === 'Leguin').location;"
                    " return window.carsConsole.toClient(at.x, at.y); })()"
                )
                page.mouse.click(at["x"], at["y"], button="right")
                return menu.is_visible()

            eventually("the menu", click)
            expect(page.get_by_test_id("experiment-robot")).to_have_value("Leguin")
            expect(page.get_by_test_id("from-Leguin")).to_have_attribute("aria-pressed", "true")
            page.get_by_test_id("to-Butler").click()
            page.screenshot(path=screenshots / f"experiment-{width}-{scheme}.png")
            page.keyboard.press("Escape")
            expect(menu).to_be_hidden()
            page.keyboard.press("e")
            expect(menu).to_be_visible()
            overflow = page.evaluate("document.documentElement.scrollWidth > document.documentElement.clientWidth")
            assert not overflow
            page.context.close()


@pytest.mark.parametrize("width, height", [(1440, 900), (820, 1180)])
def test_the_plan_is_seen_and_goes_on_while_one_experiments(launch, open_page, width, height):
    run = launch(options=("--speed", "5", "--set", "guests.count=20"))
    page = open_page(run.address, width=width, height=height)
    open_menu(page)
    page.get_by_test_id("btn-start").click()
    for tab, field in (("experiment", "experiment-path"), ("setup", "setup-seed")):
        page.get_by_test_id(f"tab-{tab}").click()
        page.get_by_test_id(field).fill("77")
        plan = page.locator(".plan").bounding_box()
        form = page.locator(f"#panel-{tab}").bounding_box()
        assert plan["x"] + plan["width"] <= form["x"], (tab, plan, form)
        covering = page.evaluate(
            "(() => { const {left, top, width, height} = document.getElementById('plan').getBoundingClientRect();"
            " return document.elementFromPoint(left + width * 0.7, top + height * 0.7).id; })()"
        )
        assert covering == "plan"
        before = page.evaluate("window.carsConsole.frame().tick")
        eventually("further ticks", lambda: page.evaluate("window.carsConsole.frame().tick") > before + 3)


def test_a_run_by_hand_is_saved_as_a_scenario(launch, open_page, tmp_path):
    run = launch(options=("--set", "guests.count=0"))
    page = open_page(run.address)
    open_menu(page)
    page.get_by_test_id("from-Butler").click()
    page.get_by_test_id("to-Leguin").click()
    page.get_by_test_id("do-lose").click()
    expect(page.get_by_test_id("message")).to_contain_text("with the next tick")
    step(page, 1)
    saved = tmp_path / "saved.toml"
    download(page, "experiment-save", saved)
    assert "[[change]]" in saved.read_text()
    assert "network.lose" in saved.read_text()


def test_the_past_lists_its_own_cuts_and_changes_nothing(launch, open_page):
    run = launch(options=("--set", "guests.count=0"))
    page = open_page(run.address)
    open_menu(page)
    for tick in (1, 2, 3):
        step(page, tick)
    page.get_by_test_id("from-Butler").click()
    page.get_by_test_id("to-Leguin").click()
    page.get_by_test_id("do-cut").click()
    step(page, 4)
    effects = page.get_by_test_id("effects")
    expect(effects).to_contain_text("Butler – Leguin is cut")
    step(page, 5)

    # Before the cut.
    scrub(page, 2)
    expect(page.get_by_test_id("tick")).to_have_text("2")
    expect(effects).to_be_hidden()
    expect(page.get_by_test_id("experiment-past")).to_contain_text("This is the past, at 1.0 s. Only the present can be changed.")
    for control in ("do-cut", "do-heal", "do-hang", "do-set", "from-Butler"):
        expect(page.get_by_test_id(control)).to_be_disabled()

    # After it, where it is listed with its time.
    scrub(page, 4)
    expect(page.get_by_test_id("effects-time")).to_have_text("at 2.0 s:")
    expect(effects).to_contain_text("Butler – Leguin is cut")
    expect(effects.get_by_test_id("undo-effect")).to_be_disabled()

    page.get_by_test_id("experiment-past").get_by_role("button", name="Back to now").click()
    expect(page.get_by_test_id("experiment-past")).to_have_count(0)
    expect(effects.get_by_test_id("undo-effect")).to_be_enabled()
    expect(page.get_by_test_id("do-cut")).to_be_enabled()
