"""Accessibility: axe, which knows the rules of WCAG, finds nothing on any tab, at the sizes of a phone and of a laptop."""

import os

import pytest
from playwright.sync_api import expect

from lab import PATIENCE_S, ROOT, Crowd, scrub, start_console

pytestmark = pytest.mark.thorough

AXE = ROOT / "crates" / "console" / "check" / "node_modules" / "axe-core" / "axe.min.js"
PHONE = (390, 844)
LAPTOP = (1366, 768)
TABS = ("log", "charts", "setup")
# Levels A and AA of WCAG 2.2, and what is good practice beyond.
RUN = """(options) => axe.run(document, {resultTypes: ['violations'], ...options}).then(({violations}) =>
    violations.map(({id, nodes}) => `${id}: ${nodes.slice(0, 4).map((node) => node.html.slice(0, 160) + ' ' + (node.any[0]?.message ?? '')).join(' | ')}`))"""


@pytest.fixture(scope="module")
def axe():
    if not AXE.exists() and "CI" not in os.environ:
        pytest.skip("needs axe-core: npm --prefix crates/console/check install")
    return AXE.read_text()


def violations(page, axe, what):
    page.evaluate(f"() => {{ {axe} }}")
    found = []
    # Of all rules only that of contrast asks for colors.
    for scheme, options in (("dark", {"runOnly": ["color-contrast"]}), ("light", {})):
        page.emulate_media(color_scheme=scheme)
        # Colors are judged when they have arrived.
        page.evaluate("Promise.allSettled(document.getAnimations().map((one) => one.finished))")
        found += [f"{what}, {scheme}: {one}" for one in page.evaluate(RUN, options)]
    return found


@pytest.mark.parametrize(
    "many, width, height",
    [(True, *PHONE), (False, *LAPTOP)],
)
def test_axe_finds_nothing_in_a_run(launch, open_page, axe, many, width, height):
    run = launch(kind=Crowd, robots=12, guests=20) if many else launch()
    page = open_page(run.address, width, height)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    found = violations(page, axe, "before the first tick")
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("1")
    if many:
        page.get_by_test_id("line-Leguin3").click()
    page.locator(".panel summary").first.click()

    for tab in TABS:
        page.get_by_test_id(f"tab-{tab}").click()
        expect(page.locator(f"#panel-{tab}")).to_be_visible()
        found += violations(page, axe, tab)

    page.get_by_test_id("btn-init").click()
    found += violations(page, axe, "a question")
    page.get_by_test_id("end-run-cancel").click()
    scrub(page, 0)
    expect(page.get_by_test_id("when")).to_contain_text("past: 0.0 s")
    for tab in ("log", "charts"):
        page.get_by_test_id(f"tab-{tab}").click()
        found += violations(page, axe, f"{tab} in the past")
    assert found == []


@pytest.mark.parametrize("many, on_late, presence", [(False, "wait", "gone"), (True, "continue", "lost")])
def test_what_is_told_of_a_robot_that_is_gone_can_be_read(launch, open_page, axe, screenshots, many, on_late, presence):
    options = ("--set", f"on_late={on_late}", "--set", f"deadline={'60' if on_late == 'wait' else '0.5'} s")
    run = launch(kind=Crowd, robots=12, guests=20, options=options) if many else launch(options=options)
    page = open_page(run.address, *LAPTOP)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("1")
    if many:
        page.get_by_test_id("line-Leguin3").click()
    run.kill("refillers" if many else "Leguin")
    page.get_by_test_id("btn-step").click()
    panel = page.locator(f".panel.{presence}").last
    expect(panel).to_be_visible()
    panel.locator("summary", has_text="Details").click()
    found = violations(page, axe, presence)
    page.screenshot(path=screenshots / f"{presence}-{many}.png")
    assert found == []


@pytest.mark.parametrize("width, height", [LAPTOP, PHONE])
def test_axe_finds_nothing_in_a_recording(launch, open_page, axe, width, height):
    run = launch(options=("--speed", "max", "--duration", "50 s"))
    run.control("start")
    assert run.simulator.wait(PATIENCE_S) == 0
    page = open_page(start_console(run.processes, "--recording", run.run_folder), width, height)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    found = []
    for tab in ("log", "charts", "diagram"):
        page.get_by_test_id(f"tab-{tab}").click()
        expect(page.locator(f"#panel-{tab}")).to_be_visible()
        if tab == "diagram":
            expect(page.locator(".diagram svg")).to_be_visible()
        found += violations(page, axe, tab)
    page.get_by_test_id("keys").click()
    found += violations(page, axe, "keys")
    assert found == []
