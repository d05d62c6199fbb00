"""Runs and experiments from Python are those of the command line."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from pathlib import Path

import pandas
import polars
import pytest
from lab import PATIENCE_S, ROOT, Lab, environment, eventually

import cars
from cars import _frames

PAPER = ROOT / "configs/hors_doeuvres.toml"
SHORT = {"duration": "60 s"}


@pytest.fixture(scope="module")
def run() -> cars.Run:
    """The experiment of the paper, played once."""
    return cars.run(PAPER, seed=7)


def test_a_run_is_that_of_the_command_line(lab: Lab) -> None:
    settings = {"guests.count": 50, "robot.Leguin.params.affect": "off", "expect": []}
    run = cars.run(PAPER, seed=7, set=settings, name="own", out=lab.folder, duration=60)
    sets = ["--set", "guests.count=50", "--set", "robot.Leguin.params.affect=off", "--set", "expect=[]"]
    lab.cars("run", str(PAPER), "-q", "--out", str(lab.folder), "--run", "other", "--seed", "7", "--duration", "60 s", *sets)
    assert lab.events("own") == lab.events("other")
    assert run.folder == lab.folder / "own"
    assert run.summary["digest"] == json.loads((lab.folder / "other/summary.json").read_text())["digest"]
    assert "seed 7: 120 ticks, finished, pass" in repr(run)


def test_settings_are_written_as_toml() -> None:
    from cars._settings import changes

    written = changes({"a": True, "b": 1.5, "c": "1 m", "d": [1, "x"], "e": {"loss": 0.2, "burst": {"enter": 1}}})
    assert written == ["a=true", "b=1.5", "c=1 m", 'd=[1, "x"]', 'e={"loss" = 0.2, "burst" = {"enter" = 1}}']


def explain(run: cars.Run, question: str, jumps: bool = True) -> None:
    """Writes an answer of ``cars why`` about a run."""
    outcomes = {"n": 200, "value": 0.12, "low": 0.08, "high": 0.16}
    cause = {"what": "command 9 was lost", "is_event": True, "without": outcomes}
    jump = {"tick": 60, "before": outcomes, "after": outcomes | {"value": 0.94}, "events": ["one", "two"], "cause": cause}
    other = jump | {"tick": 70, "cause": None, "events": []}
    answer = {
        "digest": run.summary["digest"], "question": {"kind": "measure", "name": question}, "is_share": True, "tick_s": 0.5,
        "last": run.summary["ticks"], "sentence": f"{question} was decided at 30 s.", "jumps": [jump, other] if jumps else [],
        "curve": [{"tick": 0, **outcomes}, {"tick": 60, "n": 1, "value": 1.0, "low": None, "high": None}], "kinds": [], "forks": 9,
    }  # fmt: skip
    folder = run.folder / "why"
    folder.mkdir(exist_ok=True)
    (folder / f"{question}.json").write_text(json.dumps(answer))


@pytest.mark.parametrize("kind", ["pandas", "polars"])
def test_what_decided_a_run_is_a_sentence_and_frames(kind: str) -> None:
    run = cars.run(PAPER, seed=7, duration=60)
    with pytest.raises(cars.Error, match="cars why"):
        run.why()
    explain(run, "waited")
    why = run.why()
    assert str(why) == why.sentence == "waited was decided at 30 s." and "waited" in repr(why)
    curve, jumps = why.frames(kind)
    assert list(curve.columns) == ["tick", "time_s", "value", "low", "high", "n", "failed"]
    assert list(curve["time_s"]) == [0.0, 30.0] and list(curve["value"]) == [0.12, 1.0]
    assert list(jumps["after_value"]) == [0.94, 0.94]
    assert [cause if isinstance(cause, str) else None for cause in jumps["cause"]] == ["command 9 was lost", None]
    assert list(jumps["events"]) == ["one; two", ""] and len(why.jumps) == 2

    explain(run, "served", jumps=False)
    with pytest.raises(cars.Error, match="'served', 'waited'"):
        run.why()
    without = run.why("served").frames(kind).jumps
    assert len(without) == 0 and "before_low" in without.columns
    with pytest.raises(cars.Error, match="those that were asked: 'served'"):
        run.why("walked")
    with pytest.raises(TypeError, match="question"):
        run.why(3)  # type: ignore[arg-type]

    (run.folder / "why/waited.json").write_text("{")
    with pytest.warns(UserWarning, match="waited.json cannot be shown"):
        assert run.why().question == "served"


@pytest.mark.parametrize("kind", ["pandas", "polars"])
def test_frames_are_the_tables_of_the_export(run: cars.Run, lab: Lab, kind: str) -> None:
    lab.cars("export", str(run.folder), "--csv", "-o", str(lab.folder / "tables"))
    page = (ROOT / "docs/exports.md").read_text()
    types = {"integer": polars.Int64, "real": polars.Float64, "flag": polars.Boolean, "text": polars.String}
    frames = run.frames(kind)
    for name, frame in zip(frames._fields, frames):
        section = page.split(f"### {name}\n")[1].split("\n##")[0]
        own = dict(re.findall(r"^\| `(\w+)` \| (\w+) \|", section, re.MULTILINE))
        columns = {"epoch": "integer", "tick": "integer", "time_s": "real"} | own
        schema = {column: types[of] for column, of in columns.items()}
        exported = polars.read_csv(lab.folder / "tables" / f"{name}.csv", schema=schema)
        if kind == "pandas":
            assert isinstance(frame, pandas.DataFrame)
            frame = polars.from_pandas(frame)
        assert len(exported) > 1000 and frame.cast(exported.schema).equals(exported), name


def test_the_frames_of_a_notebook(run: cars.Run) -> None:
    assert run.events is run.events, "a table is read once"
    assert set(run.states.robot) == {"Butler", "Leguin"}
    commands = run.commands
    assert set(commands.command) >= {"refill"} and "state_after" not in commands.columns
    sent = commands[commands.event == "command_sent"]
    assert len(sent) == sum(sum(robot["sent"].values()) for robot in run.summary["robots"].values()) > 0


def test_frames_say_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    there = {"pandas": True, "pyarrow": True, "polars": True}
    monkeypatch.setattr(_frames, "find_spec", lambda name: there[name] or None)
    assert _frames.chosen(None) == "pandas" and _frames.chosen("polars") == "polars"
    there["pyarrow"] = False
    assert _frames.chosen(None) == "polars"
    with pytest.raises(cars.Error, match=r"frames need pandas with pyarrow: pip install 'cars-simulator\[pandas\]'"):
        _frames.chosen("pandas")
    there["polars"] = False
    with pytest.raises(cars.Error, match="frames need pandas with pyarrow, or polars"):
        _frames.chosen(None)
    with pytest.raises(ValueError, match="not of 'arrow'"):
        _frames.chosen("arrow")


def attributes_of_frame(markup: str) -> dict[str, str | None]:
    """The attributes of the one element, as a browser reads them."""
    found: list[dict[str, str | None]] = []

    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            found.append({"tag": tag, **dict(attrs)})

    Reader().feed(markup)
    assert [frame["tag"] for frame in found] == ["iframe"]
    return found[0]


def test_pictures_are_those_of_the_command_line(run: cars.Run, lab: Lab) -> None:
    drawn = run.diagram("10 s", 200, queries=True)
    svg = lab.cars("diagram", str(run.folder), "--from", "10 s", "--to", "200", "--queries")
    assert str(drawn) == drawn._repr_svg_() == svg
    report = run.report()
    assert str(report) == lab.cars("report", str(run.folder))
    report.save(lab.folder / "report.html")
    assert (lab.folder / "report.html").read_text() == str(report)

    assert attributes_of_frame(report._repr_html_())["srcdoc"] == str(report)
    count = str(report).count("<figcaption><b>Figure ")
    assert len(run.figures) == count > 3
    for figure in run.figures:
        page = ET.fromstring(str(figure).partition("\n")[2])
        assert len(page.findall(".//figure")) == 1 and page.findall(".//style")


def test_a_folder_that_another_run_has_taken_is_not_read(tmp_path: Path) -> None:
    first = cars.run(PAPER, seed=1, out=tmp_path, duration=5)
    second = cars.run(PAPER, seed=2, out=tmp_path, duration=5)
    assert second.folder.name == f"{first.folder.name}-2"
    assert len(first.states) == len(second.states) > 0

    first = cars.run(PAPER, seed=1, out=tmp_path, duration=5)
    third = cars.run(PAPER, seed=2, out=tmp_path, duration=5, name=first.folder.name, replace=True)
    assert third.folder == first.folder
    with pytest.raises(cars.Error, match="holds another run now"):
        first.frames()


def test_runs_without_a_folder_do_not_disturb_each_other(tmp_path: Path) -> None:
    first, second = (cars.run(PAPER, seed=seed, duration=5) for seed in (1, 2))
    assert set(first.events.seed.dropna()) == {1} and set(second.events.seed.dropna()) == {2}
    folder = first.folder
    del first
    assert not folder.exists() and second.folder.exists()


def test_a_recorded_run_is_found(lab: Lab) -> None:
    made = cars.run(PAPER, name="made", out=lab.folder, duration=5)
    for found in (cars.load("made", out=lab.folder), cars.load(made.folder), cars.load(out=lab.folder)):
        assert found.summary == made.summary and len(found.states) == len(made.states)
    with pytest.raises(cars.Error, match="there is no run other"):
        cars.load("other", out=lab.folder)


@pytest.mark.parametrize(
    ("text", "options", "settings"),
    [
        ('duration = "soon"\n', [], {}),
        ('duration = "5 s"\nnonsense = 1\n', [], {}),
        (None, [], {}),
        ('duration = "5 s"\n[[robot]]\nname = "Wall"\nat = ["1 m", "1 m"]\n', [], {}),
        ('duration = "5 s"\n', ["--set", "guests.count=many"], {"guests.count": "many"}),
        ('duration = "5 s"\n', ["--set", "no.such.key=1"], {"no.such.key": 1}),
    ],
)
def test_errors_have_the_text_of_the_command_line(
    lab: Lab, text: str | None, options: list[str], settings: dict[str, object]
) -> None:
    file = lab.folder / "wrong.toml"
    if text is not None:
        file.write_text(text)
    with pytest.raises(cars.Error) as raised:
        cars.run(file, set=settings)
    command = [str(lab.programs / "cars"), "run", str(file), "--out", str(lab.folder), *options]
    printed = subprocess.run(command, capture_output=True, text=True, env=environment(), check=False)
    assert printed.returncode == 1
    assert printed.stderr.strip() == f"Error: {raised.value}".strip()
    if text is not None and "nonsense" in text:
        assert "wrong.toml:2" in str(raised.value) and "\x1b" not in str(raised.value)


def test_errors_can_be_told_apart(lab: Lab) -> None:
    wrong = lab.folder / "wrong.toml"
    wrong.write_text('duration = "soon"\n')
    with pytest.raises(cars.FileError, match="wrong.toml:1"):
        cars.run(wrong)
    with pytest.raises(cars.RecordError, match="there is no run other"):
        cars.load("other", out=lab.folder)
    with pytest.raises(cars.RefusedError, match="a robot of another kind runs as a process of its own"):
        cars.run(PAPER, set={"robot.Leguin.class": "Rosie"}, duration=5)
    with pytest.raises(cars.RobotError, match="parameters of Leguin"):
        cars.run(PAPER, set={"robot.Leguin.params.affect": "perhaps"}, duration=5)

    damaged = cars.run(PAPER, name="damaged", out=lab.folder, duration=5)
    (damaged.folder / "events.jsonl").write_text("no event\n")
    with pytest.raises(cars.RecordError, match="events.jsonl, line 1"):
        cars.load("damaged", out=lab.folder).report()


LONG = """
import sys, time
import cars

print("begins", flush=True)
begun = time.monotonic()
try:
    {call}
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.parametrize(
    "call",
    [
        f"cars.run({str(PAPER)!r}, out=sys.argv[1], duration='1000000 s')",
        f"cars.run({str(PAPER)!r}, out=sys.argv[1], speed=0.001)",
        f"cars.run({str(PAPER)!r}, out=sys.argv[1], robots={{'Leguin': Endless}})",
        "cars.experiment('deadlock', out=sys.argv[1], seeds=1000)",
    ],
)
def test_control_c_interrupts(tmp_path: Path, call: str) -> None:
    endless = "class Endless(cars.Robot):\n    def tick(self, cars):\n        while True: pass\n\n"
    script = LONG.format(call=call).replace("import cars\n", f"import cars\n\n{endless}")
    process = subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path)], cwd=ROOT, env=environment(), stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "begins\n"
    begins = ("scenario.toml", "first.lock")
    eventually("the run", lambda: any(file.name in begins for file in tmp_path.rglob("*")) or None)
    begun = time.monotonic()
    process.send_signal(signal.SIGINT)
    printed, _ = process.communicate(timeout=PATIENCE_S)
    assert (printed, process.returncode) == ("interrupted\n", 0)
    assert time.monotonic() - begun < 30.0


def test_other_threads_go_on_while_robots_of_rust_run() -> None:
    counted = 0
    is_over = threading.Event()

    def count() -> None:
        nonlocal counted
        while not is_over.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    try:
        before = counted
        run = cars.run(PAPER, duration="2000 s", set={"guests.count": 150})
        between = counted - before
    finally:
        is_over.set()
        thread.join()
    # A thread that has no lock for the time of the run counts to 0 or 1.
    assert between > 10, (between, run.summary["wall"])


EXPERIMENT = f"""
question = "Does she come sooner when she hurries?"
scenario = "{PAPER}"
seeds = 3
duration = "120 s"
baseline = "calm"

[[arm]]
name = "calm"
what = "she does not feel"
set = ["robot.Leguin.params.affect=off"]

[[arm]]
name = "feeling"
what = "she feels"
set = []

[[measure]]
name = "messages"
column = "messages"
summary = "robots.*.sent.*"
contrast = true
"""


def experiment_file(folder: Path) -> Path:
    """An experiment with two arms."""
    file = folder / "hurry.toml"
    file.write_text(EXPERIMENT)
    return file


def test_an_experiment_is_that_of_the_command_line(lab: Lab) -> None:
    file = experiment_file(lab.folder)
    own = cars.experiment(file, out=lab.folder / "own", seeds=4, set={"guests.count": 20})
    options = ["--seeds", "4", "--set", "guests.count=20", "--out", str(lab.folder / "other")]
    lab.cars("experiment", "run", str(file), *options)
    for name in ("results.json", "runs.csv"):
        assert (lab.folder / "own" / name).read_bytes() == (lab.folder / "other" / name).read_bytes(), name

    assert own.results.groupby("arm").seed.apply(list).to_dict() == {"calm": [1, 2, 3, 4], "feeling": [1, 2, 3, 4]}
    assert own.frame("polars").shape == own.results.shape
    assert own.failures == [] and "hurry: 8 units, 0 failed" in repr(own)
    written = json.loads((lab.folder / "other/results.json").read_text())
    assert len(own.estimates) == len(written["estimates"]) == 2
    assert own.contrasts.arm.tolist() == [contrast["arm"] for contrast in written["contrasts"]] == ["feeling"]
    assert re.sub(r"own|other", "", str(own.report()))[:1000] == re.sub(
        r"own|other", "", lab.cars("report", str(lab.folder / "other"))
    )[:1000]
    assert own.figures and all("<svg" in str(figure) for figure in own.figures)


def test_an_experiment_names_what_is_wrong(tmp_path: Path) -> None:
    file = experiment_file(tmp_path)
    with pytest.raises(cars.Error, match="seeds are 2 to 100000 whole numbers"):
        cars.experiment(file, out=tmp_path / "x", seeds=[1, 1])
    file.write_text(EXPERIMENT.replace("baseline", "bassline"))
    with pytest.raises(cars.Error, match="bassline"):
        cars.experiment(file, out=tmp_path / "x")
    with pytest.raises(cars.Error, match="no-such"):
        cars.experiment("no-such", out=tmp_path / "x")


def test_verdicts_of_an_experiment(tmp_path: Path) -> None:
    file = experiment_file(tmp_path)
    expected = '[[expect]]\nname = "nobody speaks"\nnever = { event = "command_sent" }\n'
    file.write_text(EXPERIMENT + expected)
    (verdict,) = cars.experiment(file, out=tmp_path / "x").verdicts
    assert (verdict.expectation, verdict.verdict) == ("nobody speaks", "fail") and len(verdict.failed) > 0
