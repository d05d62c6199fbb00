//! Commands: in the order of the news, as often as they list them, from other robots and from an operator.

use std::collections::BTreeMap;

use protocol::messages::{
    Correction, MAX_PAYLOAD_BYTES, MAX_PAYLOAD_DEPTH, MAX_TEXT_BYTES, TickUpdate, Variable,
};
use protocol::{RobotName, Tick};
use serde_json::{Value, json};

use harness::Harness;
use harness::comparison::is_same;
use harness::findings::Findings;
use harness::kit::{Kit, KitRoster};
use harness::report::{KitPart, RuleFailure};
use harness::script::{
    ArrivingCommand, CUT_OFF, Disturbance, OUT_OF_RANGE, PlayScript, Plays, Straight,
};
use harness::setting::IN_ORDER;
use harness::transcript::Transcript;

/// The first tick that is played in all parts: one that has joined again has been through those before.
const FIRST: Tick = 4;
/// The tick in whose news the last commands of these checks arrive, and the last tick.
const LAST: Tick = FIRST + 3;
const TICKS: Tick = LAST + 6;
/// More commands in the news of a tick than a robot that counts on few of them has room for, and so few that each has.
const MANY: usize = 520;
/// The same for a program, which may say something of each in its log.
const MANY_LOGGED: usize = 500;
/// So many long ones are most of what may arrive in a tick.
const MANY_LONG: usize = 200;
/// The same for a program, whose log has room for half of them.
const MANY_LONG_LOGGED: usize = 100;
const FEW: usize = 7;
/// The last tick where as many come in few in each tick.
const LAST_OF_MANY: Tick = FIRST + (MANY / FEW) as Tick;

const SHORT_TEXT: usize = 90;
/// Most bytes that a line has in which a text is quoted, beside the text.
const QUOTED_BY: usize = 96;
/// All kinds of characters that JSON escapes, such as have two, three and four bytes, and such as end lines elsewhere.
const ESCAPED_TEXT: &str =
    " \"a\\b/\t\r\n{\"tick\":9}\u{1}\u{b}\u{c}äßﬁ猫🤖\u{85}\u{2028}\u{2029} ";

/// How many commands are many for this robot, and how many long ones.
fn many_for(kit: &Kit) -> [usize; 2] {
    if kit.stdio.is_program() {
        [MANY_LOGGED, MANY_LONG_LOGGED]
    } else {
        [MANY, MANY_LONG]
    }
}

/// Plays ticks in whose news these commands arrive, each from the sender of the kit's commands.
fn commanded(plays: &Plays<'_>, commands: &[(&str, Tick)]) -> Result<Transcript, RuleFailure> {
    commanded_by(&plays.sender(), plays, commands)
}

fn commanded_by(
    from: &RobotName,
    plays: &Plays<'_>,
    commands: &[(&str, Tick)],
) -> Result<Transcript, RuleFailure> {
    plays.play(&PlayScript::with(
        TICKS,
        arrivals(from, commands.iter().copied()),
    ))
}

/// Plays a command whose news say that the robot is blocked, where it stands.
fn commanded_while_blocked(plays: &Plays<'_>, text: &str) -> Result<Transcript, RuleFailure> {
    struct Blocked;
    impl Disturbance for Blocked {
        fn news(&mut self, harness: &Harness<'_>, news: &mut TickUpdate) {
            if !news.commands.is_empty() {
                let confirmed = news.correction.unwrap_or(harness.body.confirmed());
                news.correction = Some(Correction {
                    blocked: true,
                    ..confirmed
                });
            }
        }
    }
    let script = PlayScript::with(TICKS, arrivals(&plays.sender(), [(text, LAST)]));
    plays.play_among(KitRoster::Usual, &script, &mut Blocked)
}

/// Plays these commands of two senders, in the order in which news list those.
fn commanded_by_two(
    plays: &Plays<'_>,
    commands: [(&str, Tick); 2],
) -> Result<Transcript, RuleFailure> {
    let mut arrivals = Vec::new();
    for (from, (text, tick)) in two_senders(plays).iter().zip(commands) {
        arrivals.push(ArrivingCommand::new(from, text, tick));
    }
    plays.play(&PlayScript::with(TICKS, arrivals))
}

/// A robot and the operator, in the order in which news list their commands.
fn two_senders(kit: &Kit) -> [RobotName; 2] {
    let mut senders = [kit.sender(), RobotName::operator()];
    senders.sort();
    senders
}

fn arrivals<'t>(
    from: &RobotName,
    commands: impl IntoIterator<Item = (&'t str, Tick)>,
) -> Vec<ArrivingCommand> {
    let mut arrivals = Vec::new();
    for (text, tick) in commands {
        arrivals.push(ArrivingCommand::new(from, text, tick));
    }
    arrivals
}

/// For and against something that is seen in several places of a report.
#[derive(Default)]
struct Votes {
    right: usize,
    wrong: usize,
    /// Neither the one nor the other: commands that arrive together also have an effect of their own, so that nothing follows
    /// from a coincidence elsewhere.
    neither: usize,
}

impl Votes {
    fn is_broken(&self) -> bool {
        self.right == 0 && self.neither == 0 && self.wrong > 0
    }
}

/// Two commands in the same news have the effect of the same two in two ticks, in the same order.
pub(super) fn order(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let plays = &Plays::new(kit);
    for [one, two] in plays.pairs() {
        // Two ticks show what the order of two commands means to this robot; one tick shows which order
        // it takes.
        let straight = values(&commanded(plays, &[(&one, LAST - 1), (&two, LAST)])?);
        let swapped = values(&commanded(plays, &[(&two, LAST - 1), (&one, LAST)])?);
        let in_order = values(&commanded(plays, &[(&one, LAST), (&two, LAST)])?);
        let reversed = values(&commanded(plays, &[(&two, LAST), (&one, LAST)])?);
        // Where both are the same, the order within a tick makes no difference to this robot, or it sorts its commands: only a variable
        // with the text of the last command tells which.
        if in_order == reversed && !shows_last(&straight, &two, &swapped, &one) {
            continue;
        }

        let votes = vote(&in_order, &straight, &swapped);
        let back = vote(&reversed, &swapped, &straight);
        for (votes, first, second) in [(&votes, &one, &two), (&back, &two, &one)] {
            if votes.is_broken() {
                return Err(RuleFailure::new(
                    format!(
                        "news that list {first:?} and then {second:?} have their effect in this order"
                    ),
                    "the effect of the other order",
                ));
            }
        }
        // Both ways: a robot that sorts its commands would be right in one of them.
        if votes.right > 0 && back.right > 0 {
            // Who sends and how many they are is the same in all parts.
            if plays.part() == KitPart::Alone {
                order_of_senders(plays, &one, &two)?;
                last_of_many(plays, &one, &two)?;
            }
            return Ok(());
        }
    }

    let reason = format!(
        "the robot does not show in which order it executes {}; name commands that it understands with --say",
        shown(plays)
    );
    findings.skip("command.order", &reason);
    Ok(())
}

/// The same of commands from two senders, and of one with a payload: news list all of the first one before those of the second one.
fn order_of_senders(plays: &Plays<'_>, one: &str, two: &str) -> Result<(), RuleFailure> {
    let from = |sender: &RobotName, text: &str| ArrivingCommand::new(sender, text, LAST);
    let [first, second] = two_senders(plays);
    let mut cases = vec![
        (
            KitRoster::Usual,
            vec![from(&first, one), from(&first, two), from(&second, one)],
        ),
        (
            KitRoster::Usual,
            vec![from(&first, one).with_payload(&json!(1)), from(&first, two)],
        ),
    ];
    let in_crowd = IN_ORDER.map(|names| (KitRoster::Crowd, names.map(crowd_name)));
    for (roster, [first, second]) in [(KitRoster::Usual, [first, second])]
        .into_iter()
        .chain(in_crowd)
    {
        cases.push((roster, vec![from(&first, one), from(&second, two)]));
    }

    for (roster, commands) in cases {
        let effect = |arriving: Vec<ArrivingCommand>| {
            plays
                .play_among(roster, &PlayScript::with(TICKS, arriving), &mut Straight)
                .map(|played| values(&played))
        };
        let last = commands.len() - 1;
        let came = effect(commands.clone())?;
        // A robot may not obey everyone.
        if came == effect(commands[..last].to_vec())? {
            continue;
        }
        // What the order means is seen where all are of one sender.
        let texts = commands.iter().map(|command| (&*command.text, LAST));
        let mut of_one = arrivals(&plays.sender(), texts);
        let wanted = effect(of_one.clone())?;
        of_one.swap(last - 1, last);
        let votes = vote(&came, &wanted, &effect(of_one)?);
        if votes.is_broken() {
            let listed: Vec<String> = commands
                .iter()
                .map(|command| format!("{:?} of {}", command.text, command.from))
                .collect();
            let listed = listed.join(" and then ");
            return Err(RuleFailure::new(
                format!("news that list {listed} have their effect in this order"),
                "the effect of the other order",
            ));
        }
    }
    Ok(())
}

/// The name of a robot of the crowd, or the operator's.
fn crowd_name(name: &str) -> RobotName {
    RobotName::new(name).unwrap_or_else(|_| RobotName::operator())
}

/// The last command in the news of a tick is executed, whatever is listed before it and whomever the robot can query, if it is in the tick
/// after it.
fn last_of_many(plays: &Plays<'_>, one: &str, two: &str) -> Result<(), RuleFailure> {
    let sender = plays.sender();
    let at = |from: &RobotName, text: &str, tick| ArrivingCommand::new(from, text, tick);
    let [one, two] = [one, two].map(|text| at(&sender, text, LAST));
    let [first, second] = [1, 2].map(|number| one.clone().with_payload(&json!(number)));
    let long = at(&sender, &"x".repeat(MAX_TEXT_BYTES / 2), LAST);
    let operator = RobotName::operator();
    let of_operator = [&one, &two].map(|command| at(&operator, &command.text, LAST));
    let crowd: Vec<RobotName> = plays.others(KitRoster::Crowd).into_keys().collect();
    let of_crowd = crowd.iter().map(|from| at(from, &one.text, LAST));
    let of_last = crowd
        .last()
        .map_or_else(|| two.clone(), |from| at(from, &two.text, LAST));

    let usual = KitRoster::Usual;
    let [many, many_long] = many_for(plays);
    for (roster, listed, last) in [
        (usual, vec![one.clone(); many], &two),
        (usual, vec![two.clone(); many], &one),
        (usual, vec![one.clone(), two.clone()], &one),
        (usual, vec![first], &second),
        (usual, vec![long; many_long], &two),
        (usual, vec![of_operator[0].clone()], &of_operator[1]),
        (usual, Vec::new(), &at(&sender, &two.text, CUT_OFF)),
        (usual, Vec::new(), &at(&sender, &two.text, OUT_OF_RANGE)),
        (KitRoster::Crowd, of_crowd.take(FEW).collect(), &of_last),
    ] {
        let effect = |last: Option<ArrivingCommand>| {
            let commands = listed.iter().cloned().chain(last).collect();
            plays.play_among(
                roster,
                &PlayScript::with(CUT_OFF + FEW as Tick, commands),
                &mut Straight,
            )
        };
        let without = effect(None)?;
        if !is_same(&effect(Some(last.clone()))?, &without) {
            continue;
        }
        let after = ArrivingCommand {
            tick: last.tick + 1,
            ..last.clone()
        };
        if !is_same(&effect(Some(after))?, &without) {
            let texts: Vec<String> = listed
                .iter()
                .map(|command| command.text.chars().take(FEW).collect())
                .take(2)
                .collect();
            return Err(RuleFailure::new(
                format!(
                    "a command that news of tick {} list after {} others, {texts:?}, has an effect, as in the tick after it",
                    last.tick,
                    listed.len()
                ),
                "none at all",
            ));
        }
    }
    Ok(())
}

/// Whether a value is the text of the last command, in both orders of two ticks.
fn shows_last(
    straight: &BTreeMap<(Tick, String), Value>,
    two: &str,
    swapped: &BTreeMap<(Tick, String), Value>,
    one: &str,
) -> bool {
    let mut values = straight.iter();
    one != two
        && values
            .any(|(at, value)| *value == two && swapped.get(at).is_some_and(|other| *other == one))
}

/// Fields of a report that differ between plays anyway, or count what is compared elsewhere.
const OF_THE_PLAY: [&str; 4] = ["epoch", "generation", "log", "commands"];

/// What the robot reports after the last command, by tick and field.
fn values(transcript: &Transcript) -> BTreeMap<(Tick, String), Value> {
    let mut values = BTreeMap::new();
    for entry in transcript.iter().filter(|entry| entry.tick >= LAST) {
        let report = serde_json::json!(entry.report);
        let fields = report.as_object().into_iter().flatten();
        for (name, value) in fields {
            if name == "state_variables" {
                for (variable, value) in value.as_object().into_iter().flatten() {
                    values.insert((entry.tick, format!("{name}.{variable}")), value.clone());
                }
            } else if !OF_THE_PLAY.contains(&name.as_str()) {
                values.insert((entry.tick, name.clone()), value.clone());
            }
        }
    }

    values
}

/// Where `wanted` and `other` differ: does `came` have the value of the one, or of the other?
fn vote(
    came: &BTreeMap<(Tick, String), Value>,
    wanted: &BTreeMap<(Tick, String), Value>,
    other: &BTreeMap<(Tick, String), Value>,
) -> Votes {
    let mut votes = Votes::default();
    for (at, value) in wanted {
        if other.get(at) == Some(value) {
            continue;
        }
        if came.get(at) == Some(value) {
            votes.right += 1;
        } else if came.get(at) == other.get(at) {
            votes.wrong += 1;
        } else {
            votes.neither += 1;
        }
    }

    votes
}

/// The pairs of commands that were tried.
fn shown(plays: &Plays<'_>) -> String {
    plays
        .pairs()
        .iter()
        .map(|[one, two]| format!("{one:?} and {two:?}"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// The same command not at all, once, often in several ticks, and as often in the news of one.
struct ManyPlays {
    text: String,
    count: usize,
    none: Transcript,
    once: Transcript,
    apart: Transcript,
    together: Transcript,
}

impl ManyPlays {
    fn play(plays: &Plays<'_>, text: &str) -> Result<Self, RuleFailure> {
        let sender = plays.sender();
        let [count, _] = many_for(plays);
        let played = |commands: &mut dyn Iterator<Item = Tick>| {
            let arrivals = arrivals(&sender, commands.map(|tick| (text, tick)));
            plays.play(&PlayScript::with(LAST_OF_MANY, arrivals))
        };
        Ok(Self {
            text: text.to_owned(),
            count,
            none: played(&mut std::iter::empty())?,
            once: played(&mut std::iter::once(LAST))?,
            apart: played(&mut (0..count).map(|at| FIRST + (at / FEW) as Tick))?,
            together: played(&mut std::iter::repeat_n(LAST, count))?,
        })
    }
}

/// Commands are executed as often as the news list them, and then each is answered by a robot that answers each.
pub(super) fn many(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let plays = &Plays::new(kit);
    let mut many = None;
    let counted = twice(plays, &mut many, findings);
    let answered = many_sent(plays, &mut many, findings);
    if let Err(failure) = answered {
        findings.fail("command.sent", failure);
    }
    counted
}

/// A command that is listed twice is executed twice.
fn twice(
    plays: &Plays<'_>,
    many: &mut Option<ManyPlays>,
    findings: &mut Findings,
) -> Result<(), RuleFailure> {
    if plays.is_deterministic.get() == Some(&false) {
        findings.skip(
            "command.twice",
            "the robot does not repeat itself, so that nothing can be compared",
        );
        return Ok(());
    }

    let none = numbers(&commanded(plays, &[])?);
    for [text, _] in plays.pairs() {
        let once = numbers(&commanded(plays, &[(&text, LAST)])?);
        let apart = numbers(&commanded(plays, &[(&text, LAST - 3), (&text, LAST)])?);
        let adjacent = numbers(&commanded(plays, &[(&text, LAST - 1), (&text, LAST)])?);
        let doubled = numbers(&commanded(plays, &[(&text, LAST), (&text, LAST)])?);
        let blocked = numbers(&commanded_while_blocked(plays, &text)?);

        let counters = counters(&none, &once, &apart);
        let mut is_counted = false;
        for (is_executed, played, executions) in [
            ("that the news list twice is executed twice", &doubled, 2),
            ("in two ticks in turn is executed twice", &adjacent, 2),
            ("is executed where it is blocked", &blocked, 1),
        ] {
            let expected = format!("{text:?} {is_executed}");
            is_counted |= demand_executions(&expected, &counters, played, executions)?;
        }
        if is_counted {
            from_two(plays, &text, &none, &once)?;
            return match plays.part() {
                KitPart::Alone => demand_many(many.insert(ManyPlays::play(plays, &text)?)),
                _ => Ok(()),
            };
        }
    }

    let reason = format!(
        "no variable of the robot counts the commands that it executes, of {}",
        shown(plays)
    );
    findings.skip("command.twice", &reason);
    Ok(())
}

/// The same command of two senders is two commands.
fn from_two(
    plays: &Plays<'_>,
    text: &str,
    none: &BTreeMap<String, f64>,
    once: &BTreeMap<String, f64>,
) -> Result<(), RuleFailure> {
    let apart = numbers(&commanded_by_two(plays, [(text, LAST - 1), (text, LAST)])?);
    let together = numbers(&commanded_by_two(plays, [(text, LAST), (text, LAST)])?);
    let expected = format!("{text:?} from two senders in the news of a tick is executed twice");
    let counters = counters(none, once, &apart);
    demand_executions(&expected, &counters, &together, 2).map(drop)
}

/// A variable that counts commands, as far as is known: its values after none, one and two of them.
type Counter<'n> = (&'n String, [f64; 3]);

fn counters<'n>(
    none: &BTreeMap<String, f64>,
    once: &'n BTreeMap<String, f64>,
    twice: &BTreeMap<String, f64>,
) -> Vec<Counter<'n>> {
    let mut counters = Vec::new();
    for (name, first) in once {
        if let (Some(before), Some(second)) = (none.get(name), twice.get(name))
            && counts(before, first, second)
        {
            counters.push((name, [*before, *first, *second]));
        }
    }
    counters
}

/// Whether a variable with these values after no command, after one and after two counts commands.
fn counts(none: &f64, one: &f64, two: &f64) -> bool {
    one != none && one - none == two - one
}

/// Commands were executed so often, and not once less. A variable may follow commands in another way, so one that counts all of them is
/// enough. Returns whether there is one.
fn demand_executions(
    expected: &str,
    counters: &[Counter<'_>],
    played: &BTreeMap<String, f64>,
    executions: usize,
) -> Result<bool, RuleFailure> {
    let mut votes = Votes::default();
    let mut came = String::new();
    for (name, values) in counters {
        let Some(value) = played.get(*name) else {
            continue;
        };
        if *value == values[executions] {
            votes.right += 1;
        } else if *value == values[executions - 1] {
            votes.wrong += 1;
            came = format!("{name} = {value}");
        }
    }

    if votes.is_broken() {
        return Err(RuleFailure::new(expected, came));
    }
    Ok(votes.right > 0)
}

/// As many executions as the news list, also where that is more than a few. A counter that stops early is not one of commands.
fn demand_many(many: &ManyPlays) -> Result<(), RuleFailure> {
    let none = numbers(&many.none);
    let apart = numbers(&many.apart);
    let together = numbers(&many.together);
    for (name, first) in &numbers(&many.once) {
        let (Some(before), Some(wanted), Some(came)) =
            (none.get(name), apart.get(name), together.get(name))
        else {
            continue;
        };
        // Counted exactly over several ticks: so it counts commands, whatever else it depends on.
        let is_counter =
            first - before != 0.0 && wanted - before == many.count as f64 * (first - before);
        if is_counter && came < wanted {
            return Err(RuleFailure::new(
                format!(
                    "{} commands in the news of a tick are all executed: {name} = {wanted}",
                    many.count
                ),
                format!("{name} = {came}"),
            ));
        }
    }
    Ok(())
}

/// The numbers among the variables of the last report.
fn numbers(transcript: &Transcript) -> BTreeMap<String, f64> {
    let Some(last) = transcript.last() else {
        return BTreeMap::new();
    };
    let variables = last.report.state_variables.iter();

    variables
        .filter_map(|(name, value)| match value {
            Variable::Number(number) => Some((name.to_owned(), *number)),
            _ => None,
        })
        .collect()
}

/// News with a long text are read, also by a robot that does not understand it, and so are those with a payload, also with
/// the largest one: a robot that expects none ignores it.
pub(super) fn payload(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let plays = &Plays::new(kit);
    let [text, _] = plays.texts();
    // With its quotation marks.
    let largest = "x".repeat(MAX_PAYLOAD_BYTES - 2);
    // As deep as a payload may be.
    let deepest = (2..MAX_PAYLOAD_DEPTH).fold(json!([]), |inner, _| json!([inner]));
    let payloads = [
        (
            "a payload",
            json!({ "task": 3, "bid": 0.1, "of": ["A", null, true] }),
        ),
        ("the largest payload", json!(largest)),
        (
            "the deepest payload and large numbers",
            json!([u64::MAX, i64::MIN, -0.0, 1e300, deepest]),
        ),
        ("a payload like messages", like_messages()),
        ("the payload false", json!(false)),
        ("the payload 0", json!(0)),
        ("an empty text as payload", json!("")),
        ("an empty list as payload", json!([])),
        ("an empty object as payload", json!({})),
    ];
    let understood = payloads
        .iter()
        .map(|(_, payload)| (text.as_str(), Some(payload)));
    plays.play(&one_by_one(plays, understood))?;

    // Programs may quote it in a line of their log, which is not to be longer.
    let room = if plays.stdio.is_program() {
        QUOTED_BY
    } else {
        0
    };
    let longest = "x".repeat(MAX_TEXT_BYTES - room);
    // Who cuts what it sends back counts bytes, and leaves no half of a character.
    let two_bytes = "é".repeat(longest.len() / 2);
    // Together they are longer than a text may be.
    commanded(plays, &[(longest.as_str(), LAST); 4])?;

    // Of a text that the robot does not know, it expects no payload.
    let short = "x".repeat(SHORT_TEXT);
    let mut unknown = Vec::new();
    for (what, payload) in &payloads {
        unknown.push((format!("a text with {what}"), short.as_str(), Some(payload)));
    }
    for (what, text) in [
        (format!("a text of {} bytes", longest.len()), &*longest),
        (
            format!(
                "a text of {} bytes, two for each character",
                two_bytes.len()
            ),
            &two_bytes,
        ),
        (format!("the text {ESCAPED_TEXT:?}"), ESCAPED_TEXT),
        ("an empty text".to_owned(), ""),
    ] {
        unknown.push((what, text, None));
    }
    demand_counted(plays, &short, &unknown)?;
    demand_ignored(plays, &short, &payloads)
}

/// Where a payload makes no difference to the robot, none does, whatever fields it has.
fn demand_ignored(
    plays: &Plays<'_>,
    text: &str,
    payloads: &[(&str, Value)],
) -> Result<(), RuleFailure> {
    // What it does with payloads is the same in all parts.
    if plays.part() != KitPart::Alone || plays.is_deterministic.get() == Some(&false) {
        return Ok(());
    }

    let plain = ArrivingCommand::new(&plays.sender(), text, LAST);
    let effect = |command| {
        let played = plays.play(&PlayScript::with(TICKS, vec![command]))?;
        Ok::<_, RuleFailure>(values(&played))
    };
    let without = effect(plain.clone())?;
    let mut ignored = None;
    for (what, payload) in payloads {
        let makes_difference = effect(plain.clone().with_payload(payload))? != without;
        match (makes_difference, ignored) {
            (true, None) => return Ok(()),
            (true, Some(ignored)) => {
                return Err(RuleFailure::new(
                    format!("{what} makes no difference, as {ignored} makes none"),
                    format!("one, with a text of {SHORT_TEXT} bytes"),
                ));
            }
            (false, _) => ignored = ignored.or(Some(what)),
        }
    }
    Ok(())
}

/// A payload with the fields of clocks, news, welcomes and lines for programs, also further within.
fn like_messages() -> Value {
    let fields = json!({
        "type": "end", "end": "stopped", "epoch": 9, "tick": 9, "generation": 9, "joined": 9, "rejoin": 1, "news": 1,
        "location": { "x": 1.0, "y": 1.0 }, "blocked": true, "from": "A", "command": "b", "commands": [], "reseeds": [],
    });
    let mut outer = fields.clone();
    outer["inner"] = fields;
    outer["inner"]["type"] = json!("init");
    outer
}

/// Each of these texts and payloads in the news of a tick of its own.
fn one_by_one<'t>(
    plays: &Plays<'_>,
    commands: impl IntoIterator<Item = (&'t str, Option<&'t Value>)>,
) -> PlayScript {
    let mut arriving = Vec::new();
    for ((text, payload), tick) in commands.into_iter().zip(FIRST..) {
        let command = ArrivingCommand::new(&plays.sender(), text, tick);
        arriving.push(match payload {
            Some(payload) => command.with_payload(payload),
            None => command,
        });
    }
    PlayScript::with(FIRST + arriving.len() as Tick, arriving)
}

/// Where a variable counts commands that the robot does not know, it counts each of these like a short one.
fn demand_counted(
    plays: &Plays<'_>,
    short: &str,
    commands: &[(String, &str, Option<&Value>)],
) -> Result<(), RuleFailure> {
    let listed = commands.iter().map(|(_, text, payload)| (*text, *payload));
    let together = numbers(&plays.play(&one_by_one(plays, listed))?);
    if plays.is_deterministic.get() == Some(&false) {
        return Ok(());
    }
    let none = numbers(&commanded(plays, &[])?);
    let once = numbers(&commanded(plays, &[(short, LAST)])?);
    let apart = numbers(&commanded(plays, &[(short, LAST - 1), (short, LAST)])?);
    for (name, first) in &once {
        let (Some(before), Some(second)) = (none.get(name), apart.get(name)) else {
            continue;
        };
        let wanted = before + commands.len() as f64 * (first - before);
        if !counts(before, first, second) || together.get(name) == Some(&wanted) {
            continue;
        }
        // Which one it does not count is seen where it comes alone.
        for (what, text, payload) in commands {
            let alone = plays.play(&one_by_one(plays, [(*text, *payload)]))?;
            if numbers(&alone).get(name) == Some(before) {
                return Err(RuleFailure::new(
                    format!("{what} counts as one of {SHORT_TEXT} bytes: {name} = {first}"),
                    format!("{name} = {before}"),
                ));
            }
        }
    }
    Ok(())
}

/// A robot that answers each of many commands also answers each of them where they are in the news of one tick.
fn many_sent(
    plays: &Plays<'_>,
    many: &mut Option<ManyPlays>,
    findings: &mut Findings,
) -> Result<(), RuleFailure> {
    // How many they are is the same in all parts, and takes long.
    if plays.part() != KitPart::Alone {
        return Ok(());
    }
    let none = sent(&commanded(plays, &[])?);
    for [text, _] in plays.pairs() {
        let once = sent(&commanded(plays, &[(&text, LAST)])?);
        if once <= none {
            continue;
        }

        let many = match many.take_if(|many| many.text == text) {
            Some(many) => many,
            None => ManyPlays::play(plays, &text)?,
        };
        let none = sent(&many.none);
        let apart = sent(&many.apart);
        let together = sent(&many.together);
        // Only one that has an answer to each in several ticks shows that it answers them all.
        let answers = sent(&many.once).saturating_sub(none);
        if answers == 0 || apart != none + many.count * answers {
            continue;
        }
        if together < apart {
            return Err(RuleFailure::new(
                format!(
                    "{apart} commands in answer to {} in the news of a tick, as to those of several ticks",
                    many.count
                ),
                format!("{together} commands"),
            ));
        }
        return Ok(());
    }

    findings.skip("command.sent", "the robot does not answer each command");
    Ok(())
}

/// How many commands the robot sent.
fn sent(transcript: &Transcript) -> usize {
    transcript.iter().map(|entry| entry.commands.len()).sum()
}

/// Where the payload of a robot's command makes a difference in what is reported, that of the operator's does. An answer to the sender
/// is an effect that the operator cannot have.
fn demand_payload_of_operator(plays: &Plays<'_>, text: &str) -> Result<(), RuleFailure> {
    let makes_difference = |from: &RobotName| {
        let plain = ArrivingCommand::new(from, text, LAST);
        let with_payload = plain.clone().with_payload(&json!({ "task": 3 }));
        let plain = plays.play(&PlayScript::with(TICKS, vec![plain]))?;
        let with_payload = plays.play(&PlayScript::with(TICKS, vec![with_payload]))?;
        Ok::<bool, RuleFailure>(values(&plain) != values(&with_payload))
    };
    if makes_difference(&plays.sender())? && !makes_difference(&RobotName::operator())? {
        return Err(RuleFailure::new(
            format!(
                "the payload of {text:?} from the operator makes a difference, as from a robot"
            ),
            "none",
        ));
    }
    Ok(())
}

/// A command from the operator, who is not a robot of the roster, is executed like any other, and not answered.
pub(super) fn from_operator(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let plays = &Plays::new(kit);
    let operator = RobotName::operator();
    let none = commanded(plays, &[])?;
    let mut is_seen = false;
    for [text, _] in plays.pairs() {
        let own = commanded(plays, &[(&text, LAST)])?;
        let from_operator = commanded_by(&operator, plays, &[(&text, LAST)])?;
        let answer = from_operator
            .iter()
            .flat_map(|entry| &entry.commands)
            .find(|sent| sent.to == operator.as_str());
        if answer.is_some() {
            return Err(RuleFailure::new(
                "no command to the operator, who is not a robot of the roster",
                format!("one, after {text:?} from the operator"),
            ));
        }

        let only_answers = values(&own) == values(&none);
        if plays.is_deterministic.get() == Some(&false) || only_answers || is_same(&own, &none) {
            continue;
        }

        is_seen = true;
        if plays.part() == KitPart::Alone {
            demand_payload_of_operator(plays, &text)?;
        }
        if is_same(&from_operator, &none) {
            let sender = plays.sender();
            return Err(RuleFailure::new(
                format!("{text:?} from the operator is executed like that from {sender}"),
                "it has no effect at all",
            ));
        }
    }

    if !is_seen {
        let reason = format!("no effect of {} is seen", shown(plays));
        findings.skip("operator.commands", &reason);
    }
    Ok(())
}
