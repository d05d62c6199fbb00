"""Links, pictures, keys, calm motion, and contrast."""

import base64
import pathlib
import subprocess
import sys
import zlib
from xml.etree import ElementTree

import pytest
from playwright.sync_api import expect

from lab import PATIENCE_S, ROOT, download, eventually, start_console, until

pytestmark = pytest.mark.thorough


@pytest.fixture
def recorded(launch):
    run = launch(options=("--speed", "max", "--duration", "100 s"))
    run.start("cars", "ctl", "start", "--run", run.RUN, "--connect", run.endpoint)
    assert run.simulator.wait(PATIENCE_S) == 0
    return start_console(run.processes, "--recording", run.run_folder)


def test_a_link_leads_to_a_tick_and_a_robot(recorded, open_page):
    page = open_page(recorded)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    home = page.url

    page.goto(f"{home}#tick=150&robot=Butler")
    expect(page.get_by_test_id("tick")).to_have_text("150")
    expect(page.locator(".panel.chosen")).to_have_attribute("data-testid", "panel-Butler")
    page.reload()
    expect(page.get_by_test_id("tick")).to_have_text("150")
    expect(page.locator(".panel.chosen")).to_have_attribute("data-testid", "panel-Butler")

    page.get_by_test_id("step").click()
    expect(page.get_by_test_id("tick")).to_have_text("151")
    page.get_by_test_id("link").click()
    expect(page.get_by_test_id("message")).to_contain_text("link")
    assert page.url == f"{home}#run=console-test&tick=151&robot=Butler"

    page.goto(f"{home}#run=other&tick=20")
    expect(page.get_by_test_id("message")).to_contain_text("other")
    expect(page.get_by_test_id("tick")).to_have_text("151")
    page.goto(f"{home}#tick=9999999")
    expect(page.get_by_test_id("tick")).to_have_text("200")
    for odd in ("tick=-1", "tick=x&robot=Nobody", "%"):
        page.goto(f"{home}#{odd}")
    page.goto(f"{home}#tick=150")
    expect(page.get_by_test_id("tick")).to_have_text("150")


# The color of a pixel of a picture, which is decoded by the browser: its checksums hold.
PIXEL = """([png, x, y]) => {
    const picture = new Image();
    picture.src = `data:image/png;base64,${png}`;
    return picture.decode().then(() => {
        const copy = new OffscreenCanvas(1, 1).getContext('2d');
        copy.drawImage(picture, -x, -y);
        return [...copy.getImageData(0, 0, 1, 1).data].slice(0, 3);
    });
}"""


@pytest.mark.parametrize("scheme, width", [("light", 1440), ("dark", 390)])
def test_the_plan_is_saved_as_a_light_picture_of_a_stated_size(launch, open_page, screenshots, scheme, width):
    page = open_page(launch().address, width=width, scheme=scheme)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    assert "180 mm at 300 dpi" in page.get_by_test_id("picture").get_attribute("title")
    kept = screenshots / f"plan-{width}-{scheme}.png"
    assert download(page, "picture", kept) == "console-test-tick-0.png"
    png = kept.read_bytes()
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    assert int.from_bytes(png[16:20], "big") == round(180 / 25.4 * 300)
    density = png.index(b"pHYs")
    per_meter = int.from_bytes(png[density + 4 : density + 8], "big")
    assert (per_meter, png[density + 12]) == (round(300 / 0.0254), 1)
    assert zlib.crc32(png[density : density + 13]) == int.from_bytes(png[density + 13 : density + 17], "big")
    assert page.evaluate(PIXEL, [base64.b64encode(png).decode(), 4, 4]) == [0xF6, 0xF5, 0xF2]


def test_the_plan_fills_the_screen(launch, open_page):
    page = open_page(launch().address)
    page.get_by_test_id("full-screen").click()
    until(page, "document.fullscreenElement?.classList.contains('plan') ?? false")
    page.get_by_test_id("full-screen").click()
    until(page, "document.fullscreenElement === null")


SVG = "{http://www.w3.org/2000/svg}"

# Colors of a picture and of the canvas at the same places.
SAME = """([text, places]) => new Promise((done, failed) => {
    const picture = new Image();
    picture.onerror = failed;
    picture.onload = () => {
        const plan = document.querySelector('#plan'), box = plan.getBoundingClientRect();
        const [width, height] = text.match(/viewBox="0 0 ([\\d.]+) ([\\d.]+)"/).slice(1).map(Number);
        const [, planHeight] = text.match(/<svg x="0" y="[\\d.]+" width="([\\d.]+)" height="([\\d.]+)"/).slice(1).map(Number);
        const {field_m} = window.carsConsole.frame(), scale = (planHeight - 52) / field_m[1];
        const color = (image, x, y, scale) => {
            const copy = new OffscreenCanvas(1, 1).getContext('2d', {willReadFrequently: true});
            copy.drawImage(image, -Math.round(x * scale), -Math.round(y * scale));
            return [...copy.getImageData(0, 0, 1, 1).data].slice(0, 3);
        };
        done(places.map(([x, y]) => {
            const at = window.carsConsole.toClient(x, y);
            const [left, down] = [26 + x * scale, (height - planHeight) / 2 + 26 + (field_m[1] - y) * scale];
            return [color(plan, at.x - box.left, at.y - box.top, plan.width / box.width), color(picture, left, down, picture.naturalWidth / width)];
        }));
    };
    picture.src = 'data:image/svg+xml;charset=utf-8,' + encodeURIComponent(text);
})"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_plan_is_saved_as_a_drawing(launch, open_page, tmp_path, screenshots, scheme):
    run = launch(options=("--set", "guests.count=30"))
    page = open_page(run.address, scheme=scheme)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    for tick in range(1, 4):
        page.get_by_test_id("btn-step").click()
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
    expect(page.get_by_test_id("panel-Butler").get_by_test_id("face")).to_be_visible()
    until(page, "window.carsConsole.frame()?.tick === 3")

    kept = screenshots / f"plan-{scheme}.svg"
    assert download(page, "vector", kept) == "console-test-tick-3.svg"

    document = ElementTree.parse(kept).getroot()
    words = [text.text for text in document.iter(f"{SVG}text")]
    for word in ("Butler", "Leguin", "Bu", "Le", "SERVE", "guest", "obstacle", "blocked", "command under way", "received", "lost command", "cut off"):
        assert word in words, words
    frame = page.evaluate("window.carsConsole.frame()")
    for word in ("console-test", "1.5 s of 600.0 s, tick 3", f"seed {frame['seed']}", "5 ft", *(robot["emotion_state"] for robot in frame["robots"])):
        assert word in words, (word, words)
    assert document.get("width") == "180mm" and document.get("height").endswith("mm")
    assert len([path for path in document.iter(f"{SVG}g") if path.get("transform")]) == 2, "a face for each robot"

    # In the middle of an obstacle, in a robot, and on a guest the picture is what the canvas shows on a light page. The ring is two pixels wide and
    # smooth at its edges, so where the canvas has its color the picture has nearly that.
    page.emulate_media(color_scheme="light")
    robot = page.evaluate("window.carsConsole.frame().robots[0].location")
    guest = page.evaluate("window.carsConsole.frame().guests[0]")
    places = [[0.45, 0.45], [robot["x"] - 0.25, robot["y"]], guest]
    ring = [[robot["x"] - 0.34 - 0.01 * step, robot["y"]] for step in range(10)]

    def colors(places):
        return page.evaluate(SAME, [kept.read_text(), places])

    def is_like(one, other):
        is_gray = max(one) - min(one) < 60
        return not is_gray and max(abs(a - b) for a, b in zip(one, other, strict=True)) < 90

    eventually("the same colors", lambda: all(one == other for one, other in colors(places)))
    eventually("the color of the emotion", lambda: any(is_like(one, other) for one, other in colors(ring)))


# A plan of its own that shows the page's frame, and a place to which Butler may move.
PLAN = """
    const [{Plan}, {Store}, {Units}, {picture}] =
        await Promise.all(['plan', 'store', 'units', 'picture'].map((name) => import(`./assets/${name}.js`)));
    const frame = window.carsConsole.frame();
    const there = {x: frame.robots[0].location.x + 3, y: frame.robots[0].location.y};
    const begin = () => {
        const store = new Store();
        const plan = new Plan(document.createElement('canvas'), store, new Units(), {draft: null}, () => {});
        store.show(frame);
        plan.paint(performance.now());
        return {store, plan, butler_x: () => plan.motion.robotsNow.get('Butler').x};
    };
"""


def test_pictures_are_of_a_tick_and_not_of_the_way_to_it(launch, open_page):
    page = open_page(launch().address, reduced_motion="no-preference")
    expect(page.get_by_test_id("tick")).to_have_text("0")
    places = page.evaluate(
        f"""async () => {{ {PLAN}
            const {{store, plan, butler_x}} = begin();
            const robots = [{{...frame.robots[0], location: there}}, frame.robots[1]];
            store.show({{...frame, tick: frame.tick + 1, speed: 1, robots}});
            plan.paint(performance.now());
            const onTheWay_x = butler_x();
            picture(plan, new Map());
            return [onTheWay_x < there.x, butler_x() === there.x];
        }}"""
    )
    assert places == [True, True]


def test_foreign_text_in_a_drawing_is_text(launch, open_page):
    page = open_page(launch().address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    text = page.evaluate(
        """() => import('./assets/vector.js').then(({Vector}) => {
            const paper = new Vector();
            paper.fillText('</text><script>1</script>&"\\u0000\\ud800', 1, 2);
            return paper.document(10, 10, '<b>', 10);
        })"""
    )
    document = ElementTree.fromstring(text)
    assert [element.tag for element in document] == [f"{SVG}title", f"{SVG}text"]
    assert document[1].text.startswith("</text><script>1</script>&")


def test_the_picture_of_the_readme_is_drawn_by_this_page(tmp_path):
    def words(text):
        return sorted(element.text or "" for element in ElementTree.fromstring(text).iter(f"{SVG}text"))

    shown = words((ROOT / "docs" / "hall.svg").read_text())
    assert shown.count("CONCERNED") >= 2
    assert {"Butler", "Leguin", "guest", "cut off"} < set(shown)
    command = [sys.executable, pathlib.Path(__file__).parent / "picture.py", "hall"]
    drawn = subprocess.run(command, check=True, capture_output=True, text=True, timeout=4 * PATIENCE_S)
    assert words(drawn.stdout) == shown, "draw it again: the command is in tests/console/picture.py"


def test_the_keys_are_listed(launch, open_page, screenshots):
    run = launch()
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.keyboard.press("?")
    expect(page.get_by_test_id("help")).to_be_visible()
    page.screenshot(path=screenshots / "help.png")
    page.keyboard.press(".")
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("help")).to_be_hidden()
    assert run.status()["tick"] == 0, "keys of the list do not step the run"
    page.keyboard.press(".")
    expect(page.get_by_test_id("tick")).to_have_text("1")


@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
def test_reduced_motion_is_obeyed_on_the_plan(launch, open_page, motion):
    page = open_page(launch().address, reduced_motion=motion)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    moved = page.evaluate(
        f"""async () => {{ {PLAN}
            const {{store, plan, butler_x}} = begin();
            const robots = [{{...frame.robots[0], location: there}}, frame.robots[1]];
            plan.motion.arrivedAt_ms -= 500;
            store.show({{...frame, tick: frame.tick + 1, speed: 1, robots}});
            plan.paint(performance.now());
            return butler_x() === there.x;
        }}"""
    )
    assert moved == (motion == "reduce")


CONTRAST = """() => import('./assets/palette.js').then(() => {
    const bright = (color) => {
        const copy = new OffscreenCanvas(1, 1).getContext('2d');
        copy.fillStyle = color;
        copy.fillRect(0, 0, 1, 1);
        const part = [...copy.getImageData(0, 0, 1, 1).data].slice(0, 3).map((byte) => byte / 255)
            .map((value) => value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
        return 0.2126 * part[0] + 0.7152 * part[1] + 0.0722 * part[2];
    };
    const ratio = (one, other) => {
        const [low, high] = [bright(one), bright(other)].sort((a, b) => a - b);
        return (high + 0.05) / (low + 0.05);
    };
    const found = {};
    const place = document.body.appendChild(document.createElement('div'));
    const text = (classes, outer = '') => {
        place.className = outer;
        const one = place.appendChild(document.createElement('span'));
        one.className = classes;
        const {color, backgroundColor} = getComputedStyle(one);
        found[`${outer} ${classes}`] = [ratio(color, backgroundColor), 4.5];
        one.remove();
    };
    for (const tone of ['good', 'neutral', 'warning', 'bad']) text(`badge ${tone}`);
    for (const phase of ['gathering', 'ready', 'running', 'paused', 'ended']) text(`pill phase-${phase}`);
    text('blocked');
    text('initials');
    text('initials', 'panel gone');
    text('initials', 'panel lost');
    place.remove();

    const fill = (name) => {
        document.body.insertAdjacentHTML('beforeend', `<svg class="cars-diagram"><rect class="${name}"></rect></svg>`);
        const {fill} = getComputedStyle(document.body.lastChild.firstChild);
        document.body.lastChild.remove();
        return fill;
    };
    for (const [kind, count] of [['e', 15], ['b', 14]])
        for (let i = 0; i < count; i += 1)
            found[`band ${kind}${i}`] = [ratio(fill(`${kind}${i}`), fill(`on-${kind}${i}`)), 4.5];

    const style = getComputedStyle(document.documentElement);
    const value = (name) => style.getPropertyValue(name).trim();
    found['initials on the plan'] = [ratio(value('--robot-text'), value('--robot')), 4.5];
    found['initials of an absent robot'] = [ratio(value('--absent'), value('--absent-fill')), 4.5];
    found['muted text'] = [ratio(value('--muted'), value('--surface')), 4.5];
    // Shapes: WCAG 2.2, 1.4.11.
    found.guests = [ratio(value('--guest'), value('--field')), 3];
    found.robots = [ratio(value('--robot'), value('--field')), 3];
    return found;
})"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_contrast_is_enough(launch, open_page, scheme):
    page = open_page(launch().address, scheme=scheme)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    found = page.evaluate(CONTRAST)
    assert len(found) == 4 + 5 + 4 + 29 + 5
    print(scheme, {name: round(ratio, 2) for name, (ratio, _) in found.items()})
    assert [(name, round(ratio, 2)) for name, (ratio, least) in found.items() if ratio < least] == []
