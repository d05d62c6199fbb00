"""A draft of the set-up: it is called one, is not lost silently, and can be edited by keys."""

import pytest
from playwright.sync_api import expect

from lab import ROOT, download, eventually

pytestmark = pytest.mark.thorough

BODY_M = 0.6096


def set_up(page):
    expect(page.get_by_test_id("phase")).to_have_text("ready", ignore_case=True)
    page.get_by_test_id("tab-setup").click()
    expect(page.get_by_test_id("setup-guests")).to_be_visible()


def guests(page):
    return page.get_by_test_id("setup-guests")


def test_the_plan_says_draft_while_the_set_up_is_not_that_of_the_run(launch, open_page, screenshots):
    run = launch()
    page = open_page(run.address)
    set_up(page)
    draft = page.get_by_test_id("draft")
    expect(draft).to_be_hidden()
    before = guests(page).input_value()
    guests(page).fill("7")
    expect(draft).to_be_visible()
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        for width, height in ((1280, 720), (390, 844)):
            page.set_viewport_size({"width": width, "height": height})
            page.screenshot(path=screenshots / f"draft-{width}-{scheme}.png")
    guests(page).fill(before)
    expect(draft).to_be_hidden()

    guests(page).fill("7")
    page.get_by_test_id("setup-apply").click()
    eventually("the epoch", lambda: run.status()["epoch"] == 2)
    expect(draft).to_be_hidden()


def test_an_edit_while_the_set_up_is_read_is_kept(launch, open_page):
    """The set-up of a new epoch is requested; what is edited before the answer comes is not replaced by it."""
    run = launch()
    held = []
    is_slow = []

    def relay(socket):
        def pass_on(text):
            if is_slow and '"answer":"setup"' in text:
                held.append(lambda: socket.send(text))
            else:
                socket.send(text)

        socket.connect_to_server().on_message(pass_on)

    page = open_page("about:blank")
    page.route_web_socket("**/ws", relay)
    page.goto(run.address)
    set_up(page)
    is_slow.append(True)
    page.get_by_test_id("btn-init").click()
    eventually("the answer", lambda: page.wait_for_timeout(10) or held)
    guests(page).fill("9")
    is_slow.clear()
    for send in held:
        send()
    page.get_by_test_id("btn-start").click()
    page.get_by_test_id("draft-apply").click()
    eventually("the run", lambda: run.status()["epoch"] == 3)
    expect(guests(page)).to_have_value("9")


def test_start_and_init_ask_about_a_draft(launch, open_page):
    run = launch()
    page = open_page(run.address)
    set_up(page)
    before = guests(page).input_value()
    guests(page).fill("7")
    page.get_by_test_id("btn-start").click()
    question = page.get_by_test_id("question")
    expect(question).to_contain_text("not applied")
    page.keyboard.press("Escape")
    expect(question).to_be_hidden()
    assert run.status()["phase"] == "ready"

    # Without them: the form shows what the run has.
    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("draft-discard").click()
    eventually("the epoch", lambda: run.status()["epoch"] == 2 and run.status()["phase"] == "ready")
    expect(guests(page)).to_have_value(before)
    expect(page.get_by_test_id("draft")).to_be_hidden()

    guests(page).fill("9")
    page.get_by_test_id("tab-log").click()
    page.locator("#plan").click(position={"x": 5, "y": 5})
    page.keyboard.press(" ")
    page.get_by_test_id("draft-apply").click()
    eventually("the epoch", lambda: run.status()["epoch"] == 3 and run.status()["phase"] == "running")
    frame = eventually("the frame", lambda: page.evaluate("window.carsConsole.frame()?.epoch === 3 && window.carsConsole.frame()"))
    assert len(frame["guests"]) == 9


def test_two_browsers_do_not_overwrite_each_other_silently(launch, open_page):
    run = launch()
    one = open_page(run.address)
    other = open_page(run.address)
    for page in (one, other):
        set_up(page)
    guests(one).fill("7")
    guests(other).fill("8")
    other.get_by_test_id("setup-apply").click()
    eventually("the epoch", lambda: run.status()["epoch"] == 2 and run.status()["phase"] == "ready")

    overtaken = one.get_by_test_id("setup-overtaken")
    expect(overtaken).to_be_visible()
    expect(guests(one)).to_have_value("7")
    one.get_by_test_id("setup-apply").click()
    expect(one.get_by_test_id("message")).to_contain_text("another set-up has been applied meanwhile")
    assert run.status()["epoch"] == 2
    one.get_by_test_id("setup-take-theirs").click()
    expect(overtaken).to_be_hidden()
    expect(guests(one)).to_have_value("8")

    guests(one).fill("9")
    guests(other).fill("10")
    other.get_by_test_id("setup-apply").click()
    eventually("the epoch", lambda: run.status()["epoch"] == 3 and run.status()["phase"] == "ready")
    expect(overtaken).to_be_visible()
    one.get_by_test_id("setup-keep-mine").click()
    expect(overtaken).to_be_hidden()
    expect(guests(one)).to_have_value("9")
    one.get_by_test_id("setup-apply").click()
    eventually("the epoch", lambda: run.status()["epoch"] == 4)
    # One who has not edited anything sees what was applied.
    expect(guests(other)).to_have_value("9")


def test_the_simulator_refuses_a_set_up_for_an_epoch_that_is_over(launch, open_page):
    run = launch()
    page = open_page(run.address)
    set_up(page)
    guests(page).fill("7")
    # The page hears of the next epoch only after it has been asked for.
    page.evaluate(
        "() => { const send = WebSocket.prototype.send; WebSocket.prototype.send = function (text) {"
        " const message = JSON.parse(text); if (message.control?.do === 'init') message.control.epoch = 99;"
        " return send.call(this, JSON.stringify(message)); }; }"
    )
    page.get_by_test_id("setup-apply").click()
    expect(page.get_by_test_id("message")).to_contain_text("perhaps with another set-up")
    assert run.status()["epoch"] == 1


def test_edits_are_undone_and_done_again(launch, open_page):
    run = launch(options=("--set", "guests.count=3"))
    page = open_page(run.address)
    set_up(page)
    undo, redo = page.get_by_test_id("setup-undo"), page.get_by_test_id("setup-redo")
    expect(undo).to_be_disabled()
    guests(page).fill("7")
    page.get_by_test_id("setup-seed").fill("5")
    undo.click()
    expect(guests(page)).to_have_value("7")
    undo.click()
    expect(guests(page)).to_have_value("3")
    expect(undo).to_be_disabled()
    expect(page.get_by_test_id("draft")).to_be_hidden()
    redo.click()
    expect(guests(page)).to_have_value("7")
    guests(page).focus()
    page.keyboard.press("Control+z")
    expect(guests(page)).to_have_value("3")
    page.keyboard.press("Control+Shift+z")
    expect(guests(page)).to_have_value("7")
    page.get_by_test_id("setup-revert").click()
    expect(guests(page)).to_have_value("3")


def test_obstacles_are_placed_moved_and_removed_by_keys(launch, open_page):
    run = launch(options=("--set", "guests.count=0"))
    page = open_page(run.address)
    set_up(page)
    count, cursor = page.get_by_test_id("setup-obstacles"), page.get_by_test_id("cursor")
    expect(count).to_have_text("1 obstacle")
    page.locator("#plan").focus()
    # Butler stands in the middle, where the cursor appears.
    page.keyboard.press("ArrowLeft")
    expect(cursor).to_contain_text("Butler: M moves it")
    for _ in range(6):
        page.keyboard.press("ArrowLeft")
    expect(cursor).to_contain_text("Enter places")
    page.keyboard.press("Enter")
    expect(count).to_have_text("2 obstacles")
    expect(cursor).to_contain_text("Enter removes")

    page.keyboard.press("m")
    for _ in range(4):
        page.keyboard.press("ArrowUp")
    page.keyboard.press("m")
    expect(count).to_have_text("2 obstacles")
    expect(cursor).to_contain_text("M moves it")
    page.get_by_test_id("setup-apply").click()
    eventually("the epoch", lambda: run.status()["epoch"] == 2)
    placed = eventually(
        "the obstacles",
        lambda: page.evaluate("window.carsConsole.frame()?.epoch === 2 && window.carsConsole.frame().obstacles"),
    )
    assert abs(placed[1][1] - placed[1][0] - 5 * BODY_M) < 0.01, placed

    page.locator("#plan").focus()
    page.keyboard.press("Delete")
    expect(count).to_have_text("1 obstacle")
    page.keyboard.press("Control+z")
    expect(count).to_have_text("2 obstacles")


def test_every_shipped_scenario_of_these_robots_is_loaded(launch, open_page):
    run = launch()
    page = open_page(run.address)
    set_up(page)
    loaded = 1
    for name in ("hors_doeuvres", "partition"):
        page.get_by_test_id("setup-load").set_input_files(ROOT / "configs" / f"{name}.toml")
        loaded += 1
        eventually("the epoch", lambda: run.status()["epoch"] == loaded and run.status()["phase"] == "ready")
        expect(page.get_by_test_id("message")).to_contain_text("is loaded")


def test_what_was_typed_in_feet_is_saved_in_feet(launch, open_page, tmp_path):
    run = launch(options=("--set", "guests.count=0"))
    page = open_page(run.address)
    page.get_by_test_id("units").select_option("ft")
    set_up(page)
    page.get_by_test_id("setup-field-width").fill("61.7")
    page.get_by_test_id("setup-field-height").fill("53")
    page.get_by_test_id("setup-apply").click()
    eventually("the epoch", lambda: run.status()["epoch"] == 2 and run.status()["phase"] == "ready")
    saved = tmp_path / "saved.toml"
    download(page, "setup-save", saved)
    assert '"61.7 ft", "53 ft"' in saved.read_text()

    # It is the same scenario.
    before = (run.run_folder / "scenario.toml").read_text()
    page.get_by_test_id("setup-load").set_input_files(saved)
    eventually("the epoch", lambda: run.status()["epoch"] == 3 and run.status()["phase"] == "ready")
    assert (run.run_folder / "scenario.toml").read_text() == before
