"""The session of a researcher in a notebook: every cell is executed as IPython does it, in the folder where it is started.

    python session.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from IPython.core.interactiveshell import InteractiveShell

CELLS = [
    # Run, frame.
    """
import cars
run = cars.run("hors_doeuvres", seed=8, set={"guests.count": 60})
assert run.verdict == "pass", run
run
""",
    """
states = run.states
annoyed = states[states.emotion == "FRUSTRATED"].groupby("robot").size()
assert annoyed.sum() > 0
run.events.head()
""",
    """
refills = run.commands.query("event == 'command_sent' and command == 'refill'")
assert len(refills) > 3
""",
    # Plot.
    """
import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
figure, axes = plt.subplots()
for name, way in states.groupby("robot"):
    axes.plot(way.x_m, way.y_m, label=name)
axes.legend()
figure.savefig("ways.png")
""",
    "run.diagram(0, '60 s')",
    "run.figures[0]",
    "run.report()",
    # A robot of one's own.
    """
from pathlib import Path
Path("hall.toml").write_text('''
duration = "60 s"
[field]
size = ["10 m", "10 m"]
[guests]
count = 20
[[obstacle]]
at = ["7 m", "5 m"]
[[robot]]
name = "Walker"
at = ["5 m", "5 m"]
''')
""",
    """
from cars import Action, Cars, Point, Robot

class Walker(Robot):
    def init(self, cars: Cars) -> None:
        self.goal = Point(9.0, cars.location.y)

    def tick(self, cars: Cars) -> Action:
        if cars.was_blocked:
            self.goal = Point(10.0 - self.goal.x, self.goal.y)
        mood = "ANNOYED" if cars.was_blocked else "CALM"
        return Action.go(cars, self.goal, 0.5, emotion_state=mood, behavior_state="WALK")

own = cars.run("hall.toml", robots={"Walker": Walker})
assert set(own.states.emotion) == {"CALM", "ANNOYED"}
again = cars.run("hall.toml", robots={"Walker": Walker})
assert own.summary["digest"] == again.summary["digest"]
own
""",
    # An experiment.
    """
experiment = cars.experiment("deadlock", out="deadlock", seeds=2, duration=60)
assert len(experiment.results) == 2 * 5 * 5 and not experiment.failures
experiment.estimates.head()
""",
    "experiment.figures[0]",
    # What goes wrong.
    """
try:
    cars.run("hall.toml")
except cars.Error as error:
    message = str(error)
assert "robot Walker is of class" in message
""",
]
SHOWN = {"run.diagram(0, '60 s')": "image/svg+xml", "run.figures[0]": "text/html", "experiment.figures[0]": "text/html"}


def main() -> None:
    """Executes the cells; fails with the first one that fails."""
    kind: Any = InteractiveShell
    shell = kind.instance()
    for cell in CELLS:
        done = shell.run_cell(cell)
        done.raise_error()
        if done.result is None:
            continue
        shown, _ = shell.display_formatter.format(done.result)
        wanted = SHOWN.get(cell, "text/plain")
        assert shown.get(wanted), (cell, list(shown))
    assert Path("ways.png").stat().st_size > 10_000
    print("done")


if __name__ == "__main__":
    main()
