"""How much the page does for a frame. How fast that is depends on the machine: `bench_speed.py` measures it."""

import pytest
from playwright.sync_api import expect

from lab import Crowd, eventually, until

pytestmark = pytest.mark.thorough

ROBOTS = 32

# Counts calls of the canvas by the element that is drawn on, and changes of the document by where they are.
COUNT = """() => {
    const counted = window.counted = {calls: {}, changes: 0};
    for (const name of ['fillText', 'stroke', 'fill', 'drawImage', 'strokeRect', 'clearRect']) {
        const before = CanvasRenderingContext2D.prototype[name];
        CanvasRenderingContext2D.prototype[name] = function (...all) {
            const key = `${this.canvas.id || (this.canvas.closest?.('.chart') ? 'chart' : 'other')} ${name}`;
            counted.calls[key] = (counted.calls[key] ?? 0) + 1;
            return before.apply(this, all);
        };
    }
    new MutationObserver((list) => { counted.changes += list.length; })
        .observe(document.querySelector('#panels'), {subtree: true, childList: true, attributes: true, characterData: true});
}"""


@pytest.fixture
def page(launch, open_page):
    run = launch(kind=Crowd, robots=ROBOTS, guests=100)
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    for tick in (1, 2):
        page.get_by_test_id("btn-step").click()
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
    page.run = run
    return page


def counted(page, act, frames=30):
    """What was counted while `act` was done, and in animation frames after it."""
    page.evaluate("() => { counted.calls = {}; counted.changes = 0; }")
    act()
    page.evaluate(
        "(frames) => new Promise((done) => { const next = () => (frames-- > 0 ? requestAnimationFrame(next) : done());"
        " requestAnimationFrame(next); })",
        frames,
    )
    return page.evaluate("counted.calls"), page.evaluate("counted.changes")


def test_a_robot_is_copied_and_not_drawn_anew(page):
    page.evaluate(COUNT)
    # Every frame is painted: the plan is moved, as a person does.
    touch = "(() => { window.dispatchEvent(new Event('resize')); document.querySelector('#plan').dispatchEvent("
    touch += "new KeyboardEvent('keydown', {key: '0'})); })()"
    page.evaluate(touch)
    counted(page, lambda: None)
    calls, _ = counted(page, lambda: page.evaluate(touch), 4)
    assert calls["plan drawImage"] >= ROBOTS, calls
    paints = calls["plan drawImage"] // (ROBOTS + 1)
    assert calls.get("plan fillText", 0) <= 2 * paints, "initials are not written again"
    assert calls.get("plan strokeRect", 0) == 0, "the field is not drawn again"
    assert calls.get("plan stroke", 0) <= 4 * paints, calls


def test_what_does_not_change_costs_nothing(page):
    page.get_by_test_id("tab-charts").click()
    expect(page.get_by_test_id("chart-variable")).to_be_visible()
    expect(page.locator("#chart canvas")).to_be_visible()
    page.evaluate(COUNT)
    counted(page, lambda: None)

    # The status of a paused run arrives again, and a panel that says what it said before.
    panel = [{"widget": "text", "label": "why", "text": "because"}]
    page.run.put_panel("Leguin3", panel)
    counted(page, lambda: None)

    def again():
        page.run.control("speed", "3")
        page.run.put_panel("Leguin3", panel)
        expect(page.get_by_test_id("speed")).to_have_value("3")

    calls, changes = counted(page, again)
    assert [call for call in calls if call.startswith("chart")] == [], calls
    assert changes == 0, "the panels are as they were"


def test_many_robots_are_a_small_document(page):
    elements = page.evaluate("document.querySelectorAll('#panels *').length")
    assert elements <= 20 * ROBOTS + 60, elements


def test_no_series_of_a_chart_is_left_out(page):
    """64 robots with 20 numbers each, for longer than every sample is kept."""
    kept = page.evaluate(
        """() => import('./assets/history.js').then(({History}) => {
            const history = new History();
            const variables = Object.fromEntries([...Array(20).keys()].map((number) => [`v${number}`, number]));
            const robots = [...Array(64).keys()].map((number) => ({name: `R${number}`, location: {x: 1, y: 1}, emotion_state: 'HAPPY',
                behavior_state: 'WAIT', state_variables: variables}));
            for (let time_s = 0; time_s < 3000; time_s += 1) history.add(time_s, robots);
            const series = [...history.variables.values()].flatMap((one) => [...one.values()]);
            return {series: series.length, times: history.times_s, lengths: [...new Set(series.map((values) => values.length))]};
        })"""
    )
    assert kept["series"] == 64 * 20
    assert kept["lengths"] == [len(kept["times"])]
    assert kept["times"][0] == 0 and kept["times"][-1] >= 2990, "the whole run is kept"


def test_a_person_chooses_the_robots_of_a_chart(page, screenshots):
    page.get_by_test_id("tab-charts").click()
    page.get_by_test_id("chart-variable").select_option("intensity")
    chooser = page.get_by_test_id("chart-robots")
    expect(chooser.locator("summary")).to_have_text(f"8 of {ROBOTS} robots")
    expect(page.locator(".key li")).to_have_count(8)
    expect(page.get_by_test_id("bands").locator(".who")).to_have_count(8)

    chooser.locator("summary").click()
    page.get_by_test_id("chart-none").click()
    expect(chooser.locator("summary")).to_have_text(f"0 of {ROBOTS} robots")
    chooser.locator("label", has_text="Leguin30").click()
    expect(page.locator(".key li")).to_have_count(1)
    expect(page.locator(".key li")).to_contain_text("Leguin30")
    page.screenshot(path=screenshots / "chart-robots.png")
    page.get_by_test_id("chart-all").click()
    expect(page.locator(".key li")).to_have_count(ROBOTS)
    eventually("a chart of all", lambda: page.locator("#chart").get_attribute("aria-label").count("Leguin") == ROBOTS - 1)
    until(page, "document.querySelector('#chart canvas') !== null")


def test_what_nobody_would_see_is_not_painted(page):
    due = page.evaluate(
        """() => Promise.all([import('./assets/plan.js'), import('./assets/store.js'), import('./assets/units.js')])
        .then(([{Plan}, {Store}, {Units}]) => {
            const store = new Store();
            const plan = new Plan(document.createElement('canvas'), store, new Units(), {draft: null}, () => {});
            plan.width_px = plan.height_px = 600;
            const frame = window.carsConsole.frame();
            const moved = (tick, right_m) => ({...frame, tick, speed: 1, guests: frame.guests.map(([x, y]) => [x + right_m, y])});
            const paintsOf = (tick, right_m) => {
                store.show(moved(tick, right_m));
                const start = performance.now();
                Object.assign(plan.motion, {arrivedAt_ms: start, length_ms: 500, isMoving: true});
                let paints = 0;
                for (let now = start; now < start + 600; now += 16) if (plan.isDue(now)) { plan.paint(now); paints += 1; }
                return paints;
            };
            store.show(frame);
            plan.paint(performance.now());
            return [paintsOf(frame.tick + 1, 0.1), paintsOf(frame.tick + 2, 40), plan.isDue(performance.now() + 1000)];
        })"""
    )
    slow, fast, at_rest = due
    assert 2 <= slow <= 10, due
    assert fast >= 30, due
    assert at_rest is False


def test_a_crowd_that_is_written_looks_like_one_that_is_drawn(page):
    found = page.evaluate(
        """async () => {
            const [{Crowd}, draw] = await Promise.all([import('./assets/crowd.js'), import('./assets/draw.js')]);
            const theme = {guest: '#7a9684', guestFill: '#d3e2d8'}, results = [];
            for (const [radius, ratio] of [[0.75, 1], [3.2, 1], [4.9, 1.5], [3, 2]]) {
                const [one, other] = [0, 1].map(() => new OffscreenCanvas(300, 200).getContext('2d', {willReadFrequently: true}));
                for (const context of [one, other]) {
                    context.fillStyle = '#ffffff';
                    context.fillRect(0, 0, 300, 200);
                    context.fillStyle = '#16150f';
                    context.fillRect(100, 50, 40, 40);
                }
                const at = [];
                for (let i = 0; i < 400; i += 1) at.push((i * 37.77) % (300 / ratio), (i * 23.31) % (200 / ratio));
                new Crowd().draw(one, one.getImageData(0, 0, 300, 200), theme, at, radius, ratio);
                other.scale(ratio, ratio);
                draw.guestCircles({context: other, theme}, at, radius);
                const [a, b] = [one, other].map((context) => context.getImageData(0, 0, 300, 200).data);
                const sum = a.reduce((all, value, i) => all + Math.abs(value - b[i]), 0);
                results.push([sum / a.length, b.filter((value, i) => i % 4 === 0 && value === 0x7a).length, a.filter((value, i) => i % 4 === 0 && value === 0x7a).length]);
            }
            return results;
        }"""
    )
    for mean, drawn, written in found:
        assert mean < 3, found
        assert abs(drawn - written) <= 0.25 * drawn + 20, found
