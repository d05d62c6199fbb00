//! Starting over, and repeating oneself.

use std::time::Duration;

use bus::Declared;
use protocol::keys::STATE;
use protocol::messages::{Clock, KnownSite, Point, StreamReseed, TickUpdate, Welcome};
use protocol::{Epoch, RobotName, Tick};
use serde_json::json;

use super::{peers, returns, waiting};
use harness::Joining;
use harness::body::{REFUSED, ROUND};
use harness::comparison::{demand_same, difference};
use harness::findings::Findings;
use harness::kit::{Kit, KitRoster};
use harness::patience::PATIENCE;
use harness::report::RuleFailure;
use harness::script::{
    ArrivingCommand, CUT_OFF, Disturbance, PlayScript, Straight, demand_usual, play, played_among,
    reseeds_at, usual, with_robot,
};
use harness::transcript::PlayedTick;
use harness::{Harness, HarnessOptions};

/// No report comes within this time where it is not the robot's turn.
const QUIET: Duration = Duration::from_millis(300);
/// The tick before which a person asks for its state.
const ASKED: Tick = 2;
/// An epoch that follows the first one, where those between were missed: two bytes of its number are those of the first.
const LATER: Epoch = 1 + (1 << 16);
/// Ticks of an epoch that is to leave nothing behind, commands among them: in the last one the robot's move is refused.
const BUSY: Tick = ROUND + REFUSED[0];
/// The same, and in the last one it can query nobody.
const BUSY_AND_CUT_OFF: Tick = ROUND + CUT_OFF;
/// So many ticks after it have news, and no clock.
const NEVER_GRANTED: Tick = 4;
/// So many streams and seeds are tried, for so many ticks each.
const DRAWS: u64 = 16;
const DRAWN: Tick = 24;
/// So many seeds are tried where ticks are skipped.
const SKIPPED_SEEDS: u64 = 6;
/// The tick from which on it draws from another stream in the same epoch.
const RESEEDED: Tick = 4;
const RESEEDED_AGAIN: Tick = 8;
/// The tick of an epoch in which a robot asks to join it late.
const FAR: Tick = 70_000;
/// The tick after which a clock strays in.
const STRAY: Tick = 12;
/// How far from its place in one epoch a robot is placed in a further one.
const MOVED_M: f64 = 0.25;

/// Who watches: an observer's token, frames and log lines for it, panels, and a person who asks once.
struct Watched<'k> {
    kit: &'k Kit,
    observer: Option<Declared>,
}

impl Disturbance for Watched<'_> {
    fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
        let bus = &self.kit.bus;
        if self.observer.is_none() {
            self.observer = Some(bus.token(&harness.keys.alive_viewer())?);
        }
        let frame = json!({
            "epoch": harness.epoch(),
            "tick": tick,
            "robots": harness.fake_peers.sensed(harness.epoch(), tick),
        });
        bus.put(&harness.keys.world(), frame.to_string().into())?;
        bus.put(
            &harness.keys.log(),
            json!({ "tick": tick }).to_string().into(),
        )?;

        harness.shows_panels = true;
        if tick == ASKED {
            let _newest = harness.ask(STATE, "")?;
        }
        Ok(())
    }
}

/// Another process, the same seed: the same reports, whoever watches.
pub(super) fn same_seed(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let options = HarnessOptions {
        is_followed: true,
        ..HarnessOptions::default()
    };
    let mut harness = with_robot(kit, options)?;
    let mut watched = Watched {
        kit,
        observer: None,
    };
    let again = play(&mut harness, &PlayScript::usual(kit), &mut watched)?;
    if let [Ok(request)] = &harness.seen.requests[..]
        && request.instance == kit.first_instance()
    {
        let came = format!("two processes have {:?}", request.instance);
        findings.fail(
            "join.request",
            RuleFailure::new("an instance that no other process has", came),
        );
    }

    let found = difference(usual(kit)?, &again);
    if kit.is_deterministic.set(found.is_none()).is_err() {
        unreachable!("it is asked once whether the robot repeats itself");
    }
    match found {
        None => Ok(()),
        Some(found) => Err(found
            .into_failure("another process reports the same for the same seed, whoever watches")),
    }
}

/// Of many others none is the first by chance: which one a robot turns to must not depend on the iteration order of a hash table.
pub(super) fn among_many(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    if kit.is_deterministic.get() == Some(&false) {
        return Ok(());
    }
    let senders: Vec<RobotName> = kit.others(KitRoster::Crowd).into_keys().collect();
    let script = PlayScript::in_turn(kit, &senders, BUSY);
    let first = played_among(kit, KitRoster::Crowd, &script)?;
    let again = played_among(kit, KitRoster::Crowd, &script)?;
    match difference(&first, &again) {
        None => Ok(()),
        Some(found) => {
            Err(found.into_failure("another process reports the same among many others"))
        }
    }
}

/// Where a robot wants to be, and how it gets there.
type Moves = Vec<(Point, f64, f64)>;

/// What is drawn is decided by the seed together with the stream that the welcome names. Each welcome is that of a
/// further epoch, so that one process does for all.
pub(super) fn streams(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    // Of a robot that does not repeat itself nothing can be compared.
    if kit.is_deterministic.get() == Some(&false) {
        return Ok(());
    }

    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, &PlayScript::quiet(DRAWN), &mut Straight)?;
    let seed = harness.template.seed;
    let stream = harness.template.stream.clone();
    let mut by_stream = Vec::new();
    let mut by_seed = Vec::new();
    let mut by_upper_half = Vec::new();
    for number in 1..=DRAWS {
        by_stream.push(moves(&mut harness, seed, format!("{stream}#{number}"))?);
        // It does not start over, so there is nothing to compare.
        if by_stream.last().is_some_and(Vec::is_empty) {
            if harness.process.ended().is_none() {
                return Ok(());
            }
            let epoch = harness.epoch();
            let expected = format!("another request to join for a clock of epoch {epoch}");
            return Err(RuleFailure::new(expected, harness.process.fate()));
        }
        by_seed.push(moves(&mut harness, seed + number, stream.clone())?);
        // Also a robot that keeps only 32 bits of a seed must be found.
        by_upper_half.push(moves(&mut harness, seed + (number << 32), stream.clone())?);
    }

    // A robot that draws nothing moves the same way each time, which is right. Wrong is only one that
    // follows the one and not the other.
    let expected = format!("{DRAWS} streams and {DRAWS} seeds give different moves");
    if are_varied(&by_seed) && are_all_the_same(&by_stream) {
        let came = "the name of the stream makes no difference, the seed does";
        findings.fail("determinism.seed", RuleFailure::new(&expected, came));
    }
    let is_in_vain = are_all_the_same(&by_seed) || are_all_the_same(&by_upper_half);
    if are_varied(&by_stream) && is_in_vain {
        let came = "the seed makes no difference, the name of the stream does";
        findings.fail("determinism.seed", RuleFailure::new(&expected, came));
    }
    if are_varied(&by_seed) {
        demand_reseeded(&mut harness, findings, seed, &stream)?;
    }
    if are_varied(&by_stream) {
        returns::demand_streams(kit, findings)?;
    }
    Ok(())
}

/// In the middle of an epoch a robot draws from another stream, if its welcome says so, and up to there as if it did not.
fn demand_reseeded(
    harness: &mut Harness<'_>,
    findings: &mut Findings,
    seed: u64,
    stream: &str,
) -> Result<(), RuleFailure> {
    let straight = moves(harness, seed, stream.to_owned())?;
    let reseeds = reseeds_at([(RESEEDED, seed + 1), (RESEEDED_AGAIN, seed + 2)]);
    harness.template.reseeds = reseeds[..1].to_vec();
    let once = moves(harness, seed, stream.to_owned())?;
    harness.template.reseeds = reseeds.to_vec();
    let reseeded = moves(harness, seed, stream.to_owned())?;
    let of_other = moves(harness, seed, format!("{stream}#{}", DRAWS + 1))?;
    harness.template.reseeds.clear();

    let [at, again_at] = [RESEEDED, RESEEDED_AGAIN].map(|tick| tick as usize);
    // It does not start over: that is another rule's matter.
    if [&straight, &once, &reseeded, &of_other]
        .map(Vec::len)
        .iter()
        .any(|ticks| *ticks <= again_at)
    {
        return Ok(());
    }
    let what = format!("the seed {} from tick {RESEEDED} on", seed + 1);
    let mut fail = |expected: String, came: &str| {
        findings.fail("determinism.seed", RuleFailure::new(expected, came));
    };
    if straight[..at] != reseeded[..at] {
        let expected = format!("up to tick {RESEEDED} the same moves as without {what}");
        fail(expected, "others");
    }

    // One that turns in each tick draws in each; of others it is not known when they draw.
    let turns = straight[at - 1..]
        .windows(2)
        .all(|pair| pair[0].2 != pair[1].2);
    if turns && straight[at..] == reseeded[at..] {
        let expected = format!("other moves with {what} (`reseeds` of its welcome)");
        fail(expected, "the same");
    }
    if turns && once[again_at..] == reseeded[again_at..] {
        let expected =
            format!("other moves from tick {RESEEDED_AGAIN} on with the second of two `reseeds`");
        fail(expected, "the same");
    }
    let has_same_turns = reseeded[at..]
        .iter()
        .zip(&of_other[at..])
        .all(|(one, other)| one.2 == other.2);
    if turns && has_same_turns {
        fail(
            format!("other moves with {what} for another stream"),
            "the same",
        );
    }

    let skipped = moves_after_skipped(harness, &[])?;
    if turns && skipped == moves_after_skipped(harness, &reseeds[..1])? {
        let expected = format!("{what}, also where it skips the clock of that tick");
        fail(expected, "the same moves as without");
    }

    // Of several that are due the last one counts, whenever the robot draws: one that draws rarely shows it with some seeds.
    for number in 1..=SKIPPED_SEEDS {
        let [first, last] = [2 * number, 2 * number + 1].map(|number| seed + number);
        let due = [(RESEEDED, first), (RESEEDED + 1, last)];
        let alone = moves_after_skipped(harness, &reseeds_at([(RESEEDED + 2, last)]))?;
        if moves_after_skipped(harness, &reseeds_at(due))? != alone {
            let expected = format!("the seed {last} where it skips ticks, with `reseeds` {due:?}");
            fail(expected, "other moves than with the last of them alone");
        }
    }
    harness.template.reseeds.clear();
    Ok(())
}

/// In which directions the robot moves in a further epoch after it has skipped the tick [`RESEEDED`] and the one that follows.
fn moves_after_skipped(
    harness: &mut Harness<'_>,
    reseeds: &[StreamReseed],
) -> Result<Vec<f64>, RuleFailure> {
    harness.template.reseeds = reseeds.to_vec();
    harness.begin_epoch(harness.epoch() + 1);
    play(harness, &PlayScript::quiet(RESEEDED - 1), &mut Straight)?;
    waiting::withhold_news(harness)?;
    let reports = peers::after_skipped(harness, &[])?;
    harness.withholds_news = false;

    let directions_rad = reports.iter().map(|report| report.direction_rad);
    Ok(directions_rad.collect())
}

fn are_all_the_same(moves: &[Moves]) -> bool {
    moves.iter().all(|other| Some(other) == moves.first())
}

/// Whether chance shows: no moves are those of more than half. That it shows nowhere among as many others is then no chance.
fn are_varied(moves: &[Moves]) -> bool {
    moves.iter().all(|one| {
        let same = moves.iter().filter(|other| *other == one);
        2 * same.count() <= moves.len()
    })
}

/// How the robot moves in a further epoch with this seed and stream.
fn moves(harness: &mut Harness<'_>, seed: u64, stream: String) -> Result<Moves, RuleFailure> {
    harness.template.seed = seed;
    harness.template.stream = stream;
    let asked = harness.seen.requests.len();
    harness.begin_epoch(harness.epoch() + 1);
    let played = play(harness, &PlayScript::quiet(DRAWN), &mut Straight);
    // A robot that does not start over shows nothing here; that is another rule's matter.
    if harness.seen.requests.len() == asked {
        return Ok(Moves::new());
    }

    let mut moves = Moves::new();
    for entry in played? {
        let report = entry.report;
        moves.push((report.proposal, report.speed_mps, report.direction_rad));
    }
    Ok(moves)
}

/// The clock of a higher epoch: it joins again, and goes through the same ticks as a fresh process.
pub(super) fn init(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    /// At tick 0 the robot is welcomed to the epoch that is over before it is welcomed to the next one.
    struct WrongWelcome;
    impl Disturbance for WrongWelcome {
        fn during(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            if tick > 0 {
                return Ok(());
            }
            let joining = join_again(harness)?;
            harness.welcome_to(joining, harness.epoch() - 1);
            harness.settle(QUIET);
            demand_silence(
                harness,
                "welcomed to the epoch before, no report for a clock of the next one",
            )?;
            harness.repeat();
            let joining = join_again(harness)?;
            harness.admit(joining);
            harness.keeps_requests = false;
            Ok(())
        }
    }
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    // Whom it knows from the epoch before is elsewhere in this one.
    harness.fake_peers.displace(true);
    play(&mut harness, &PlayScript::busy(kit, BUSY), &mut Straight)?;
    harness.fake_peers.displace(false);
    let [text, _] = kit.texts();
    // News of ticks that are never granted must not be taken for those of the next epoch.
    for tick in harness.next_tick()..harness.next_tick() + NEVER_GRANTED {
        harness.put_news(&TickUpdate {
            epoch: harness.epoch(),
            tick,
            commands: vec![ArrivingCommand::new(&kit.sender(), &text, tick).delivery()],
            ..TickUpdate::default()
        })?;
    }

    harness.begin_epoch(harness.epoch() + 1);
    harness.keeps_requests = true;
    let again = play(&mut harness, &PlayScript::usual(kit), &mut WrongWelcome);
    // Before the play itself is judged: a process that has another identity explains what else is
    // wrong.
    returns::demand_same_process(&harness)?;
    let again = again?;
    harness.demand_token_kept("an epoch begins")?;
    let what = "to start over in a further epoch instead of a new process";
    demand_same(kit, what, usual(kit)?, &again)?;

    let mut harness = with_robot(kit, HarnessOptions::default())?;
    let stray = "a clock of a further epoch, for which its welcome is that of this one";
    demand_usual(&mut harness, stray, &mut StrayClock)?;

    // An epoch begins and is over before its welcome is here: the one that follows is that of the welcome.
    let joining = asked_astray(&mut harness)?;
    harness.begin_epoch(harness.epoch() + 2);
    harness.admit(joining);
    let over = "that the epoch of the clock was over when it was welcomed";
    demand_usual(&mut harness, over, &mut Straight)?;

    harness.begin_epoch(harness.epoch() + 1);
    play(
        &mut harness,
        &PlayScript::busy(kit, BUSY_AND_CUT_OFF),
        &mut Straight,
    )?;
    harness.begin_epoch(harness.epoch() + 1);
    demand_usual(&mut harness, what, &mut Straight)
}

/// In the middle of an epoch comes a clock of one that does not begin: the robot asks, and goes on as what it is.
struct StrayClock;

impl Disturbance for StrayClock {
    fn after(&mut self, harness: &mut Harness<'_>, entry: &PlayedTick) -> Result<(), RuleFailure> {
        if entry.tick != STRAY {
            return Ok(());
        }

        let joining = asked_astray(harness)?;
        harness.welcome_to(joining, harness.epoch());
        harness.settle(QUIET);
        Ok(())
    }
}

/// The robot's request to join for a clock of the next epoch, which does not begin.
fn asked_astray(harness: &mut Harness<'_>) -> Result<Joining, RuleFailure> {
    harness.keeps_requests = true;
    harness.put_clock(&Clock {
        epoch: harness.epoch() + 1,
        ..Clock::default()
    })?;
    let joining = harness.next_join(PATIENCE)?;
    harness.keeps_requests = false;
    Ok(joining)
}

/// A further epoch with another welcome: it goes through it as a process that has no other one. A person may load another scenario
/// between two epochs, so that all of it differs.
pub(super) fn other_welcome(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let busy = PlayScript::busy(kit, BUSY);
    let anew = |differs| {
        let mut harness = Harness::open_run(kit, HarnessOptions::default())?;
        harness.prepare()?;
        differ(&mut harness.template, differs);
        harness.admit_first()?;
        play(&mut harness, &busy, &mut Straight)
    };
    // A robot may refuse such numbers.
    let mut differs = Differing::All;
    let expected = match anew(differs) {
        Ok(expected) => expected,
        Err(_) => {
            differs = Differing::Start;
            anew(differs)?
        }
    };

    let mut harness = Harness::open_run(kit, HarnessOptions::default())?;
    harness.prepare()?;
    harness.template.reseeds = reseeds_at([(DRAWN / 2, 1), (BUSY - 1, 2)]);
    harness.admit_first()?;
    play(&mut harness, &busy, &mut Straight)?;
    differ(&mut harness.template, differs);
    harness.begin_epoch(harness.epoch() + 1);
    let played = play(&mut harness, &busy, &mut Straight)?;
    let what = "to be welcomed in another way in the epoch before";
    demand_same(kit, what, &expected, &played)
}

/// How a welcome differs from that of the epoch before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Differing {
    /// In seed, stream, `reseeds` and place.
    Start,
    /// In the robot's parameters, the field and what is in it, and the length of a tick, too.
    All,
}

fn differ(welcome: &mut Welcome, differs: Differing) {
    // Also a robot that takes this seed for none must repeat itself.
    welcome.seed = u64::from(welcome.seed == 0);
    welcome.stream.push_str("#other");
    welcome.reseeds = reseeds_at([(RESEEDED, 1)]);
    welcome.location.x += MOVED_M;
    if differs == Differing::All {
        welcome.parameters.values_mut().for_each(returns::shrink);
        welcome.tick_s *= returns::SHRUNK;
        welcome.body_m *= returns::SHRUNK;
        welcome.sensing_range_m *= returns::SHRUNK;
        welcome.field_m[1] += MOVED_M;
        welcome.known_sites.push(KnownSite {
            name: "another site".to_owned(),
            kind: "site".to_owned(),
            location: welcome.location,
        });
    }
}

/// A process that has joined again in an epoch goes through the next one as one that joins in that epoch in the place of another.
pub(super) fn after_rejoining(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let busy = PlayScript::busy(kit, BUSY);
    let mut anew = Harness::open_run(kit, HarnessOptions::default())?;
    anew.prepare()?;
    anew.play_predecessor(DRAWN)?;
    anew.begin_epoch(anew.epoch() + 1);
    anew.admit_first()?;
    let expected = play(&mut anew, &busy, &mut Straight)?;

    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, &busy, &mut Straight)?;
    harness.begin_epoch(harness.epoch() + 1);
    let played = play(&mut harness, &busy, &mut Straight)?;
    let what = "to have joined again in the epoch before, for one of the same generation";
    demand_same(kit, what, &expected, &played)
}

/// An epoch begins while it waits for its news, or for another robot's answer: nothing else would ever end that wait.
pub(super) fn while_waiting(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = waiting::for_news(kit)?;
    harness.withholds_news = false;
    begin_later(&mut harness)?;

    let (mut harness, is_asking) = waiting::for_another(kit)?;
    if is_asking {
        // What it asked for in the epoch before is never answered.
        harness.fake_peers.hold_before(LATER, 0);
        begin_later(&mut harness)?;
    }

    // Of an incarnation that waits to be named nothing is left.
    let mut harness = returns::returned_once(kit)?;
    harness.template = kit.template(&harness.run, KitRoster::Usual);
    begin_later(&mut harness)
}

/// A later epoch begins, not always the next one: the robot may have missed some.
fn begin_later(harness: &mut Harness<'_>) -> Result<(), RuleFailure> {
    harness.template.location.x += MOVED_M;
    harness.begin_epoch(LATER);
    let played = play(harness, &PlayScript::quiet(0), &mut Straight)?;
    demand_epoch(&played, LATER)?;
    let expected =
        "at tick 0 of a further epoch it stands where its welcome of that epoch places it";
    let shown = super::queries::state(harness.state_in(LATER, 1)?, expected)?.location;
    if shown != harness.template.location {
        return Err(RuleFailure::new(
            expected,
            format!("it stands at {shown:?}"),
        ));
    }
    let played = play(harness, &PlayScript::quiet(1), &mut Straight)?;
    demand_epoch(&played, LATER)
}

/// A robot that has missed the beginning of an epoch joins again, too, and waits until it is named.
pub(super) fn late(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;

    harness.begin_epoch(LATER);
    // Ticks go on without it, more than two bytes count: from then on only its news can tell it that it takes part.
    while harness.next_tick() < FAR {
        harness.miss()?;
    }
    harness.keeps_requests = true;

    // A clock that does not name the robot: what the barrier puts for a robot that has not reported names it.
    harness.is_cut_off = true;
    harness.open(&TickUpdate::default())?;
    harness.put_clock(&Clock {
        epoch: LATER,
        tick: FAR,
        ..Clock::default()
    })?;
    harness.is_cut_off = false;

    let joining = join_again(&mut harness)?;
    harness.admit(joining);
    harness.keeps_requests = false;
    returns::demand_same_process(&harness)?;
    harness.settle(QUIET);
    let expected =
        "admitted in the middle of an epoch, no report before its news name its generation";
    demand_silence(&harness, expected)?;

    let transcript = play(&mut harness, &PlayScript::quiet(4), &mut Straight)?;
    demand_epoch(&transcript, LATER)?;
    harness.demand_token_kept("it joins a further epoch")
}

fn join_again(harness: &mut Harness<'_>) -> Result<Joining, RuleFailure> {
    let epoch = harness.epoch();
    harness.next_join(PATIENCE).map_err(|failure| {
        let expected = format!("another request to join for a clock of epoch {epoch}");
        RuleFailure {
            expected,
            ..failure
        }
    })
}

/// No report of the epoch under way has come.
fn demand_silence(harness: &Harness<'_>, expected: &str) -> Result<(), RuleFailure> {
    let epoch = harness.epoch();
    let mut reports = harness
        .seen
        .answers
        .iter()
        .map(|answer| &answer.reading.report);

    match reports.find(|report| report.epoch == epoch) {
        None => Ok(()),
        Some(report) => Err(RuleFailure::new(
            expected,
            format!("a report for tick {} of epoch {epoch}", report.tick),
        )),
    }
}

fn demand_epoch(transcript: &[PlayedTick], epoch: Epoch) -> Result<(), RuleFailure> {
    match transcript.iter().find(|entry| entry.report.epoch != epoch) {
        None => Ok(()),
        Some(entry) => {
            let came = format!("epoch {}", entry.report.epoch);
            Err(RuleFailure::new(format!("reports of epoch {epoch}"), came))
        }
    }
}
