//! Expectations: how they are read, and when each is decided.

use std::collections::BTreeMap;

use observe::expect::{MAX_EXPECTATIONS, check_all};
use observe::{Expectation, Judgment, Monitor, Monitors, Observation, RobotState, RunSetting};
use protocol::messages::{End, Point, StateVariables, Verdict};
use protocol::{Event, RobotName, Tick};
use serde::{Deserialize, Serialize};

/// Length of a tick, seconds.
const TICK_S: f64 = 0.5;
/// Side of a body, meters.
const BODY_M: f64 = 0.6;

#[derive(Debug, Serialize, Deserialize)]
struct File {
    expect: Vec<Expectation>,
}

fn read(entry: &str) -> Result<Expectation, String> {
    let text = format!("[[expect]]\nname = 'it'\n{entry}");
    let file: Result<File, _> = toml::from_str(&text);
    match file {
        Ok(mut file) => Ok(file.expect.remove(0)),
        Err(error) => Err(error.message().to_owned()),
    }
}

fn name(robot: &str) -> RobotName {
    RobotName::new(robot).unwrap()
}

fn roster() -> Vec<RobotName> {
    vec![name("A"), name("B")]
}

fn setting() -> RunSetting {
    RunSetting {
        tick_s: TICK_S,
        ticks: 1000,
        field_m: [10.0, 10.0],
        body_m: BODY_M,
        inradius_m: BTreeMap::new(),
        radio_range_m: None,
        roster: roster(),
        sites: BTreeMap::new(),
        layers: Vec::new(),
    }
}

/// What a robot reports, for [`Run`].
#[derive(Clone)]
struct Stated {
    location: Point,
    behavior: String,
    variables: StateVariables,
}

/// A run that is observed.
struct Run {
    watch: Monitor,
    tick: Tick,
    robots: BTreeMap<RobotName, Stated>,
}

impl Run {
    fn of(entry: &str) -> Self {
        Self::within(entry, &setting())
    }

    fn within(entry: &str, setting: &RunSetting) -> Self {
        let expectation = read(entry).unwrap();
        expectation.check(setting).unwrap();
        Self {
            watch: Monitor::new(&expectation, setting),
            tick: 0,
            robots: BTreeMap::new(),
        }
    }

    fn robot(&mut self, robot: &str) -> &mut Stated {
        self.robots.entry(name(robot)).or_insert(Stated {
            location: Point::new(0.0, 0.0),
            behavior: "IDLE".to_owned(),
            variables: StateVariables::new(),
        })
    }

    /// The next tick, with these events.
    fn tick(&mut self, events: &[Event]) -> Option<Judgment> {
        let robots = &self.robots;
        let judgment = self.watch.observe(&Observation {
            tick: self.tick,
            tick_s: TICK_S,
            events,
            state: &|robot| {
                robots.get(robot).map(|stated| RobotState {
                    location: stated.location,
                    state_variables: &stated.variables,
                    emotion_state: "HAPPY",
                    behavior_state: &stated.behavior,
                })
            },
            site: &|_| None,
            layer: &|_| None,
        });
        self.tick += 1;
        judgment
    }

    /// Ticks without events, in which nothing is decided, up to this one.
    fn quiet_until(&mut self, tick: Tick) {
        while self.tick < tick {
            assert_eq!(self.tick(&[]), None, "tick {}", self.tick - 1);
        }
    }

    fn verdict(&mut self, events: &[Event]) -> Option<Verdict> {
        self.tick(events).map(|judgment| judgment.verdict)
    }
}

fn say(text: &str) -> Event {
    Event::Say {
        robot: name("A"),
        text: text.to_owned(),
    }
}

fn cut(is_cut: bool) -> Event {
    let (from, to) = (name("A"), name("B"));
    if is_cut {
        Event::LinkCut {
            from,
            to,
            commands: true,
            queries: true,
        }
    } else {
        Event::LinkHealed { from, to }
    }
}

#[test]
fn never_fails_in_the_tick_in_which_it_happens() {
    let mut run = Run::of("never = { event = 'say', text = 'help' }");
    run.quiet_until(4);
    assert_eq!(run.tick(&[say("hello")]), None);
    let judgment = run.tick(&[say("help")]).unwrap();
    assert_eq!(judgment.verdict, Verdict::Fail);
    assert_eq!(judgment.because, "tick 5 (2.5 s): A help");
}

#[test]
fn never_passes_only_if_the_run_went_on_to_its_end() {
    let mut run = Run::of("never = { event = 'say' }");
    run.quiet_until(11);
    for (end, verdict) in [
        (End::Finished, Verdict::Pass),
        (End::Stopped, Verdict::Undecided),
        (End::Aborted, Verdict::Undecided),
    ] {
        assert_eq!(run.watch.end(end).verdict, verdict);
    }
    let judgment = run.watch.end(End::Finished);
    assert_eq!(judgment.because, "it did not happen until tick 10 (5.0 s)");
}

#[test]
fn eventually_counts_up_to_and_including_its_limit() {
    let entry = "eventually = { event = 'say' }\nwithin = '2 s'";

    let mut in_time = Run::of(entry);
    in_time.quiet_until(4);
    assert_eq!(in_time.verdict(&[say("")]), Some(Verdict::Pass));

    let mut late = Run::of(entry);
    late.quiet_until(4);
    let judgment = late.tick(&[]).unwrap();
    assert_eq!(judgment.verdict, Verdict::Fail);
    assert_eq!(
        judgment.because,
        "tick 4 (2.0 s): it has not happened within 2 s"
    );

    let mut ended = Run::of(entry);
    ended.quiet_until(4);
    assert_eq!(ended.watch.end(End::Finished).verdict, Verdict::Undecided);
}

#[test]
fn a_limit_between_two_ticks_is_reached_at_the_earlier_one() {
    let mut run = Run::of("eventually = { event = 'say' }\nwithin = '2.4 s'");
    run.quiet_until(4);
    assert_eq!(run.verdict(&[]), Some(Verdict::Fail));
}

const AFTER_HEALING: &str = "after = { event = 'link_healed' }\neventually = { event = 'say' }\nwithin = '2 s'\nunless = { event \
                             = 'link_cut' }";

#[test]
fn after_counts_from_each_event_and_up_to_its_limit() {
    let mut run = Run::of(AFTER_HEALING);
    run.quiet_until(3);
    assert_eq!(run.tick(&[cut(false)]), None);
    run.quiet_until(7);
    assert_eq!(run.tick(&[say("")]), None, "tick 7 is 2 s after tick 3");
    run.quiet_until(20);
    assert_eq!(run.tick(&[cut(false)]), None);
    run.quiet_until(24);
    let judgment = run.tick(&[]).unwrap();
    assert_eq!(judgment.verdict, Verdict::Fail);
    assert_eq!(
        judgment.because,
        "tick 24 (12.0 s): it has not happened within 2 s after tick 20 (10.0 s): messages from A to B pass again"
    );
}

#[test]
fn further_events_do_not_put_the_limit_off() {
    let mut run = Run::of(AFTER_HEALING);
    for _ in 0..4 {
        assert_eq!(run.tick(&[cut(false), cut(false)]), None);
    }
    assert_eq!(run.verdict(&[cut(false)]), Some(Verdict::Fail));
}

#[test]
fn it_counts_in_the_tick_of_the_event() {
    let mut run = Run::of(AFTER_HEALING);
    assert_eq!(run.tick(&[say(""), cut(false)]), None);
    run.quiet_until(30);
    let judgment = run.watch.end(End::Finished);
    assert_eq!(judgment.verdict, Verdict::Pass);
    assert_eq!(
        judgment.because,
        "it happened each time (1) until tick 29 (14.5 s), at the latest after 0.0 s"
    );
}

#[test]
fn unless_ends_the_wait() {
    let mut run = Run::of(AFTER_HEALING);
    assert_eq!(run.tick(&[cut(false)]), None);
    assert_eq!(run.tick(&[cut(true)]), None);
    run.quiet_until(20);
    // It heals again: the time begins anew.
    assert_eq!(run.tick(&[cut(false)]), None);
    run.quiet_until(24);
    assert_eq!(run.verdict(&[]), Some(Verdict::Fail));
}

#[test]
fn what_is_waited_for_at_the_end_is_undecided() {
    let mut run = Run::of(AFTER_HEALING);
    run.quiet_until(10);
    assert_eq!(run.tick(&[cut(false)]), None);
    run.quiet_until(14);
    let judgment = run.watch.end(End::Finished);
    assert_eq!(judgment.verdict, Verdict::Undecided);
    assert_eq!(
        judgment.because,
        "the run ended at tick 13 (6.5 s), and it had not happened after tick 10 (5.0 s): messages from A to B pass again"
    );
}

const NEVER_UNTIL: &str = "after = { event = 'link_healed' }
                           never = { event = 'say' }
                           until = { event = 'link_cut' }";

#[test]
fn a_watch_begins_after_the_event_and_ends_with_until() {
    let mut run = Run::of(NEVER_UNTIL);
    assert_eq!(run.tick(&[say("")]), None, "no watch yet");
    assert_eq!(
        run.tick(&[cut(false), say("")]),
        None,
        "the tick of the event"
    );
    run.quiet_until(5);
    assert_eq!(
        run.tick(&[cut(true), say("")]),
        None,
        "the tick that ends it"
    );
    assert_eq!(run.tick(&[say("")]), None);
    run.quiet_until(10);
    let passed = run.watch.end(End::Finished);
    assert_eq!(passed.verdict, Verdict::Pass);
    assert_eq!(
        passed.because,
        "it did not happen in any watch (1) until tick 9 (4.5 s)"
    );

    assert_eq!(run.tick(&[cut(false)]), None);
    assert_eq!(
        run.watch.end(End::Finished).verdict,
        Verdict::Pass,
        "an open watch"
    );
    assert_eq!(run.watch.end(End::Stopped).verdict, Verdict::Undecided);
    let failed = run.tick(&[say("")]).unwrap();
    assert_eq!(failed.verdict, Verdict::Fail);
    assert!(
        failed.because.contains("after tick 10"),
        "{}",
        failed.because
    );

    let idle = Run::of(NEVER_UNTIL);
    assert_eq!(idle.watch.end(End::Finished).verdict, Verdict::NotAsked);
}

#[test]
fn a_watch_needs_its_three_parts() {
    for (entry, reason) in [
        (
            "after = { event = 'say' }\nnever = { event = 'say' }",
            "needs what ends it",
        ),
        (
            "never = { event = 'say' }\nuntil = { event = 'say' }",
            "`until` belongs to `after`",
        ),
        (
            "after = { event = 'say' }\neventually = { event = 'say' }\nwithin = '1 s'\nuntil = { event = 'say' }",
            "`until` belongs to `never`",
        ),
        (
            "after = { event = 'say' }\nnever = { event = 'say' }\nuntil = { event = 'say' }\nunless = { event = 'say' }",
            "`unless` belongs to `eventually`",
        ),
    ] {
        let error = read(entry).unwrap_err();
        assert!(error.contains(reason), "{entry}: {error}");
    }
    // It is written as it was read.
    let written = toml::to_string(&File {
        expect: vec![read(NEVER_UNTIL).unwrap()],
    })
    .unwrap();
    let again: File = toml::from_str(&written).unwrap();
    assert_eq!(again.expect[0], read(NEVER_UNTIL).unwrap());
}

/// A goal is reached in the first tick in which its condition holds, and no run fails for it, however it ends.
#[test]
fn a_goal_is_reached_or_not_and_never_fails() {
    let goal = "reach = { event = 'say', text = 'help' }";
    let mut run = Run::of(goal);
    run.quiet_until(4);
    let judgment = run.tick(&[say("help")]).unwrap();
    assert_eq!(judgment.verdict, Verdict::Pass);
    assert!(
        judgment.because.starts_with("tick 4 (2.0 s): "),
        "{judgment:?}"
    );

    let mut missed = Run::of(goal);
    missed.quiet_until(999);
    for end in [End::Finished, End::Stopped, End::Aborted] {
        let judgment = missed.watch.end(end);
        assert_eq!(judgment.verdict, Verdict::Unreached);
        assert_eq!(judgment.verdict.exit_status(), 0);
    }

    // A variable that was never published is named, and the verdict is the same.
    let mut misspelled = Run::of("reach = { robot = 'A', variable = 'tray', above = 0 }");
    misspelled.robot("A");
    misspelled.quiet_until(3);
    let judgment = misspelled.watch.end(End::Finished);
    assert_eq!(judgment.verdict, Verdict::Unreached);
    assert!(judgment.because.contains("tray"), "{judgment:?}");
    assert!(Verdict::Unreached < Verdict::NotAsked && Verdict::Unreached < Verdict::Pass);
}

#[test]
fn a_goal_has_its_condition_alone() {
    let goal = "reach = { event = 'say', text = 'help' }\n";
    for (more, why) in [
        ("within = '5 s'", "`within` belongs to `eventually`"),
        ("after = { event = 'say' }", "`after` belongs to"),
        ("unless = { event = 'say' }", "belongs to"),
        ("until = { event = 'say' }", "belongs to"),
        ("never = { event = 'say' }", "has one of"),
        ("always = { robot = 'A', behavior = 'IDLE' }", "has one of"),
        (
            "eventually = { event = 'say' }\nwithin = '5 s'",
            "has one of",
        ),
    ] {
        let error = read(&format!("{goal}{more}")).unwrap_err();
        assert!(error.contains(why), "{more}: {error}");
    }
    let error = read("reach = { event = 'judged' }").unwrap_err();
    assert!(error.contains("cannot name"), "{error}");
}

#[test]
fn without_any_event_that_it_is_expected_after_it_is_not_asked() {
    let mut run = Run::of(AFTER_HEALING);
    run.quiet_until(10);
    assert_eq!(run.watch.end(End::Stopped).verdict, Verdict::Undecided);
    let judgment = run.watch.end(End::Finished);
    assert_eq!(judgment.verdict, Verdict::NotAsked);
    assert!(
        judgment
            .because
            .contains("nothing that it is expected after")
    );

    // It was asked, and `unless` ended the wait.
    assert_eq!(run.tick(&[cut(false)]), None);
    assert_eq!(run.tick(&[cut(true)]), None);
    let judgment = run.watch.end(End::Finished);
    assert_eq!(judgment.verdict, Verdict::Pass);
    assert!(judgment.because.contains("(1) was ended by `unless`"));
}

#[test]
fn always_is_about_states() {
    let mut run = Run::of("always = { robot = 'A', variable = 'tray', at_least = 1, below = 31 }");
    // Before a robot has reported, nothing is known of it.
    run.quiet_until(2);
    run.robot("A").variables.insert("tray", 30.0.into());
    run.quiet_until(5);
    assert_eq!(run.watch.end(End::Finished).verdict, Verdict::Pass);
    run.robot("A").variables.insert("tray", 31.0.into());
    assert_eq!(run.verdict(&[]), Some(Verdict::Fail));
}

#[test]
fn a_variable_that_is_not_published_leaves_it_undecided() {
    for entry in [
        "always = { robot = 'A', variable = 'trai', above = 0 }",
        "never = { robot = 'A', variable = 'trai', above = 0 }",
        "never = { stalled = { progress = ['A.trai'], for = '60 s' } }",
    ] {
        let mut run = Run::of(entry);
        run.robot("A").variables.insert("tray", 30.0.into());
        run.quiet_until(5);
        let judgment = run.watch.end(End::Finished);
        assert_eq!(judgment.verdict, Verdict::Undecided);
        assert_eq!(judgment.because, "A publishes no number `trai`");
    }
}

#[test]
fn a_state_may_have_to_last() {
    let mut run = Run::of("never = { robot = 'A', behavior = ['SERVE', 'WAIT'], for = '1 s' }");
    run.robot("A");
    run.quiet_until(5);
    run.robot("A").behavior = "SERVE".to_owned();
    run.quiet_until(6);
    run.robot("A").behavior = "WAIT".to_owned();
    run.quiet_until(7);
    let judgment = run.tick(&[]).unwrap();
    assert_eq!(judgment.verdict, Verdict::Fail);
    assert_eq!(
        judgment.because,
        "tick 7 (3.5 s): the behavior of A is WAIT for 1 s, since tick 5 (2.5 s)"
    );
}

#[test]
fn a_state_that_breaks_off_begins_anew() {
    let mut run = Run::of("never = { robot = 'A', behavior = 'SERVE', for = '1 s' }");
    for _ in 0..4 {
        for behavior in ["SERVE", "SERVE", "IDLE"] {
            run.robot("A").behavior = behavior.to_owned();
            assert_eq!(run.tick(&[]), None);
        }
    }
}

#[test]
fn progress_is_a_variable_that_rises() {
    let mut run =
        Run::of("never = { stalled = { progress = ['A.served', 'B.trips'], for = '2 s' } }");
    for robot in ["A", "B"] {
        let variables = &mut run.robot(robot).variables;
        variables.insert("served", 0.0.into());
        variables.insert("trips", 0.0.into());
    }
    run.quiet_until(4);
    run.robot("B").variables.insert("trips", 1.0.into());
    run.quiet_until(7);
    // Falling is no progress.
    run.robot("B").variables.insert("trips", 0.0.into());
    run.quiet_until(8);
    let judgment = run.tick(&[]).unwrap();
    assert_eq!(judgment.verdict, Verdict::Fail);
    assert_eq!(
        judgment.because,
        "tick 8 (4.0 s): no progress (A.served, B.trips) for 2 s, since tick 4 (2.0 s)"
    );
}

#[test]
fn progress_of_a_pattern_is_that_of_any_of_its_robots() {
    let mut run = Run::of("never = { stalled = { progress = ['*.served'], for = '2 s' } }");
    for robot in ["A", "B"] {
        let variables = &mut run.robot(robot).variables;
        variables.insert("served", 0.0.into());
    }
    run.quiet_until(4);
    run.robot("B").variables.insert("served", 1.0.into());
    run.quiet_until(8);
    let judgment = run.tick(&[]).unwrap();
    assert_eq!(
        judgment.because,
        "tick 8 (4.0 s): no progress (*.served) for 2 s, since tick 4 (2.0 s)"
    );
}

/// The simulator refuses moves that overlap another body, so no scenario shows this expectation to fire.
#[test]
fn bodies_that_overlap_are_noticed() {
    for entry in [
        "never = { overlap = 'any' }",
        "never = { overlap = ['B', 'A'] }",
        "never = { overlap = '*' }",
        "never = { overlap = ['B*', 'A'] }",
    ] {
        let mut run = Run::of(entry);
        run.robot("A").location = Point::new(1.0, 1.0);
        run.robot("B").location = Point::new(1.0 + BODY_M, 1.0);
        run.quiet_until(2);
        run.robot("B").location = Point::new(1.1, 1.0 + BODY_M);
        run.quiet_until(4);
        run.robot("B").location = Point::new(0.5, 0.5);
        let judgment = run.tick(&[]).unwrap();
        assert_eq!(judgment.verdict, Verdict::Fail);
        assert_eq!(
            judgment.because,
            "tick 4 (2.0 s): A and B overlap near 0.50 m, 0.50 m"
        );
    }
}

/// A robot with a shape of its own overlaps what the largest disc within it overlaps.
#[test]
fn bodies_overlap_by_their_own_sizes() {
    let setting = RunSetting {
        inradius_m: BTreeMap::from([(name("A"), 0.1), (name("C"), 2.0)]),
        roster: ["A", "B", "C"].map(name).to_vec(),
        ..setting()
    };
    let half_m = BODY_M * 0.5;
    for (one, other, apart_m) in [
        ("A", "B", 0.1 + half_m),
        ("A", "C", 2.1),
        ("B", "C", 2.0 + half_m),
    ] {
        for (away_m, is_overlap) in [(apart_m, false), (apart_m - 1e-6, true)] {
            let mut run = Run::within("never = { overlap = 'any' }", &setting);
            run.robot(one).location = Point::new(1.0, 1.0);
            run.robot(other).location = Point::new(1.0 + 0.6 * away_m, 1.0 - 0.8 * away_m);
            let judgment = run.tick(&[]);
            assert_eq!(
                judgment.is_some(),
                is_overlap,
                "{one} and {other}: {away_m} m"
            );
        }
    }
}

#[test]
fn a_list_of_conditions_holds_if_one_of_them_does() {
    let entry = "after = [{ event = 'link_healed' }, { event = 'link_cut' }]\neventually = [{ event = 'say', text = 'x' }, \
                 { robot = 'A', behavior = 'SERVE' }]\nwithin = '1 s'";
    let mut run = Run::of(entry);
    run.robot("A");
    assert_eq!(run.tick(&[cut(true)]), None);
    assert_eq!(run.tick(&[say("x")]), None);
    assert_eq!(run.tick(&[cut(false)]), None);
    run.robot("A").behavior = "SERVE".to_owned();
    run.quiet_until(9);
    assert_eq!(run.watch.end(End::Finished).verdict, Verdict::Pass);
}

#[test]
fn each_expectation_is_judged_once() {
    let expectations = [
        read("never = { event = 'say' }").unwrap(),
        Expectation {
            name: "other".to_owned(),
            ..read("eventually = { event = 'lost' }\nwithin = '60 s'").unwrap()
        },
    ];
    let mut watches = Monitors::new(&expectations, &setting());
    let mut judged = Vec::new();
    for tick in 0..3 {
        let events = [say("")];
        judged.extend(watches.observe(&Observation {
            tick,
            tick_s: TICK_S,
            events: &events,
            state: &|_| None,
            site: &|_| None,
            layer: &|_| None,
        }));
    }
    judged.extend(watches.end(End::Finished));

    let mut names = Vec::new();
    for event in &judged {
        if let Event::Judged {
            expectation,
            verdict,
            ..
        } = event
        {
            names.push((expectation.as_str(), *verdict));
        }
    }
    assert_eq!(
        names,
        [("it", Verdict::Fail), ("other", Verdict::Undecided)]
    );
    assert_eq!(watches.standings()[1].verdict, Some(Verdict::Undecided));
}

#[test]
fn what_is_written_is_read_back() {
    for entry in [
        "what = 'why'\nnever = { event = 'blocked', by = ['edge', 'guest'] }",
        "always = { robot = 'A', variable = 'tray', at_least = 1.5, at_most = 2, above = 0, below = 3, for = '1 s' }",
        "never = { robot = 'A', emotion = 'ANGRY' }",
        "never = { overlap = 'any' }",
        "never = { overlap = ['A', 'B'] }",
        "never = { stalled = { progress = ['A.served', 'B.trips'], for = '2 min' } }",
        "never = { overlap = 'S*' }",
        "never = { stalled = { progress = ['S{1..20}.served'], for = '2 min' } }",
        "eventually = [{ event = 'say' }, { robot = 'A', behavior = ['X', 'Y'], for = '1 s' }]\nwithin = '1 min'",
        AFTER_HEALING,
        "after = [{ event = 'lost' }, { event = 'missed', robot = 'A' }]\neventually = { event = 'joined' }\nwithin = '0 s'",
    ] {
        let expectation = read(entry).unwrap();
        let text = toml::to_string(&File {
            expect: vec![expectation.clone()],
        });
        let again: File = toml::from_str(&text.unwrap()).unwrap();
        assert_eq!(again.expect, [expectation]);
    }
}

#[test]
fn what_cannot_be_checked_is_refused() {
    for (entry, reason) in [
        ("", "one of `never`, `always`, `eventually` and `reach`"),
        (
            "never = { event = 'say' }\nalways = { robot = 'A', behavior = 'X' }",
            "one of `never`",
        ),
        (
            "eventually = { event = 'say' }",
            "`eventually` needs a time",
        ),
        (
            "never = { event = 'say' }\nwithin = '1 s'",
            "`within` belongs to `eventually`",
        ),
        (
            "after = { event = 'say' }\nnever = { event = 'lost' }",
            "needs what ends it",
        ),
        (
            "eventually = { event = 'say' }\nwithin = '1 s'\nunless = { event = 'lost' }",
            "`unless` belongs to `after`",
        ),
        (
            "eventually = { event = 'say' }\nwithin = '-1 s'",
            "not negative",
        ),
        (
            "eventually = { event = 'say' }\nwithin = 5",
            "a time such as",
        ),
        ("always = { event = 'say' }", "an event happens in one tick"),
        (
            "never = { event = 'tick' }",
            "cannot name the event \"tick\"",
        ),
        (
            "after = { event = 'end' }\neventually = { event = 'say' }\nwithin = '1 s'",
            "cannot name the event \"end\"",
        ),
        ("never = { event = 'sey' }", "there is no event \"sey\""),
        ("never = []", "1 to 64"),
        ("never = 'say'", "a condition is an event"),
        ("never = {}", "a condition is an event"),
        ("never = { robot = 'A' }", "a condition is an event"),
        (
            "never = { robot = 'A', behavior = 'X', variable = 'y', above = 1 }",
            "a condition is an event",
        ),
        (
            "never = { robot = 'A', behaviour = 'X' }",
            "unknown field `behaviour`",
        ),
        (
            "never = { robot = 'A', variable = 'x' }",
            "needs `at_least`",
        ),
        (
            "never = { robot = 'A', variable = 'x', above = inf }",
            "a finite number",
        ),
        (
            "never = { robot = 'A', behavior = 'x', for = '0 s' }",
            "`for` is more than zero",
        ),
        ("never = { overlap = 'A' }", "at least two robots"),
        ("never = { overlap = ['A', 'A'] }", "at least two robots"),
        (
            "never = { stalled = { progress = [], for = '1 s' } }",
            "`progress`",
        ),
        (
            "never = { stalled = { progress = ['A'], for = '1 s' } }",
            "`progress`",
        ),
        (
            "never = { stalled = { progress = ['A.x'] } }",
            "missing field `for`",
        ),
        ("never = { event = 'say', robot = [] }", "name at least one"),
        (
            "never = { robot = 'A', behavior = [] }",
            "`behavior` names at least one",
        ),
        (
            "never = { robot = 'A', emotion = [] }",
            "`emotion` names at least one",
        ),
        (
            "never = { robot = 'A', variable = 'x', at_least = 2, at_most = 1 }",
            "no number is within",
        ),
        (
            "never = { robot = 'A', variable = 'x', above = 1, at_most = 1 }",
            "no number is within",
        ),
        (
            "never = { robot = 'A', variable = 'x', at_least = 1, below = 1 }",
            "no number is within",
        ),
        ("sometimes = 1", "unknown field `sometimes`"),
    ] {
        let error = read(entry).expect_err(entry);
        assert!(error.contains(reason), "{entry}: {error}");
    }
}

#[test]
fn bounds_may_leave_one_number() {
    for bounds in [
        "at_least = 1, at_most = 1",
        "above = 1, below = 2",
        "at_least = 1, below = 2",
    ] {
        let entry = format!("never = {{ robot = 'A', variable = 'x', {bounds} }}");
        assert!(read(&entry).is_ok(), "{bounds}");
    }
}

#[test]
fn names_and_numbers_have_limits() {
    for (length, is_good) in [(0, false), (1, true), (100, true), (101, false)] {
        let name = "é".repeat(length);
        let text = format!("[[expect]]\nname = '{name}'\nnever = {{ event = 'say' }}");
        let file: Result<File, _> = toml::from_str(&text);
        assert_eq!(file.is_ok(), is_good, "{length}");
    }

    let mut expectations = Vec::new();
    for number in 0..MAX_EXPECTATIONS {
        expectations.push(Expectation {
            name: number.to_string(),
            ..read("never = { event = 'say' }").unwrap()
        });
    }
    assert_eq!(check_all(&expectations, &setting()), Ok(()));
    expectations.push(expectations[0].clone());
    let wrong = check_all(&expectations, &setting()).unwrap_err();
    assert_eq!(wrong.index, MAX_EXPECTATIONS);
    assert_eq!(wrong.to_string(), "more than 64 expectations");

    expectations[1] = expectations[0].clone();
    let wrong = check_all(&expectations[..2], &setting()).unwrap_err();
    assert_eq!(wrong.index, 1);
    assert_eq!(wrong.to_string(), "a second expectation called \"0\"");
}

#[test]
fn robots_that_the_run_does_not_have_are_refused() {
    for entry in [
        "never = { event = 'say', robot = 'C' }",
        "never = { robot = 'C', behavior = 'X' }",
        "never = { overlap = ['A', 'C'] }",
        "never = { stalled = { progress = ['A.x', 'C.x'], for = '1 s' } }",
        "after = { event = 'lost', robot = 'C' }\neventually = { event = 'say' }\nwithin = '1 s'",
        "after = { event = 'lost' }\nunless = { event = 'lost', robot = 'C' }\neventually = { event = 'say' }\nwithin = '1 s'",
    ] {
        let error = read(entry).unwrap().check(&setting()).unwrap_err();
        assert_eq!(error.to_string(), "no robot of this scenario is called C");
    }
    let alone = read("never = { overlap = 'A*' }").unwrap();
    let error = alone.check(&setting()).unwrap_err();
    assert!(error.to_string().contains("at least two robots"), "{error}");
    let of_operator = read("never = { event = 'command_sent', from = 'operator' }").unwrap();
    of_operator.check(&setting()).unwrap();
}
