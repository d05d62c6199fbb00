"""What the plan shows of commands, and what the record says that it is to show."""

import pytest

from lab import eventually

# How long the plan shows what became of a command, simulated time.
TOLD_S = 2

# Notes the envelopes that the plan draws, which are of this size.
WATCH = """() => {
    const {rect, save} = CanvasRenderingContext2D.prototype;
    window.envelopes = [];
    // Each painting begins so.
    CanvasRenderingContext2D.prototype.save = function () {
        if (this.canvas.id === "plan") window.envelopes = [];
        return save.call(this);
    };
    CanvasRenderingContext2D.prototype.rect = function (x, y, width, height) {
        if (width === 18 && height === 12) window.envelopes.push([x + 9, y + 6]);
        return rect.call(this, x, y, width, height);
    };
}"""
# Paints the plan anew, and returns the envelopes in it, the commands that it shows, and the tick.
PAINTED = """async () => {
    const frames = (n) => new Promise((done) => requestAnimationFrame(() => (n ? frames(n - 1).then(done) : done())));
    await frames(2);
    document.getElementById("trails").click();
    await frames(1);
    const {flights, frame} = window.carsConsole;
    return {tick: frame().tick, envelopes: window.envelopes.length,
        shown: flights().map(({from, to, fate}) => `${from} ${to} ${fate}`).sort()};
}"""
SAMPLE = """(() => {
    const {flights, frame} = window.carsConsole;
    return {tick: frame().tick, shown: flights().map(({from, to, fate}) => `${from} ${to} ${fate}`).sort()};
})()"""


def shown_by(events, tick, tick_s):
    """What the plan is to show of a tick, by the record: commands under way, and what became of others in the last two seconds."""
    commands = {}
    for event in events:
        if event["tick"] > tick or event["event"] not in ("command_sent", "command_delivered", "command_dropped"):
            continue
        commands[event["from"], event["to"], event["seq"]] = (event["event"].removeprefix("command_"), event["tick"])
    told = (
        f"{sender} {target} {fate}"
        for (sender, target, _), (fate, at) in commands.items()
        if fate == "sent" or (tick - at) * tick_s < TOLD_S
    )
    return sorted(told)


def agree(page, run, tick, tick_s):
    expected = shown_by(run.events(), tick, tick_s)

    def look():
        nonlocal painted
        painted = page.evaluate(PAINTED)
        return painted["tick"] == tick and painted["shown"] == expected

    painted = None
    try:
        eventually("agreement", look, patience_s=6.0)
    except AssertionError:
        pytest.fail(f"tick {tick}: the plan shows {painted}, by the record {expected}")
    # What has been received is under way nowhere.
    assert painted["envelopes"] == sum(not one.endswith("delivered") for one in expected), (tick, painted)
