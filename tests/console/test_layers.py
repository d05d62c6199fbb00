"""A layer on the plan: its colors, its past, its legend, and pictures of it."""

import base64

import pytest
from playwright.sync_api import expect

from lab import download, eventually, scrub
from test_plan import PIXEL

pytestmark = pytest.mark.thorough

# What decays loses a quarter in each tick. The peak is in the center of a cell.
LAYERS = (
    'layer=[{ name = "dust", cell = "2 ft", min = 0, decay = 0.5, peaks = [{ at = ["31 ft", "31 ft"], radius = "12 ft", height = 4 }] }, '
    '{ name = "heat", cell = "5 ft", min = 0, max = 3, value = 3 }]'
)
FOOT_M = 0.3048
# The ends of the scale, as the style sheet has them.
ENDS = {"light": ([255, 255, 255], [31, 111, 143]), "dark": ([27, 29, 32], [93, 183, 214])}
# How many pixels of a picture have a color.
COUNT = """([png, color]) => {
    const picture = new Image();
    picture.src = `data:image/png;base64,${png}`;
    return picture.decode().then(() => {
        const {naturalWidth: width, naturalHeight: height} = picture;
        const copy = new OffscreenCanvas(width, height).getContext('2d');
        copy.drawImage(picture, 0, 0);
        const {data} = copy.getImageData(0, 0, width, height);
        let count = 0;
        for (let i = 0; i < data.length; i += 4) count += color.every((value, part) => data[i + part] === value);
        return count;
    });
}"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_layer_is_drawn_as_it_is_in_the_tick_that_is_shown(launch, open_page, screenshots, tmp_path, scheme):
    run = launch(options=("--set", LAYERS, "--set", "guests.count=0"))
    page = open_page(run.address, scheme=scheme)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    least, most = ENDS[scheme]

    def color(x_ft, y_ft):
        return page.evaluate(PIXEL, page.evaluate("([x, y]) => { const at = window.carsConsole.toClient(x, y); return [at.x, at.y]; }", [x_ft * FOOT_M, y_ft * FOOT_M]))

    eventually("the peak", lambda: color(31, 31) == most)
    assert color(47, 7) == least
    between = color(35, 35)
    assert all(min(ends) < part < max(ends) for part, ends in zip(between, zip(least, most)))
    legend = page.get_by_test_id("legend-layer")
    expect(legend.first).to_have_text("dust 04")
    page.screenshot(path=screenshots / f"layer-{scheme}.png")

    for tick in (1, 2):
        page.get_by_test_id("btn-step").click()
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
    eventually("less dust", lambda: color(31, 31) not in (most, least))
    # The scale is still that of the start.
    expect(legend.first).to_have_text("dust 04")
    expect(legend.first).to_have_attribute("title", "now from 0 to 2.25")
    scrub(page, 0)
    eventually("the peak again", lambda: color(31, 31) == most)

    legend.nth(1).click()
    expect(legend.nth(1)).to_have_text("heat 03")
    eventually("the heat", lambda: color(47, 7) == most)
    legend.first.click()
    eventually("the dust", lambda: color(47, 7) == least)

    svg, png = tmp_path / "plan.svg", tmp_path / "plan.png"
    download(page, "vector", svg)
    download(page, "picture", png)
    assert '<image width="25" height="25"' in svg.read_text()
    assert "dust, 0 to 4" in svg.read_text()
    # Pictures are light.
    picture = base64.b64encode(png.read_bytes()).decode()
    assert page.evaluate(COUNT, [picture, ENDS["light"][1]]) > 100
