"""What is expected of a run, while it is in progress."""

import pytest
from playwright.sync_api import expect

pytestmark = pytest.mark.thorough

EXPECTATIONS = """expect=[
    { name = "Butler does not serve", never = { robot = "Butler", behavior = "SERVE", for = "2 s" } },
    { name = "nobody overlaps", never = { overlap = "any" } },
]"""


def test_a_verdict_shows_with_the_tick_that_decides_it(launch, open_page, screenshots):
    run = launch(options=("--set", EXPECTATIONS))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    verdicts = page.get_by_test_id("verdict")
    expect(verdicts).to_have_text(["… open Butler does not serve", "… open nobody overlaps"])

    for tick in range(1, 9):
        page.get_by_test_id("btn-step").click()
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
    expect(verdicts).to_have_text(["✗ fail Butler does not serve", "… open nobody overlaps"])
    expect(page.get_by_test_id("log")).to_contain_text("fail: Butler does not serve")
    page.screenshot(path=screenshots / "verdicts-live-1440x900-light.png")

    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("end-run").click()
    expect(page.get_by_test_id("tick")).to_have_text("0")
    expect(verdicts).to_have_text(["… open Butler does not serve", "… open nobody overlaps"])
