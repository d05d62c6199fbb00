//! The emotions of robots as EmotionML 1.0 (W3C Recommendation, 22 May 2014).
//!
//! One `<emotion>` is a time without a break in which a robot is in one emotion. It has one vocabulary for each kind of
//! descriptor, so it cannot hold a category of this project beside one of W3C's, and a second `<emotion>` with the same times
//! would count every emotion twice. There are therefore two views of a run: one in the robots' own names, which the document
//! declares together with the nearest terms of W3C, and one in W3C's vocabularies only.
//!
//! The record is read tick by tick. Only emotions in progress are in memory, seven numbers a tick of each.

mod terms;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;

use affect::Schemata;
use affect::frame::{
    ACTION_TENDENCY, AGENCY, CERTAINTY, CONTROLLABILITY, FACE, GOAL_CONGRUENCE, INTENSITY, URGENCY,
    VALENCE,
};
use config::FileError;
use protocol::keys::Keys;
use protocol::messages::{StateVariables, Variable};
use protocol::{Event, RobotName, RunName, Tick};
use record::{Entry, EpochFiles, Record};
use timeline::{Kind, States, Stay};

use crate::ExportError;
use terms::{escape, scale_value, token};

/// The agency of a robot that holds itself responsible.
const ONESELF: &str = "self";
/// Emotion states of robots without emotions.
const NO_EMOTION: [&str; 2] = ["", "NEUTRAL"];
/// The face that expresses nothing.
const NEUTRAL_FACE: &str = "neutral";
/// Ids of the vocabularies that the document declares.
const EMOTIONS: &str = "cars-emotions";
const TENDENCIES: &str = "cars-action-tendencies";

/// A state variable of the affect frame, and what it is in EmotionML: a number between 0 and 1.
struct Measure {
    variable: &'static str,
    /// Its least value. The greatest one is 1; a number out of the range has another meaning, and is not exported.
    min: f64,
    element: &'static str,
    name: &'static str,
    /// The scale of EmotionML, from the mean of the variable.
    scale: fn(f64) -> f64,
}

const fn measure(
    variable: &'static str,
    min: f64,
    element: &'static str,
    name: &'static str,
    scale: fn(f64) -> f64,
) -> Measure {
    Measure {
        variable,
        min,
        element,
        name,
        scale,
    }
}

/// The first one is written as a trace, tick by tick, and all others as means.
const MEASURES: [Measure; 7] = [
    measure(INTENSITY, 0.0, "dimension", "intensity", |mean| mean),
    measure(VALENCE, -1.0, "dimension", "valence", halved),
    measure(CERTAINTY, 0.0, "dimension", "unpredictability", |mean| {
        1.0 - mean
    }),
    measure(AGENCY, 0.0, "appraisal", "agency", |mean| mean),
    measure(
        CONTROLLABILITY,
        0.0,
        "appraisal",
        "controllability",
        |mean| mean,
    ),
    measure(URGENCY, 0.0, "appraisal", "urgency", |mean| mean),
    measure(GOAL_CONGRUENCE, -1.0, "appraisal", "desirability", halved),
];

/// A number between -1 and 1 on a scale from 0 to 1.
fn halved(mean: f64) -> f64 {
    0.5 + 0.5 * mean
}

/// What a robot publishes in a tick, in the order of [`MEASURES`].
type Sample = [Option<f64>; MEASURES.len()];

/// What a robot has published since its emotion began.
#[derive(Debug, Default)]
struct Published {
    samples: Vec<Sample>,
    /// The state variables of its first report.
    first: Option<StateVariables>,
    /// The agent other than itself that it held responsible last.
    other: Option<String>,
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
    let first = first.ok_or_else(|| FileError::new(format!("{path} has no complete tick")))?;
    let Some(Event::Init { seed, tick_s, .. }) = first.events.first() else {
        return Err(FileError::new(format!("{path} does not begin with `init`")).into());
    };
    check_robot(only, &first)?;

    let is_recorded = record.recording().is_some();
    let mut document = Document {
        keys: Keys::new(run),
        tick_s: *tick_s,
        only,
        is_standard,
        is_recorded,
        states: States::default(),
        published: BTreeMap::new(),
        emotions: BTreeSet::new(),
        tendencies: BTreeSet::new(),
        notes: BTreeSet::new(),
        out,
    };
    if !is_recorded {
        document.notes.insert(
            "there is no recording (`[record] frames = false`?): the events have no intensities"
                .to_owned(),
        );
    }
    document.begin(&format!("run {run}, epoch {}, seed {seed}", files.epoch))?;

    let mut next = Some(first);
    let mut last = 0;
    while let Some(entry) = next {
        let is_lacking = is_recorded && entry.reports.is_none() && !entry.is_end();
        if is_lacking {
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

fn check_robot(only: Option<&RobotName>, first: &Entry) -> Result<(), FileError> {
    let robots = first.events.iter().filter_map(|event| match event {
        Event::Joined { robot, .. } => Some(robot),
        _ => None,
    });
    let names: Vec<&str> = robots.map(RobotName::as_str).collect();
    match only {
        Some(only) if !names.contains(&only.as_str()) => Err(FileError::new(format!(
            "no robot of this run is called {only}; there are {}",
            names.join(", ")
        ))),
        _ => Ok(()),
    }
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
    is_recorded: bool,
    states: States,
    published: BTreeMap<RobotName, Published>,
    /// Emotions written so far, for the vocabulary.
    emotions: BTreeSet<String>,
    /// Action tendencies written so far, for the vocabulary.
    tendencies: BTreeSet<String>,
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
            for stay in self.states.apply(entry.tick, event) {
                self.stay(&stay)?;
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

    /// Writes what is over, if it is an emotion.
    fn stay(&mut self, stay: &Stay) -> std::io::Result<()> {
        let is_wanted = self.only.is_none_or(|only| *only == stay.robot);
        if stay.kind != Kind::Emotion || !is_wanted {
            return Ok(());
        }
        let Stay { robot, state, .. } = stay;
        if NO_EMOTION.contains(&state.as_str()) {
            self.notes.insert(format!(
                "{robot} has a state without emotion, {state:?}, which is left out"
            ));
            return Ok(());
        }

        let published = self
            .published
            .get_mut(robot)
            .map(std::mem::take)
            .unwrap_or_default();
        let trace = published.trace(0, stay);
        if trace.is_none() && self.is_recorded {
            self.notes.insert(format!(
                "{robot} does not publish `{INTENSITY}` between 0 and 1 in every tick; emotions with such ticks have no intensity"
            ));
        }
        let trace = trace.map(|samples| {
            let samples: Vec<String> = samples.into_iter().map(scale_value).collect();
            format!(
                "<trace freq=\"{}Hz\" samples=\"{}\"/>",
                1.0 / self.tick_s,
                samples.join(" ")
            )
        });
        let (sets, elements) = self.descriptors(stay, &published, trace.as_deref());
        if elements.is_empty() {
            self.notes.insert(format!(
                "emotions {state:?} are left out: no standard vocabulary has a term for it"
            ));
            return Ok(());
        }

        let begin_ms = self.milliseconds(stay.begin);
        let duration_ms = self.milliseconds(stay.end) - begin_ms;
        let clock = self.keys.clock();
        let face = published.text(FACE).filter(|face| *face != NEUTRAL_FACE);
        let face = face.map_or("", |_| " expressed-through=\"face\"");
        write!(
            self.out,
            "  <emotion id=\"emotion.{robot}.{}\" time-ref-uri=\"{clock}\" offset-to-start=\"{begin_ms}\" \
             duration=\"{duration_ms}\"{sets}{face}>\n{elements}",
            stay.begin
        )?;
        self.reference(robot, "experiencedBy")?;
        let other = published
            .other
            .and_then(|other| RobotName::new(&other).ok());
        if let Some(other) = other.filter(|other| self.published.contains_key(other)) {
            self.reference(&other, "targetedAt")?;
        }
        writeln!(self.out, "  </emotion>")
    }

    /// The `*-set` attributes and the descriptors of an emotion, ordered by kind. The schema allows a value or a trace for each,
    /// not both.
    fn descriptors(
        &mut self,
        stay: &Stay,
        published: &Published,
        trace: Option<&str>,
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
        let traced = |kind: &str| match trace {
            Some(trace) => format!(">{trace}</{kind}>"),
            None => "/>".to_owned(),
        };

        let category = if self.is_standard {
            terms::nearest_category(&stay.state)
        } else {
            self.emotions.insert(stay.state.clone());
            Some((format!("#{EMOTIONS}"), token(&stay.state)))
        };
        match &category {
            Some((set, name)) => add("category", set, name, &traced("category")),
            // Its vocabulary has no other dimension, so these are left out.
            None if trace.is_some() => {
                add(
                    "dimension",
                    &terms::w3c("intensity-dimension"),
                    "intensity",
                    &traced("dimension"),
                );
            }
            None => {}
        }

        for (index, measure) in MEASURES.iter().enumerate().skip(1) {
            let set = match measure.element {
                "dimension" if category.is_none() => continue,
                "dimension" => "fsre-dimensions",
                _ => "ema-appraisals",
            };
            if let Some(samples) = published.trace(index, stay) {
                let mean = samples.iter().sum::<f64>() / samples.len() as f64;
                let value = scale_value((measure.scale)(mean));
                add(
                    measure.element,
                    &terms::w3c(set),
                    measure.name,
                    &format!(" value=\"{value}\"/>"),
                );
            }
        }

        let schema = Schemata::standard().get(&stay.state);
        let tendency = published
            .text(ACTION_TENDENCY)
            .filter(|name| !name.is_empty());
        if let Some(name) = tendency.or(schema.map(|schema| schema.action_tendency.name())) {
            let term = if self.is_standard {
                terms::nearest_tendency(name)
            } else {
                self.tendencies.insert(name.to_owned());
                Some((format!("#{TENDENCIES}"), token(name)))
            };
            if let Some((set, name)) = term {
                add("action-tendency", &set, &name, "/>");
            }
        }
        (sets, elements)
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
        for stay in self.states.lasting(last) {
            self.stay(&stay)?;
        }

        let emotions = std::mem::take(&mut self.emotions);
        self.vocabulary(
            "category",
            EMOTIONS,
            "emotion state",
            &emotions,
            terms::nearest_category,
        )?;
        let tendencies = std::mem::take(&mut self.tendencies);
        self.vocabulary(
            "action-tendency",
            TENDENCIES,
            "action tendency",
            &tendencies,
            terms::nearest_tendency,
        )?;
        writeln!(self.out, "</emotionml>")?;
        self.out.flush()?;
        Ok(self.notes.into_iter().collect())
    }

    /// Declares names, with the nearest terms of W3C. An empty vocabulary is left out: the schema requires an item.
    fn vocabulary(
        &mut self,
        kind: &str,
        id: &str,
        what: &str,
        names: &BTreeSet<String>,
        nearest: fn(&str) -> Option<(String, String)>,
    ) -> std::io::Result<()> {
        if names.is_empty() {
            return Ok(());
        }

        writeln!(self.out, "  <vocabulary type=\"{kind}\" id=\"{id}\">")?;
        for name in names {
            let nearest = nearest(name).map(|(set, term)| format!("; nearest: {term} of {set}"));
            writeln!(
                self.out,
                "    <item name=\"{}\"><info>{what} {}{}</info></item>",
                token(name),
                escape(name),
                nearest.unwrap_or_default()
            )?;
        }
        writeln!(self.out, "  </vocabulary>")
    }
}

impl Published {
    fn add(&mut self, variables: &StateVariables) {
        self.samples
            .push(MEASURES.each_ref().map(|measure| measure.of(variables)));
        if let Some(Variable::Text(agent)) = variables.get(AGENCY)
            && !agent.is_empty()
            && agent != ONESELF
        {
            self.other = Some(agent.clone());
        }
        self.first.get_or_insert_with(|| variables.clone());
    }

    /// A measure in each tick of an emotion, if it was published in all of them: EmotionML has no traces with gaps.
    fn trace(&self, measure: usize, stay: &Stay) -> Option<Vec<f64>> {
        let ticks = usize::try_from(stay.ticks()).ok()?;
        self.samples
            .get(..ticks)?
            .iter()
            .map(|sample| sample[measure])
            .collect()
    }

    /// A text of the first report.
    fn text(&self, name: &str) -> Option<&str> {
        self.first.as_ref()?.get(name)?.as_str()
    }
}

impl Measure {
    fn of(&self, variables: &StateVariables) -> Option<f64> {
        match variables.get(self.variable)? {
            Variable::Text(agent) if self.variable == AGENCY && !agent.is_empty() => {
                Some(f64::from(u8::from(agent == ONESELF)))
            }
            Variable::Number(number) if self.variable != AGENCY => {
                Some(*number).filter(|number| (self.min..=1.0).contains(number))
            }
            _ => None,
        }
    }
}
