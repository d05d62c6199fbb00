//! The emotions of robots as EmotionML 1.0 (W3C Recommendation, 22 May 2014).
//!
//! One `<emotion>` is a time without a break in which a robot is in one emotion. It has one vocabulary for each kind of
//! descriptor, so it cannot hold a category of this project beside one of W3C's, and a second `<emotion>` with the same times
//! would count every emotion twice. There are therefore two views of a run: one in the robots' own names, which the document
//! declares together with the nearest terms of W3C, and one in W3C's vocabularies only.
//!
//! The record is read tick by tick. Only emotions in progress are in memory, nine numbers a tick of each.

mod terms;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;

use affect::Schemata;
use affect::frame::{
    ACTION_TENDENCY, AGENCY, CAUSAL_CHAIN, CERTAINTY, CONTROLLABILITY, FACIAL_EXPRESSION, FOCALITY,
    GOAL_CONGRUENCE, INTENSITY, MODIFIABILITY, NOVELTY, URGENCY, VALENCE,
};
use protocol::keys::Keys;
use protocol::messages::{StateVariables, Variable};
use protocol::{Event, RobotName, RunName, Tick};
use record::{Entry, EpochFiles, Record, RecordError};
use timeline::{Span, StateKind, StateSpan, Timeline};

use crate::ExportError;
use terms::{escape, scale_value, token};

/// The agency of a robot that holds itself responsible.
const ONESELF: &str = "self";
/// Emotion states of robots without emotions.
const NO_EMOTION: [&str; 2] = ["", "NEUTRAL"];
/// The face that expresses nothing.
const NEUTRAL_FACE: &str = "neutral";
/// The vocabularies that a document declares: the kind of descriptor, the id, and what the names are.
const OWN: [(&str, &str, &str); 2] = [
    ("category", "cars-emotions", "emotion state"),
    (
        "action-tendency",
        "cars-action-tendencies",
        "action tendency",
    ),
];
/// Indices of [`OWN`].
const CATEGORY: usize = 0;
const TENDENCY: usize = 1;

/// State variables of the affect frame, and what they are in EmotionML: kind of descriptor, name, and offset and factor that make
/// a number from 0 to 1 of them. One that is out of this range has another meaning, and is not exported. The first one is
/// written tick by tick, and of all others the mean.
const MEASURES: [(&str, &str, &str, f64, f64); 9] = [
    (INTENSITY, "dimension", "intensity", 0.0, 1.0),
    (VALENCE, "dimension", "valence", 0.5, 0.5),
    (CERTAINTY, "dimension", "unpredictability", 1.0, -1.0),
    (AGENCY, "appraisal", "agency", 0.0, 1.0),
    (CONTROLLABILITY, "appraisal", "controllability", 0.0, 1.0),
    (URGENCY, "appraisal", "urgency", 0.0, 1.0),
    (GOAL_CONGRUENCE, "appraisal", "desirability", 0.5, 0.5),
    (NOVELTY, "appraisal", "unexpectedness", 0.0, 1.0),
    (MODIFIABILITY, "appraisal", "changeability", 0.0, 1.0),
];

/// What a robot publishes in a tick, in the order of [`MEASURES`].
type Sample = [Option<f64>; MEASURES.len()];

/// What a robot has published since its emotion began.
#[derive(Debug, Default)]
struct Published {
    samples: Vec<Sample>,
    /// The state variables of its first report.
    first: Option<StateVariables>,
    /// The agent other than itself that it held responsible last.
    other: Option<RobotName>,
}

/// Writes the emotions of the robots of an epoch, or of one of them. Returns what is left out, for people, a sentence each.
///
/// # Errors
/// [`ExportError`] if the record cannot be read to its end or has no such robot, or the document cannot be written. The
/// document has no end tag then, so no program takes it for a complete one.
pub fn write(
    files: &EpochFiles,
    run: &RunName,
    only: Option<&RobotName>,
    is_standard: bool,
    out: &mut impl Write,
) -> Result<Vec<String>, ExportError> {
    let mut record = Record::open(files)?;
    let path = files.events.display();
    let first = record.next_entry()?;
    let first =
        first.ok_or_else(|| RecordError::unusable(format!("{path} has no complete tick")))?;
    let Some(Event::Init { seed, tick_s, .. }) = first.events.first() else {
        return Err(RecordError::unusable(format!("{path} does not begin with `init`")).into());
    };
    let mut timeline = Timeline::default();
    timeline.tick(0, &first.events);
    let robots: Vec<&str> = timeline.robots().map(RobotName::as_str).collect();
    if let Some(only) = only.filter(|only| !robots.contains(&only.as_str())) {
        let robots = robots.join(", ");
        let reason = format!("no robot of this run is called {only}; there are {robots}");
        return Err(RecordError::unusable(reason).into());
    }

    let is_recorded = record.recording().is_some();
    let mut document = Document {
        out,
        keys: Keys::new(run),
        tick_s: *tick_s,
        only,
        is_standard,
        timeline: Timeline::default(),
        published: BTreeMap::new(),
        own: Default::default(),
        notes: BTreeSet::new(),
    };
    if !is_recorded {
        let note = "there is no recording (`[record] frames = false`?): nothing but times is known";
        document.notes.insert(note.to_owned());
    }
    document.begin(&format!("run {run}, epoch {}, seed {seed}", files.epoch))?;

    let mut next = Some(first);
    let mut last = 0;
    while let Some(entry) = next {
        if is_recorded && entry.reports.is_none() && !entry.is_end() {
            document.notes.insert(format!(
                "the recording was not finished: what comes after tick {last} is left out"
            ));
            break;
        }
        last = entry.tick;
        document.tick(&entry)?;
        next = record.next_entry()?;
    }
    document.end(last)
}

/// A document that is being written.
struct Document<'a, W: Write> {
    out: &'a mut W,
    keys: Keys,
    /// Length of a tick, simulated seconds.
    tick_s: f64,
    /// The robot that is exported, if it is not all of them.
    only: Option<&'a RobotName>,
    /// Whether only W3C's vocabularies are used.
    is_standard: bool,
    timeline: Timeline,
    published: BTreeMap<RobotName, Published>,
    /// The robots' own names written so far, of each vocabulary of [`OWN`].
    own: [BTreeSet<String>; 2],
    /// What is left out, for people.
    notes: BTreeSet<String>,
}

impl<W: Write> Document<'_, W> {
    fn begin(&mut self, run: &str) -> std::io::Result<()> {
        let clock = self.keys.clock();
        let tick_s = self.tick_s;
        writeln!(
            self.out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <emotionml version=\"1.0\" xmlns=\"http://www.w3.org/2009/10/emotionml\">\n  \
             <info>Emotions of robots in the simulated {run}. Times are simulated milliseconds since tick 0 of {clock}; a \
             tick lasts {tick_s} s and a trace has one sample a tick. Robots are named by their addresses on the network. A \
             category is as intense as its trace; dimensions and appraisals are means of what the robot published.</info>"
        )
    }

    /// Adds a tick, and writes the emotions that ended with it.
    fn tick(&mut self, entry: &Entry) -> std::io::Result<()> {
        for event in &entry.events {
            for span in self.timeline.apply(entry.tick, event) {
                self.span(&span, entry.tick)?;
            }
            // Also of an emotion that has lasted for no tick.
            if let Event::Emotion { robot, .. }
            | Event::Lost { robot }
            | Event::Joined { robot, .. } = event
            {
                self.published.insert(robot.clone(), Published::default());
            }
        }

        let Some(reports) = &entry.reports else {
            return Ok(());
        };
        for (robot, published) in &mut self.published {
            match reports.get(robot) {
                Some(report) => published.add(&report.state_variables),
                // It missed the tick: what it published last holds.
                None => published.samples.extend(published.samples.last().copied()),
            }
        }
        Ok(())
    }

    /// Writes what is over in a tick, if it is an emotion. One that begins in the last tick of a run lasts for no time.
    fn span(&mut self, span: &Span, tick: Tick) -> std::io::Result<()> {
        let Span::Stay(stay) = span else {
            return Ok(());
        };
        let is_wanted = self.only.is_none_or(|only| *only == stay.robot);
        let ticks = stay.period.ticks(tick);
        if stay.kind != StateKind::Emotion || !is_wanted || ticks == 0 {
            return Ok(());
        }
        let StateSpan {
            robot, name: state, ..
        } = stay;
        if NO_EMOTION.contains(&state.as_str()) {
            self.notes.insert(format!(
                "{robot} has a state without emotion, {state:?}, which is left out"
            ));
            return Ok(());
        }

        let published = self.published.get_mut(robot).map(std::mem::take);
        let published = published.unwrap_or_default().until(ticks);
        let trace = published.all(0);
        if trace.is_none() && published.first.is_some() {
            self.notes.insert(format!(
                "{robot} does not publish `{INTENSITY}` between 0 and 1 in every tick; emotions with such ticks have no intensity"
            ));
        }
        let (sets, descriptors) = self.descriptors(state, &published, trace.as_deref());
        if descriptors.is_empty() {
            self.notes.insert(format!(
                "emotions {state:?} are left out: no standard vocabulary has a term for it"
            ));
            return Ok(());
        }

        let begin_ms = self.milliseconds(stay.period.begin);
        let duration_ms = self.milliseconds(stay.period.begin + ticks) - begin_ms;
        let clock = self.keys.clock();
        let face = published
            .text(FACIAL_EXPRESSION)
            .filter(|face| *face != NEUTRAL_FACE);
        let face = face.map_or("", |_| " expressed-through=\"face\"");
        writeln!(
            self.out,
            "  <emotion id=\"emotion.{robot}.{}\" time-ref-uri=\"{clock}\" offset-to-start=\"{begin_ms}\" \
             duration=\"{duration_ms}\"{sets}{face}>",
            stay.period.begin
        )?;
        let about = [FOCALITY, CAUSAL_CHAIN].map(|name| published.text(name));
        let about: Vec<&str> = about.into_iter().flatten().collect();
        if !about.is_empty() {
            writeln!(self.out, "    <info>{}</info>", escape(&about.join("; ")))?;
        }
        self.out.write_all(descriptors.as_bytes())?;
        self.reference(robot, "experiencedBy")?;
        if let Some(other) = published
            .other
            .filter(|other| self.published.contains_key(other))
        {
            self.reference(&other, "targetedAt")?;
        }
        writeln!(self.out, "  </emotion>")
    }

    /// The `*-set` attributes and the descriptors of an emotion, ordered by kind. The schema allows a value or a trace for each,
    /// not both.
    fn descriptors(
        &mut self,
        state: &str,
        published: &Published,
        trace: Option<&[f64]>,
    ) -> (String, String) {
        let mut sets = String::new();
        let mut elements = String::new();
        let mut add = |kind: &str, set: &str, name: &str, scale: &str| {
            let attribute = format!(" {kind}-set=\"{set}\"");
            if !sets.contains(&attribute) {
                sets += &attribute;
            }
            elements += &format!("    <{kind} name=\"{name}\"{scale}\n");
        };
        let frequency = 1.0 / self.tick_s;
        let traced = |kind: &str| {
            let Some(trace) = trace else {
                return "/>".to_owned();
            };
            let samples: Vec<String> = trace.iter().copied().map(scale_value).collect();
            let samples = samples.join(" ");
            format!("><trace freq=\"{frequency}Hz\" samples=\"{samples}\"/></{kind}>")
        };

        let category = self.term(CATEGORY, state);
        if let Some((set, name)) = &category {
            add("category", set, name, &traced("category"));
        } else if trace.is_some() {
            // The vocabulary of this dimension has no other one, so all others are left out.
            let set = terms::w3c("intensity-dimension");
            add("dimension", &set, "intensity", &traced("dimension"));
        }
        for (index, (_, kind, name, ..)) in MEASURES.iter().enumerate().skip(1) {
            let set = match *kind {
                "dimension" if category.is_none() => continue,
                "dimension" => terms::w3c("fsre-dimensions"),
                _ => terms::w3c("ema-appraisals"),
            };
            if let Some(samples) = published.all(index) {
                let mean = samples.iter().sum::<f64>() / samples.len() as f64;
                let value = format!(" value=\"{}\"/>", scale_value(mean));
                add(kind, &set, name, &value);
            }
        }
        // Where it is not recorded, it is that of the standard emotion.
        let schema = Schemata::standard().get(state);
        let tendency = published.text(ACTION_TENDENCY);
        let tendency = tendency.or(schema.map(|schema| schema.action_tendency.name()));
        if let Some((set, name)) = tendency.and_then(|name| self.term(TENDENCY, name)) {
            add("action-tendency", &set, &name, "/>");
        }
        (sets, elements)
    }

    /// The vocabulary and the term for a name of a robot's, which is declared at the end of the document unless it is W3C's.
    fn term(&mut self, index: usize, name: &str) -> Option<(String, String)> {
        let (kind, id, _) = OWN[index];
        if self.is_standard {
            return terms::nearest(kind, name);
        }
        self.own[index].insert(name.to_owned());
        Some((format!("#{id}"), token(name)))
    }

    fn reference(&mut self, robot: &RobotName, role: &str) -> std::io::Result<()> {
        // The common prefix of the keys at which the robot answers queries.
        let uri = self.keys.query(robot, "");
        let uri = uri.trim_end_matches('/');
        writeln!(self.out, "    <reference uri=\"{uri}\" role=\"{role}\"/>")
    }

    fn milliseconds(&self, tick: Tick) -> u64 {
        (tick as f64 * self.tick_s * 1000.0).round() as u64
    }

    /// Writes what lasts until the end of the run, the vocabularies, and the end tag. Returns the notes.
    fn end(mut self, last: Tick) -> Result<Vec<String>, ExportError> {
        for span in self.timeline.in_progress() {
            self.span(&span, last)?;
        }

        for ((kind, id, what), names) in OWN.iter().zip(&self.own) {
            // The schema requires an item.
            if names.is_empty() {
                continue;
            }
            writeln!(self.out, "  <vocabulary type=\"{kind}\" id=\"{id}\">")?;
            for name in names {
                let nearest = terms::nearest(kind, name);
                let nearest = nearest.map(|(set, term)| format!("; nearest: {term} of {set}"));
                let info = format!("{what} {}{}", escape(name), nearest.unwrap_or_default());
                let token = token(name);
                writeln!(
                    self.out,
                    "    <item name=\"{token}\"><info>{info}</info></item>"
                )?;
            }
            writeln!(self.out, "  </vocabulary>")?;
        }
        writeln!(self.out, "</emotionml>")?;
        self.out.flush()?;
        Ok(self.notes.into_iter().collect())
    }
}

impl Published {
    fn add(&mut self, variables: &StateVariables) {
        self.samples
            .push(MEASURES.map(|(name, _, _, offset, factor)| {
                let value = match variables.get(name)? {
                    Variable::Number(number) if name != AGENCY => offset + factor * number,
                    Variable::Text(agent) if name == AGENCY && !agent.is_empty() => {
                        f64::from(u8::from(agent == ONESELF))
                    }
                    _ => return None,
                };
                (0.0..=1.0).contains(&value).then_some(value)
            }));
        let agent = variables.get(AGENCY).and_then(Variable::as_str);
        let other = agent.filter(|agent| *agent != ONESELF);
        self.other = other
            .and_then(|other| RobotName::new(other).ok())
            .or(self.other.take());
        self.first.get_or_insert_with(|| variables.clone());
    }

    /// The first ticks; none if some of them are missing.
    fn until(mut self, ticks: Tick) -> Self {
        let ticks = usize::try_from(ticks).unwrap_or(usize::MAX);
        let is_whole = self.samples.len() >= ticks;
        self.samples.truncate(if is_whole { ticks } else { 0 });
        self
    }

    /// A measure in each tick, if it was published in all of them: EmotionML has no traces with gaps.
    fn all(&self, measure: usize) -> Option<Vec<f64>> {
        let samples = self.samples.iter().map(|sample| sample[measure]);
        let all: Option<Vec<f64>> = samples.collect();
        all.filter(|all| !all.is_empty())
    }

    /// A text of the first report.
    fn text(&self, name: &str) -> Option<&str> {
        let text = self.first.as_ref()?.get(name)?.as_str();
        text.filter(|text| !text.is_empty())
    }
}
