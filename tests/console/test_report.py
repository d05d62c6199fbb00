"""The report of a run: a file that needs nothing else."""

import subprocess

import pytest

from lab import BIN, ROOT

pytestmark = pytest.mark.thorough

SIZES = [(1280, 900), (375, 812)]


def cars(*args, folder):
    subprocess.run([BIN / "cars", *args, "--out", folder], cwd=ROOT, check=True, capture_output=True)


@pytest.fixture(scope="session")
def report(tmp_path_factory):
    """The address of a report of two runs."""
    folder = tmp_path_factory.mktemp("report")
    for seed in ("1", "2"):
        run = ("configs/hors_doeuvres.toml", "--run", f"hall-{seed}", "--seed", seed)
        cars("run", *run, "--set", "network.commands.loss=0.3", folder=folder)
    file = folder / "report.html"
    cars("report", "hall-1", "hall-2", "-o", file, folder=folder)
    return file.as_uri()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width, height", SIZES)
def test_a_report_opens_offline_and_fits(report, open_page, screenshots, width, height, scheme):
    # The page of a context that is offline loads files only.
    page = open_page(report, width, height, scheme, offline=True)
    assert page.evaluate("performance.getEntriesByType('resource').length") == 0
    too_wide = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
    assert too_wide <= 0, f"the page is {too_wide} px wider than the window"

    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert background == {"light": "rgb(255, 255, 255)", "dark": "rgb(27, 29, 32)"}[scheme]
    for chart in page.locator("svg.chart").all():
        assert chart.locator("> title").text_content()
    page.screenshot(path=screenshots / f"report-{width}-{scheme}.png", full_page=True)


def test_a_report_is_printed_light(report, open_page, screenshots):
    page = open_page(report, scheme="dark", offline=True)
    page.emulate_media(media="print", color_scheme="dark")
    ink = page.evaluate("getComputedStyle(document.querySelector('h1')).color")
    assert ink == "rgb(31, 31, 28)"
    page.screenshot(path=screenshots / "report-print.png", full_page=True)


def test_a_link_leads_to_its_section(report, open_page):
    page = open_page(report, offline=True)
    page.locator("nav a", has_text="Transitions").click()
    assert page.evaluate("scrollY") > 500


def test_numbers_are_behind_each_chart_with_numbers(report, open_page):
    page = open_page(report, offline=True)
    page.locator("summary", has_text="Numbers of figure 1").click()
    cell = page.locator("details[open] tbody td").first
    assert cell.is_visible()
