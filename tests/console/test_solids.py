"""Walls, shapes, sizes, rays and fields of view on the plan: live, in the past, in a recording, and in saved pictures."""

import math
import re
import sys

import pytest
from playwright.sync_api import expect

from lab import Launch, download, eventually, scrub, start_console, until

pytestmark = pytest.mark.thorough

RAYS = 24
FIELD_OF_VIEW = 120

PLAN = """<svg xmlns="http://www.w3.org/2000/svg" width="16" height="10" viewBox="0 0 16 10">
  <polyline points="0 4 5 4 5 2.5" fill="none"/>
  <line x1="11" y1="0" x2="11" y2="6"/>
  <circle cx="8" cy="7" r="0.9"/>
  <rect x="12.5" y="1" width="2.5" height="0.6"/>
</svg>
"""
SCENARIO = f"""
seed = 11
tick = "0.5 s"
duration = "60 s"
[field]
size = ["16 m", "10 m"]
body = "0.6 m"
[guests]
count = 12
[floor_plan]
file = "plan.svg"
scale = "1 m"
[[obstacle]]
at = ["14 m", "5 m"]
[[site]]
name = "T"
kind = "task"
at = ["3 m", "8 m"]
range = "1 m"
state = {{ done = false }}
[sensing]
range = "3 m"
field_of_view = "{FIELD_OF_VIEW} deg"
rays = {{ count = {RAYS}, range = "4 m" }}
[[robot]]
name = "Cart"
at = ["8 m", "1.2 m"]
size = ["2 m", "0.8 m"]
[[robot]]
name = "Drum"
at = ["2 m", "2 m"]
radius = "0.8 m"
[[robot]]
name = "Scout"
at = ["6 m", "5 m"]
"""
# It turns every four ticks, and reports the ranges of its rays; only Scout walks.
ROBOT = """
import json, sys
tick = 0
for line in sys.stdin:
    message = json.loads(line)
    if message["type"] == "end":
        break
    if message["type"] == "init":
        name = message["name"]
        ranges = []
    else:
        tick = message["tick"]
        print(json.dumps({"type": "ranges"}), flush=True)
        ranges = json.loads(sys.stdin.readline())["value"]["ranges"]
    here = message["location"]
    walks = name == "Scout" and tick % 4 == 0
    drives = {"velocity": {"linear_mps": -0.3, "angular_radps": 0.2}} if "pose" in message else {}
    done = {"type": "done", **drives, "proposal": {"x": here["x"] + (0.2 if walks else 0), "y": here["y"]}, "emotion_state": "CALM",
        "direction_rad": tick // 4 * 0.9, "speed_mps": 0.4 if walks else 0,
        "state_variables": {f"r{index}": length for index, length in enumerate(ranges)}}
    print(json.dumps(done), flush=True)
"""

# Whether a place of the field has the color of what stands there. Reads what is painted.
IS_SOLID = """async (places) => {
    const {readTheme} = await import('./assets/theme.js');
    const frames = (n) => new Promise((done) => requestAnimationFrame(() => (n ? frames(n - 1).then(done) : done())));
    await frames(2);
    const plan = document.getElementById("plan"), box = plan.getBoundingClientRect(), ratio = plan.width / box.width;
    const copy = new OffscreenCanvas(plan.width, plan.height).getContext("2d", {willReadFrequently: true});
    copy.drawImage(plan, 0, 0);
    const rgb = (color) => {
        const context = new OffscreenCanvas(1, 1).getContext("2d");
        context.fillStyle = color;
        context.fillRect(0, 0, 1, 1);
        return [...context.getImageData(0, 0, 1, 1).data];
    };
    const solid = rgb(readTheme().obstacle);
    return places.map(([x, y]) => {
        const at = window.carsConsole.toClient(x, y);
        const pixel = copy.getImageData(Math.round((at.x - box.x) * ratio), Math.round((at.y - box.y) * ratio), 1, 1).data;
        return solid.every((value, index) => Math.abs(value - pixel[index]) < 24);
    });
}"""
# In the drawing y points down.
SOLID = {
    "a wall": (2.5, 6),
    "its corner": (5, 6),
    "its other part": (5, 7),
    "a wall upright": (11, 7),
    "a disc": (8, 3),
    "the rim of a disc": (8 + 0.8 * math.cos(1), 3 + 0.8 * math.sin(1)),
    "one end of a rectangle": (12.6, 8.7),
    "the other end": (14.9, 8.7),
    "a square": (14.15, 4.85),
}
EMPTY = {
    "beside a wall": (2.5, 6.3),
    "beyond its end": (5, 7.8),
    "the corner of the square around a disc": (8.8, 3.8),
    "above a rectangle": (13.7, 9.2),
    "beside a square": (14.5, 5.5),
}


# A cart drives backward and turns, beside a post that stands: the cart looks the other way than it moves.
GARAGE = f"""
tick = "0.5 s"
duration = "60 s"
[field]
size = ["8 m", "6 m"]
[sensing]
range = "3 m"
field_of_view = "{FIELD_OF_VIEW} deg"
rays = {{ count = {RAYS}, range = "4 m" }}
[[obstacle]]
at = ["6.5 m", "3.4 m"]
[[robot]]
name = "Cart"
at = ["4 m", "3 m"]
size = ["2 m", "0.8 m"]
drive = {{ heading = "20 deg" }}
[[robot]]
name = "Post"
at = ["4.2 m", "1 m"]
radius = "0.2 m"
"""


class Hall(Launch):
    scenario, robots = SCENARIO, ("Cart", "Drum", "Scout")

    def __init__(self, folder, **options):
        (folder / "plan.svg").write_text(PLAN)
        (folder / "hall.toml").write_text(self.scenario)
        self.program = folder / "robot.py"
        self.program.write_text(ROBOT)
        super().__init__(folder, folder / "hall.toml", self.robots, **options)

    def start_robots(self, names):
        return {name: self.start("cars", "exec", "--name", name, "--", sys.executable, self.program) for name in names}

    def step(self, tick):
        self.control("step", str(tick))
        eventually("the step", lambda: (self.settled() or {}).get("tick") == tick)


class Garage(Hall):
    scenario, robots = GARAGE, ("Cart", "Post")


def shown(page, tick):
    expect(page.get_by_test_id("tick")).to_have_text(str(tick))
    until(page, f"window.carsConsole.frame().tick === {tick}")


def draws_all(page):
    places = [*SOLID.values(), *EMPTY.values()]
    found = page.evaluate(IS_SOLID, places)
    # Guests and robots cover what they walk over.
    bodies = page.evaluate("(() => { const {guests, robots} = window.carsConsole.frame();"
                           " return [...guests, ...robots.map(({location}) => [location.x, location.y])]; })()")
    for (name, place), is_solid in zip([*SOLID.items(), *EMPTY.items()], found):
        if min(math.dist(place, body) for body in bodies) > 1:
            assert is_solid == (name in SOLID), name


def reported(page, robot):
    """The ranges that a robot has reported in the tick that is shown, in order."""
    variables = page.evaluate("(name) => window.carsConsole.frame().robots.find((robot) => robot.name === name).state_variables", robot)
    return [variables[f"r{index}"] for index in range(RAYS)]


def measures(page, robot, tick, go):
    """The rays that are shown are those that the robot was told in the tick. One that does not drive has not turned in it."""
    assert tick % 4 != 0
    go(page, tick)
    # Guests are shown in whole millimeters, which is more along a ray that grazes one.
    lengths = page.evaluate("window.carsConsole.rays()")
    assert lengths == pytest.approx(reported(page, robot), abs=0.005), (robot, tick)
    assert min(lengths) < 3.9, "they meet something"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_plan_has_what_the_world_has(launch, open_page, processes, screenshots, tmp_path, scheme):
    run = launch(Hall)
    page = open_page(run.address, scheme=scheme, reduced_motion="reduce")
    shown(page, 0)
    draws_all(page)
    expect(page.get_by_test_id("legend-wall")).to_be_visible()
    expect(page.get_by_test_id("legend-rays")).to_be_hidden()
    assert page.evaluate("window.carsConsole.rays()") == []
    # The set-up shows them, too.
    page.get_by_test_id("tab-setup").click()
    expect(page.locator("#panel-setup")).to_be_visible()
    draws_all(page)
    page.get_by_test_id("tab-log").click()

    run.step(10)
    shown(page, 10)
    draws_all(page)
    choose(page, "Scout")
    expect(page.get_by_test_id("legend-rays")).to_be_visible()
    expect(page.get_by_test_id("legend-view")).to_be_visible()
    page.screenshot(path=screenshots / f"solids-{scheme}.png")

    def step(page, tick):
        if page.evaluate("window.carsConsole.frame().tick") < tick:
            run.control("step", "1")
        shown(page, tick)

    for tick in (10, 11):
        measures(page, "Scout", tick, step)
    step(page, 12)
    choose(page, "Cart")
    measures(page, "Cart", 13, step)
    choose(page, "Drum")
    measures(page, "Drum", 14, step)
    choose(page, "Drum", is_chosen=False)

    def back(page, tick):
        scrub(page, tick)
        shown(page, tick)

    # A console that shows a recording has what is written when it starts: the page has read as much.
    back(page, 9)
    recorded = open_page(start_console(processes, "--recording", run.run_folder), scheme=scheme, reduced_motion="reduce")
    for one in (page, recorded):
        back(one, 5)
        draws_all(one)
        choose(one, "Scout")
        for tick in (5, 7, 9):
            measures(one, "Scout", tick, back)
    saved(recorded, tmp_path)


def choose(page, robot, is_chosen=True):
    page.get_by_test_id(f"panel-{robot}").get_by_text(robot, exact=True).first.click()
    until(page, f"window.carsConsole.rays().length === {RAYS if is_chosen else 0}")


def saved(page, folder):
    """The drawing has the walls, the shapes, and for the chosen robot its rays and its field of view."""
    download(page, "vector", folder / "plan.svg")
    svg = (folder / "plan.svg").read_text()
    for words in ("wall", "field of view of Scout", "rays of Scout"):
        assert f">{words}</text>" in svg, words
    # Two walls in one path, and all rays in another.
    assert re.search(r'd="M[^"M]*L[^"M]*L[^"M]*M[^"M]*L[^"M]*"', svg), "walls"
    assert any(path.count("M") == path.count("L") == RAYS for path in re.findall(r'd="([^"]*)"', svg)), "rays"
    download(page, "picture", folder / "plan.png")
    assert (folder / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_a_robot_that_drives_looks_along_its_heading(launch, open_page, screenshots):
    """Its rays and its rectangle turn with it, also while it drives backward and reports the opposite direction."""
    run = launch(Garage)
    page = open_page(run.address, reduced_motion="reduce")
    shown(page, 0)

    def step(page, tick):
        if page.evaluate("window.carsConsole.frame().tick") < tick:
            run.control("step", "1")
        shown(page, tick)

    turned = []
    for tick in range(1, 7):
        step(page, tick)
        for robot in ("Cart", "Post") if tick != 4 else ():
            choose(page, robot)
            measures(page, robot, tick, step)
        cart = page.evaluate("window.carsConsole.frame().robots[0]")
        turned.append(abs(cart["heading_rad"] - cart["direction_rad"]))
    assert max(turned) > 0.5, "it looks where it moves, which proves nothing"
    choose(page, "Cart")
    page.screenshot(path=screenshots / "driving.png")


def test_a_page_that_comes_later_has_walls_at_once(launch, open_page):
    run = launch(Hall, options=("--speed", "20"))
    early = open_page(run.address)
    shown(early, 0)
    early.get_by_test_id("btn-start").click()
    for _ in range(3):
        page = open_page(run.address)
        until(page, "window.carsConsole.frame()?.tick > 0")
        assert page.evaluate("window.carsConsole.frame().static_world.walls.length") == 2
        page.close()
    draws_all(early)
