"""What is expected of a run, while it is in progress."""

import pytest
from playwright.sync_api import expect

pytestmark = pytest.mark.thorough

EXPECTATIONS = """expect=[
    { name = "nobody overlaps", never = { overlap = "any" } },
    { name = "Butler does not serve", never = { robot = "Butler", behavior = "SERVE", for = "2 s" } },
]"""


def test_a_verdict_shows_with_the_tick_that_decides_it(launch, open_page, screenshots):
    run = launch(options=("--set", EXPECTATIONS))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    # One chip, which unfolds by a click and by the keys.
    chip = page.get_by_test_id("verdicts-chip")
    expect(chip).to_have_accessible_name("2 of 2 open")
    expect(chip).to_have_attribute("aria-expanded", "false")
    verdicts = page.get_by_test_id("verdict")
    expect(verdicts.first).to_be_hidden()
    chip.focus()
    page.keyboard.press("Enter")
    expect(chip).to_have_attribute("aria-expanded", "true")
    expect(page.locator(f"#{chip.get_attribute('aria-controls')}")).to_be_visible()
    expect(verdicts).to_have_text(["… open nobody overlaps", "… open Butler does not serve"])

    for tick in range(1, 9):
        page.get_by_test_id("btn-step").click()
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
    # The worst verdict is the first, in the chip and below it.
    expect(verdicts).to_have_text(["✗ fail Butler does not serve", "… open nobody overlaps"])
    expect(chip).to_have_accessible_name("1 of 2 fails, 1 open")
    expect(chip).to_contain_text("✗")
    expect(page.get_by_test_id("log")).to_contain_text("fail: Butler does not serve")
    page.screenshot(path=screenshots / "verdicts-live-1440x900-light.png")

    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("end-run").click()
    expect(page.get_by_test_id("tick")).to_have_text("0")
    expect(verdicts).to_have_text(["… open nobody overlaps", "… open Butler does not serve"])
    chip.click()
    expect(verdicts.first).to_be_hidden()


MANY = "expect=[" + ", ".join(f'{{ name = "expectation {n}, of which the name is long", never = {{ overlap = "any" }} }}' for n in range(12)) + "]"


@pytest.mark.parametrize("size", [(1440, 900), (390, 844)])
def test_a_list_that_is_cut_off_says_how_many_follow(launch, open_page, size):
    page = open_page(launch(options=("--set", MANY)).address, *size)
    expect(page.get_by_test_id("verdicts-chip")).to_have_accessible_name("12 of 12 open")
    page.get_by_test_id("verdicts-chip").click()
    page.get_by_test_id("verdicts").evaluate("(list) => list.scrollTo(0, 0)")
    below = """() => {
        const list = document.querySelector('[data-testid=verdicts]'), {bottom} = list.getBoundingClientRect();
        return [...list.querySelectorAll('[data-testid=verdict]')].filter((one) => one.getBoundingClientRect().bottom > bottom + 1).length;
    }"""
    hidden = page.evaluate(below)
    assert hidden > 0
    more = page.get_by_test_id("verdicts-more")
    expect(more).to_have_text(f"↓ {hidden} more")
    expect(more).to_be_in_viewport()
    page.get_by_test_id("verdicts").evaluate("(list) => list.scrollTo(0, list.scrollHeight)")
    expect(more).to_be_hidden()
    assert page.evaluate(below) == 0


def test_six_expectations_are_seen_at_once(launch, open_page):
    page = open_page(launch().address, 1440, 900)
    chip = page.get_by_test_id("verdicts-chip")
    expect(chip).to_contain_text("6")
    chip.click()
    expect(page.get_by_test_id("verdict")).to_have_count(6)
    for entry in page.get_by_test_id("verdict").all():
        expect(entry).to_be_in_viewport(ratio=1)
    expect(page.get_by_test_id("verdicts-more")).to_be_hidden()
