"""What the plan shows of a robot: its emotion, its initials, its name."""

import re

import pytest
from playwright.sync_api import expect

from lab import FITS, ROOT, Crowd, download, eventually, until

pytestmark = pytest.mark.thorough

PIXEL = """([x, y]) => {
    const canvas = document.querySelector('[data-testid=plan]'), box = canvas.getBoundingClientRect();
    const scale = canvas.width / box.width;
    const copy = new OffscreenCanvas(1, 1).getContext('2d', {willReadFrequently: true});
    copy.drawImage(canvas, -(x - box.left) * scale, -(y - box.top) * scale);
    return [...copy.getImageData(0, 0, 1, 1).data].slice(0, 3);
}"""

# The middle of the ring of a robot, where neither its nose nor its barrier is.
RING = """(name) => {
    const {frame, toClient} = window.carsConsole;
    const {body_m, robots} = frame(), {location, direction_rad} = robots.find((one) => one.name === name);
    const at = toClient(location.x, location.y), scale = toClient(location.x + 1, location.y).x - at.x;
    const far = Math.max(9, body_m * scale / 2) + 2.5;
    return [at.x - Math.cos(direction_rad) * far, at.y + Math.sin(direction_rad) * far];
}"""


def color_of_emotion(name, scheme):
    """As the space-time diagrams and the reports have it."""
    source = (ROOT / "crates/pictures/src/palette.rs").read_text()
    names = re.findall(r'"([A-Z]+)"', source.split("EMOTIONS: [&str; 7] = [")[1].split("]")[0])
    shades = re.findall(r'shade\("#(\w+)", "#(\w+)"\)', source.split("EMOTION_SHADES: [Shade; 15] = [")[1])
    color = shades[names.index(name)][0 if scheme == "light" else 1]
    return [int(color[at : at + 2], 16) for at in (0, 2, 4)]


@pytest.mark.parametrize("scheme, width", [("dark", 1440), ("light", 390)])
def test_an_emotion_has_one_color_on_the_plan_and_in_the_panel(launch, open_page, screenshots, scheme, width):
    run = launch(options=("--speed", "20", "--set", "guests.count=20"))
    page = open_page(run.address, width=width, scheme=scheme)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("trails").check()
    for tick in range(1, 13):
        page.get_by_test_id("btn-step").click()
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))

    for robot in page.evaluate("window.carsConsole.frame().robots"):
        wanted = color_of_emotion(robot["emotion_state"], scheme)
        ring = lambda: page.evaluate(PIXEL, page.evaluate(RING, robot["name"]))
        eventually(f"the ring of {robot['name']}", lambda: ring() == wanted)

        badge = page.get_by_test_id(f"panel-{robot['name']}").locator(".badge.state").first
        expect(badge).to_have_text(robot["emotion_state"])
        expect(badge).to_have_css("background-color", f"rgb({', '.join(map(str, wanted))})")
    page.screenshot(path=screenshots / f"emotions-{width}-{scheme}.png")


def test_emotions_of_one_color_are_told_apart_on_the_plan_and_in_badges(launch, open_page):
    """Of 40 emotions some have the same color: their areas are hatched, the rings dashed, and badges have lines."""
    page = open_page(launch().address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    looks = page.evaluate(
        """async () => {
            const [{badgeStyle, stateLook}, draw, {readTheme}] =
                await Promise.all(['palette', 'draw', 'theme'].map((name) => import(`./assets/${name}.js`)));
            return Array.from({length: 32}, (_, i) => `E${i}`).map((name) => {
                const robot = {name: 'Butler', emotion_state: name, presence: 'here'};
                const look = draw.lookOf(robot, {scale: 40}, 0.6, {isLate: false, isChosen: false});
                const canvas = new OffscreenCanvas(60, 60), context = canvas.getContext('2d');
                draw.body({context, theme: readTheme()}, look, 30, 30);
                const pixels = [...context.getImageData(0, 0, 60, 60).data].join();
                return [stateLook('emotion', name).area, pixels, badgeStyle('emotion', name)];
            });
        }"""
    )
    areas, rings, badges = ({look[i] for look in looks} for i in range(3))
    assert (len(areas), len(rings), len(badges)) == (8, 32, 32)


def test_initials_are_unique_and_the_name_is_shown_on_hover(launch, open_page):
    run = launch()
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    expect(page.get_by_test_id("panel-Butler").locator(".initials")).to_have_text("Bu")
    expect(page.get_by_test_id("panel-Leguin").locator(".initials")).to_have_text("Le")

    def labels(*names):
        return page.evaluate(
            "(names) => import('./assets/roster.js').then(({labelsOf}) => Object.fromEntries(labelsOf(names)))", list(names)
        )

    assert labels("Bea", "Butler", "Leguin") == {"Bea": "Be", "Butler": "Bu", "Leguin": "Le"}
    assert labels("X", "Xenia", "Xe") == {"X": "X", "Xenia": "Xe", "Xe": "X1"}
    assert labels("Waiter1", "Waiter2", "Waiter12") == {"Waiter1": "W1", "Waiter2": "W2", "Waiter12": "W12"}
    many = [a + b + c for a in "ab" for b in "abcd" for c in "abcd"]
    found = labels(*many)
    assert len({label.lower() for label in found.values()}) == len(many)

    until(page, FITS)
    at = page.evaluate(
        "(() => { const {location} = window.carsConsole.frame().robots[0];"
        " return window.carsConsole.toClient(location.x, location.y); })()"
    )
    page.mouse.move(at["x"], at["y"])
    expect(page.get_by_test_id("hover")).to_contain_text("Butler")
    page.mouse.move(at["x"] + 200, at["y"] + 100)
    expect(page.get_by_test_id("hover")).to_be_hidden()


def test_words_of_commands_avoid_each_other(launch, open_page):
    page = open_page(launch().address)
    place = (
        "(commands) => import('./assets/draw.js').then(({freeLine}) => {"
        " const taken = []; return commands.map(([words, x, y]) => freeLine(taken, words, x, y)); })"
    )
    # Six commands to one robot: each has a line of its own, as far as there are lines.
    lines = page.evaluate(place, [["hurry", 100, 100]] * 6)
    found = [line for line in lines if line is not None]
    assert len(found) == 5 and lines[-1] is None
    assert all(abs(a - b) >= 15 for i, a in enumerate(found) for b in found[:i])
    # Far enough from each other they stand where they would alone.
    assert page.evaluate(place, [["hurry", 100, 100], ["refill", 160, 100], ["hurry", 100, 160]]) == [84, 84, 144]

    # They do not cover the letters of robots, unless there are robots wherever words could stand.
    beside = (
        "(robots) => import('./assets/draw.js').then(({freeLine}) =>"
        " freeLine([], 'hurry', 100, 100, robots.map(([x, y]) => ({x, y, width: 34, height: 34}))))"
    )
    assert page.evaluate(beside, [[100, 130]]) == 84
    assert page.evaluate(beside, [[100, 85], [400, 120]]) == 120
    assert page.evaluate(beside, [[100, y] for y in range(40, 160, 10)]) == 84


def test_words_of_commands_and_cuts_are_within_the_plan(launch, open_page):
    page = open_page(launch().address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    words = page.evaluate(
        """async () => {
            const [draw, {Camera}, {readTheme}] = await Promise.all(['draw', 'camera', 'theme'].map((name) => import(`./assets/${name}.js`)));
            const camera = new Camera();
            camera.fit([10, 10], 300, 300);
            const written = [];
            const envelopes = [];
            const calls = {fillText: written, rect: envelopes};
            const context = new Proxy({}, {get: (_, name) => (...all) => void calls[name]?.push(all), set: () => true});
            const flight = {text: 'bring the pencils to the hall', fate: 'sent', progress: 0, faded: 0, isNamed: true};
            const taken = {words: [], robots: []}, pen = {context, camera, theme: readTheme()};
            draw.cut(pen, {x: 0, y: 5}, {x: 1, y: 5}, 'Butler → Leguin', taken.words);
            for (const x of [0, 10]) draw.flight(pen, flight, {x, y: 5}, {x: 5, y: 5}, taken);
            const {words} = structuredClone(taken);
            draw.flight(pen, {...flight, progress: 1}, {x: 0, y: 5}, {x: 9, y: 5}, taken);
            return [written.slice(0, 3), words, envelopes];
        }"""
    )
    written, taken, envelopes = words
    # A command that is at its target does not cover its letters.
    assert envelopes[-1][0] + 9 == pytest.approx(26 + 248 * 0.9 - 30, abs=0.01)
    half = len("bring the pencils to the hall") * 7 / 2
    assert [x for _, x, _ in written[1:]] == [half + 4, 300 - half - 4]
    assert len(taken) == 3 and len({one["y"] for one in taken}) == 3


def test_a_robot_has_the_color_of_its_place_in_the_roster(launch, open_page):
    """The order in which a page happens to ask is of no importance."""
    page = open_page(launch().address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    ask = "(names) => import('./assets/palette.js').then(({robotColor}) => names.map(robotColor))"
    until(page, "window.carsConsole.frame()?.robots.length === 2")
    butler, leguin = page.evaluate(ask, ["Butler", "Leguin"])
    assert butler != leguin

    page.reload()
    until(page, "window.carsConsole.frame() !== null")
    assert page.evaluate(ask, ["Leguin", "Butler"]) == [leguin, butler]


def test_a_face_without_intensity_is_neutral(launch, open_page):
    page = open_page(launch().address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    mouth = (
        "([face, intensity]) => Promise.all([import('./assets/face.js'), import('./assets/vendor/lit-html.js')])"
        ".then(([{drawFace}, {html, render}]) => { const place = document.createElement('div');"
        " render(html`<svg>${drawFace(face, intensity)}</svg>`, place); return place.querySelector('.mouth').getAttribute('d'); })"
    )
    neutral = page.evaluate(mouth, ["neutral", 0])
    assert page.evaluate(mouth, ["happy", 0]) == neutral
    assert page.evaluate(mouth, ["happy", 0.1]) != neutral


def test_guests_who_ask_in_vain_are_seen_on_the_plan_and_in_its_picture(launch, open_page, tmp_path, screenshots):
    options = ("--set", 'guests.requests={ range = "60 ft", patience = "1 s" }', "--set", "robot.Butler.params.treat_capacity=1")
    run = launch(options=options)
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    assert page.locator("#waiting-guests").is_hidden()

    run.control("step", "40")
    expect(page.get_by_test_id("tick")).to_have_text("40")
    moods = page.evaluate("window.carsConsole.frame().guest_moods")
    assert moods["waiting"] and moods["annoyed"], moods
    assert not set(moods["waiting"]) & set(moods["annoyed"])
    told = {event["guest"]: event["mood"] for event in run.events() if event["event"] == "guest"}
    shown = {guest: mood for mood, guests in moods.items() for guest in guests}
    assert shown == {guest: mood for guest, mood in told.items() if mood != "content"}

    expect(page.locator("#waiting-guests")).to_be_visible()
    expect(page.locator("#annoyed-guests")).to_be_visible()
    picture = tmp_path / "plan.svg"
    download(page, "vector", picture)
    assert "annoyed guest" in picture.read_text()
    page.screenshot(path=screenshots / "guest-moods.png")


@pytest.mark.parametrize("guests, step", [(20_000, 1), (20_001, 2), (1_000_000, 50)])
def test_the_legend_says_which_share_of_very_many_guests_is_shown(launch, open_page, guests, step):
    """A frame has at most 20,000 guests, so that it fits into a message."""
    run = launch(kind=Crowd, robots=2, guests=guests)
    page = open_page(run.address)
    until(page, "window.carsConsole.frame() !== null")
    assert page.evaluate("window.carsConsole.frame().guests.length") == -(-guests // step)

    sample = page.get_by_test_id("guest-sample")
    if step == 1:
        expect(sample).to_be_hidden()
    else:
        expect(sample).to_be_visible()
        expect(sample).to_have_text(f"(one in {step} is shown)")
