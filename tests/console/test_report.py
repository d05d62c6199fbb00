"""The report of a run: a file that needs nothing else, and its figures in a paper."""

import re
import subprocess
import zlib

import pytest

from lab import BIN, ROOT

pytestmark = pytest.mark.thorough

SIZES = [(1280, 900, "light"), (375, 812, "dark")]


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


@pytest.mark.parametrize("width, height, scheme", SIZES)
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


TWO_COLUMNS = """<!DOCTYPE html><meta charset="utf-8"><style>
@page { size: A4; margin: 15mm }
body { columns: 2; column-gap: 4mm; margin: 0; font: 9pt/1.3 serif; width: 180mm }
figure { margin: 0 0 3mm; break-inside: avoid }
figure.wide { column-span: all }
img { display: block }
figcaption { font-size: 8pt }
</style><h1 style="column-span: all">A paper</h1>"""


def test_figures_are_placed_in_a_page_of_two_columns(open_page, screenshots, tmp_path):
    folder = tmp_path / "runs"
    # With this seed nothing that is expected is open at the end.
    cars("run", "configs/hors_doeuvres.toml", "--seed", "3", "--run", "hall", "--set", "network.commands.loss=0.3", folder=folder)
    experiment = ("deadlock", "--seeds", "4", "--duration", "120 s", "-o", folder / "experiments" / "deadlock")
    subprocess.run([BIN / "cars", "experiment", "run", *experiment], cwd=ROOT, check=True, capture_output=True)

    html = TWO_COLUMNS
    widths_mm = []
    for subject in ("hall", "deadlock"):
        cars("report", subject, "--figures", tmp_path / subject, folder=folder)
        for file in sorted((tmp_path / subject).glob("*.svg")):
            assert file.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
            width_mm = float(re.search(r'width="([0-9.]+)mm"', file.read_text())[1])
            widths_mm.append(width_mm)
            kind = "wide" if width_mm > 100 else "narrow"
            text = "Words of the paper between its figures. " * 12
            html += f'<figure class="{kind}"><img src="{file.as_uri()}"><figcaption>{file.stem}</figcaption></figure><p>{text}</p>'
    paper = tmp_path / "paper.html"
    paper.write_text(html)
    assert {88.0, 180.0} == set(widths_mm)

    page = open_page(paper.as_uri(), offline=True)
    page.emulate_media(media="print")
    size = "image => [image.complete && image.naturalWidth > 0, image.getBoundingClientRect().width * 25.4 / 96]"
    images = page.locator("img").evaluate_all(f"images => images.map({size})")
    assert all(loaded for loaded, _ in images)
    for (_, shown_mm), width_mm in zip(images, widths_mm, strict=True):
        assert abs(shown_mm - width_mm) < 0.3

    pdf = page.pdf(path=screenshots / "paper.pdf", prefer_css_page_size=True)
    page.screenshot(path=screenshots / "paper.png", full_page=True)
    drawn = b""
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", pdf, re.DOTALL):
        try:
            drawn += zlib.decompress(stream)
        except zlib.error:
            continue
    # The colors of emotions and of arms are drawn as such, and not as pictures of pixels.
    colors = {
        "".join(f"{round(float(channel) * 255):02x}" for channel in channels)
        for channels in re.findall(rb"([\d.]+) ([\d.]+) ([\d.]+) (?:rg|RG|scn|SCN)\b", drawn)
    }
    assert {"009e73", "f0e442", "d55e00", "4b8efe", "4b34cd"} <= colors
