//! Writes the document: its head, an `<emotion>` for each episode, and at the end the vocabularies, when they are known.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use affect::akr::ActionTendency;
use affect::frame::{
    ACTION_TENDENCY, CERTAINTY, CONTROLLABILITY, FACE, GOAL_CONGRUENCE, URGENCY, VALENCE,
};
use affect::{Circumstances, Schema, Schemata};
use protocol::RobotName;
use protocol::keys::Keys;
use protocol::messages::Parameters;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};

use super::episode::Episode;
use super::reader::Facts;
use super::terms::{self, Term};

const NAMESPACE: &str = "http://www.w3.org/2009/10/emotionml";
const ROOT: &str = "emotionml";

/// Ids of the vocabularies that the document declares.
const EMOTIONS: &str = "cars-emotions";
const TENDENCIES: &str = "cars-action-tendencies";

/// The face that expresses nothing.
const NEUTRAL_FACE: &str = "neutral";

/// A document that is being written.
pub(super) struct Document<W: Write> {
    xml: Writer<W>,
    facts: Facts,
    keys: Keys,
    /// Names of the robots, which can be targets of emotions.
    roster: BTreeSet<RobotName>,
    /// Whether only W3C's vocabularies are used.
    is_standard: bool,
    /// Emotions written so far, for the vocabulary.
    emotions: BTreeSet<String>,
    /// Action tendencies written so far, for the vocabulary.
    tendencies: BTreeSet<String>,
    /// Number of episodes left out, by emotion: this view has no term for it.
    left_out: BTreeMap<String, u64>,
}

/// One element of an `<emotion>`, such as its category.
struct Descriptor {
    kind: Kind,
    /// URI of the vocabulary of its name, for the `*-set` attribute; the same for all of a kind.
    set: String,
    name: String,
    scale: Scale,
}

/// The four kinds of descriptors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Category,
    Dimension,
    Appraisal,
    ActionTendency,
}

/// Strength of a descriptor. The schema allows a value or a trace, not both.
enum Scale {
    /// Not given.
    Unknown,
    Value(f64),
    /// The intensity of the episode, tick by tick.
    Trace,
}

impl Kind {
    fn element(self) -> &'static str {
        match self {
            Self::Category => "category",
            Self::Dimension => "dimension",
            Self::Appraisal => "appraisal",
            Self::ActionTendency => "action-tendency",
        }
    }

    fn set_attribute(self) -> &'static str {
        match self {
            Self::Category => "category-set",
            Self::Dimension => "dimension-set",
            Self::Appraisal => "appraisal-set",
            Self::ActionTendency => "action-tendency-set",
        }
    }
}

impl Descriptor {
    fn of_w3c(kind: Kind, term: Term, scale: Scale) -> Self {
        Self {
            kind,
            set: term.set(),
            name: term.name.to_owned(),
            scale,
        }
    }

    fn own(kind: Kind, vocabulary: &str, name: String, scale: Scale) -> Self {
        Self {
            kind,
            set: format!("#{vocabulary}"),
            name,
            scale,
        }
    }

    fn dimension(term: Term, value: f64) -> Self {
        Self::of_w3c(Kind::Dimension, term, Scale::Value(value))
    }

    fn appraisal(term: Term, value: f64) -> Self {
        Self::of_w3c(Kind::Appraisal, term, Scale::Value(value))
    }
}

impl<W: Write> Document<W> {
    /// Writes the head of a document.
    pub(super) fn begin(
        out: W,
        facts: Facts,
        roster: BTreeSet<RobotName>,
        is_standard: bool,
    ) -> io::Result<Self> {
        let mut xml = Writer::new_with_indent(out, b' ', 2);
        xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        let root =
            BytesStart::new(ROOT).with_attributes([("version", "1.0"), ("xmlns", NAMESPACE)]);
        xml.write_event(Event::Start(root))?;
        let keys = Keys::new(&facts.run);
        write_info(&mut xml, &about(&facts, &keys))?;

        Ok(Self {
            xml,
            facts,
            keys,
            roster,
            is_standard,
            emotions: BTreeSet::new(),
            tendencies: BTreeSet::new(),
            left_out: BTreeMap::new(),
        })
    }

    /// Writes an episode.
    pub(super) fn emotion(&mut self, episode: &Episode) -> io::Result<()> {
        let emotion = &episode.begun.emotion;
        let schema = Schemata::standard().get(emotion);
        let descriptors = self.descriptors(episode, schema);
        if descriptors.is_empty() {
            *self.left_out.entry(emotion.clone()).or_default() += 1;
            return Ok(());
        }

        if !self.is_standard {
            self.emotions.insert(emotion.clone());
            self.tendencies
                .extend(tendency(episode, schema).map(str::to_owned));
        }

        let explanation = schema.map(|schema| explanation(schema, episode, &self.facts));
        let other = episode.other.as_deref();
        let targeted_at = other.and_then(|other| self.target(other));
        let experienced_by = self.robot_uri(&episode.begun.name);
        let trace = episode.intensity().map(samples);
        let frequency = format!("{}Hz", 1.0 / self.facts.tick_s);
        let time = self.time_attributes(episode);

        let element = self.xml.create_element("emotion");
        let element = element.with_attributes(time.iter().map(|(key, value)| (*key, &**value)));
        let element = element.with_attributes(sets(&descriptors));
        let element = element.with_attributes(expressed_through(episode, schema));
        element.write_inner_content(|xml| {
            if let Some(explanation) = &explanation {
                write_info(xml, explanation)?;
            }
            for descriptor in &descriptors {
                write_descriptor(xml, descriptor, trace.as_deref(), &frequency)?;
            }
            write_reference(xml, &experienced_by, "experiencedBy")?;
            targeted_at.map_or(Ok(()), |uri| write_reference(xml, &uri, "targetedAt"))
        })?;

        // A program that follows the output sees complete emotions only.
        self.xml.get_mut().flush()
    }

    /// Id, reference clock, begin and duration of an episode.
    fn time_attributes(&self, episode: &Episode) -> [(&'static str, String); 4] {
        let name = &episode.begun.name;
        let begin_ms = milliseconds(episode.first, self.facts.tick_s);
        let duration_ms = duration_ms(episode, self.facts.tick_s);

        [
            ("id", format!("emotion.{name}.{}", episode.first)),
            ("time-ref-uri", self.keys.clock()),
            ("offset-to-start", begin_ms.to_string()),
            ("duration", duration_ms.to_string()),
        ]
    }

    /// Writes the vocabularies and the end tag. Returns notes about episodes that were left out.
    pub(super) fn end(mut self) -> io::Result<Vec<String>> {
        let mut emotions = Vec::new();
        for name in &self.emotions {
            emotions.push((terms::token(name), describe_emotion(name)));
        }
        write_vocabulary(&mut self.xml, "category", EMOTIONS, emotions)?;

        let mut tendencies = Vec::new();
        for tendency in &self.tendencies {
            tendencies.push((terms::token(tendency), describe_tendency(tendency)));
        }
        write_vocabulary(&mut self.xml, "action-tendency", TENDENCIES, tendencies)?;

        self.xml.write_event(Event::End(BytesEnd::new(ROOT)))?;
        self.xml.get_mut().write_all(b"\n")?;
        Ok(self.notes())
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (name, count) in &self.left_out {
            notes.push(format!(
                "{count} episodes of {name:?} are left out: no standard vocabulary has a term for it"
            ));
        }
        notes
    }

    /// The descriptors of an episode, ordered by kind.
    fn descriptors(&self, episode: &Episode, schema: Option<&Schema>) -> Vec<Descriptor> {
        let category = self.category(episode);
        let dimensions = if self.is_standard && category.is_none() {
            intensity(episode)
        } else {
            dimensions(episode)
        };

        let mut descriptors = Vec::new();
        descriptors.extend(category);
        descriptors.extend(dimensions);
        descriptors.extend(appraisals(episode));
        descriptors.extend(tendency(episode, schema).and_then(|name| self.tendency(name)));

        descriptors
    }

    fn category(&self, episode: &Episode) -> Option<Descriptor> {
        let emotion = &episode.begun.emotion;
        let scale = if episode.intensity().is_some() {
            Scale::Trace
        } else {
            Scale::Unknown
        };

        let kind = Kind::Category;
        if self.is_standard {
            let term = terms::nearest_category(emotion)?;
            return Some(Descriptor::of_w3c(kind, term, scale));
        }

        let name = terms::token(emotion);
        Some(Descriptor::own(kind, EMOTIONS, name, scale))
    }

    fn tendency(&self, name: &str) -> Option<Descriptor> {
        let kind = Kind::ActionTendency;
        if self.is_standard {
            let tendency = ActionTendency::named(name)?;
            let term = terms::nearest_tendency(tendency)?;
            return Some(Descriptor::of_w3c(kind, term, Scale::Unknown));
        }

        let name = terms::token(name);
        Some(Descriptor::own(kind, TENDENCIES, name, Scale::Unknown))
    }

    fn robot_uri(&self, name: &RobotName) -> String {
        // The common prefix of the keys at which the robot answers queries.
        self.keys.query(name, "").trim_end_matches('/').to_owned()
    }

    fn target(&self, other: &str) -> Option<String> {
        self.roster.get(other).map(|robot| self.robot_uri(robot))
    }
}

/// The cause of an emotion in words.
///
/// Reads state variables of the shipped robots: `refiller` and `treats` of a waiter, `waiter` of a refiller. The
/// explanation of a robot without these variables has fewer details.
fn explanation(schema: &Schema, episode: &Episode, facts: &Facts) -> String {
    let begun = &episode.begun;
    let parameters = facts.parameters.get(&begun.name);
    let goods = text_of(parameters, "goods").unwrap_or("treats");
    let treats = begun.number("treats");
    let amount = treats.map(|treats| format!("{treats} {goods}"));

    let refiller = begun.text("refiller");
    let waiter = begun.text("waiter");
    let other = refiller.or(episode.other.as_deref()).or(waiter);

    let own_goal = text_of(parameters, "goal").map(str::to_owned);
    let goal = own_goal.or(waiter.map(|waiter| format!("to bring {goods} to {waiter}")));

    let circumstances = Circumstances {
        other,
        goal: goal.as_deref(),
        amount: amount.as_deref(),
    };
    schema.spoken(&circumstances)
}

/// A parameter of a robot that is a text.
fn text_of<'a>(parameters: Option<&'a Parameters>, name: &str) -> Option<&'a str> {
    parameters?.get(name)?.as_str()
}

/// The action tendency that a robot publishes, or that of the standard emotion.
fn tendency<'a>(episode: &'a Episode, schema: Option<&Schema>) -> Option<&'a str> {
    let published = episode.begun.text(ACTION_TENDENCY);
    let published = published.filter(|name| !name.is_empty());

    published.or(schema.map(|schema| schema.action_tendency.name()))
}

/// The `expressed-through` attribute; a neutral face expresses nothing.
fn expressed_through(
    episode: &Episode,
    schema: Option<&Schema>,
) -> Option<(&'static str, &'static str)> {
    let of_schema = schema.map(|schema| schema.facial_expression.name());
    let face = episode.begun.text(FACE).or(of_schema)?;

    (face != NEUTRAL_FACE).then_some(("expressed-through", "face"))
}

/// Valence and unpredictability, as far as they are published.
fn dimensions(episode: &Episode) -> Vec<Descriptor> {
    let mut dimensions = Vec::new();
    if let Some(valence) = episode.mean(VALENCE) {
        dimensions.push(Descriptor::dimension(terms::VALENCE, halved(valence)));
    }
    if let Some(certainty) = episode.mean(CERTAINTY) {
        let unpredictability = 1.0 - certainty;
        dimensions.push(Descriptor::dimension(
            terms::UNPREDICTABILITY,
            unpredictability,
        ));
    }

    dimensions
}

/// The intensity as a dimension, for an emotion without a category. Its vocabulary has no other dimension.
fn intensity(episode: &Episode) -> Vec<Descriptor> {
    let mut dimensions = Vec::new();
    if episode.intensity().is_some() {
        let intensity = Descriptor::of_w3c(Kind::Dimension, terms::INTENSITY, Scale::Trace);
        dimensions.push(intensity);
    }

    dimensions
}

/// The robot's appraisals, as far as they are published.
fn appraisals(episode: &Episode) -> Vec<Descriptor> {
    let values = [
        (terms::AGENCY, episode.own_doing()),
        (terms::CONTROLLABILITY, episode.mean(CONTROLLABILITY)),
        (terms::URGENCY, episode.mean(URGENCY)),
        (
            terms::DESIRABILITY,
            episode.mean(GOAL_CONGRUENCE).map(halved),
        ),
    ];

    let mut appraisals = Vec::new();
    for (term, value) in values {
        appraisals.extend(value.map(|value| Descriptor::appraisal(term, value)));
    }
    appraisals
}

/// A number between -1 and 1 on the scale of EmotionML, 0 to 1.
fn halved(value: f64) -> f64 {
    0.5 + 0.5 * value
}

fn samples(values: &[f64]) -> String {
    let samples: Vec<String> = values.iter().copied().map(terms::scale_value).collect();
    samples.join(" ")
}

fn milliseconds(tick: u64, tick_s: f64) -> u64 {
    (tick as f64 * tick_s * 1000.0).round() as u64
}

/// Duration of an episode, which ends where the next one begins.
fn duration_ms(episode: &Episode, tick_s: f64) -> u64 {
    milliseconds(episode.end, tick_s) - milliseconds(episode.first, tick_s)
}

/// The `*-set` attributes: one for each kind that occurs.
fn sets(descriptors: &[Descriptor]) -> Vec<(&'static str, &str)> {
    let mut sets: Vec<(&'static str, &str)> = descriptors
        .iter()
        .map(|one| (one.kind.set_attribute(), one.set.as_str()))
        .collect();
    sets.dedup();
    sets
}

/// The description of the document: its run, and how times and traces are to be read.
fn about(facts: &Facts, keys: &Keys) -> String {
    let Facts {
        run,
        seed,
        tick_s,
        file,
        ..
    } = facts;
    let epoch = match facts.epoch {
        Some(epoch) => format!(", epoch {epoch}"),
        None => String::new(),
    };

    format!(
        "Emotions of robots in the simulated run {run}{epoch}, seed {seed}, from its {file}, by cars {}. \
         Times are simulated milliseconds since tick 0 of {}; a tick lasts {tick_s} s and a trace has one sample a tick, \
         each of which lasts until the next tick; the run ends with its last tick, so the sample of that lasts for no time. \
         Robots are named by their addresses on the network. A category is as intense as its trace; dimensions and \
         appraisals are means over the episode of what the robot published.",
        env!("CARGO_PKG_VERSION"),
        keys.clock()
    )
}

fn describe_emotion(name: &str) -> String {
    let mut parts = vec![format!("emotion state {name}")];
    if let Some(term) = terms::nearest_category(name) {
        parts.push(format!("nearest: {}", term.in_words()));
    }
    if let Some(schema) = Schemata::standard().get(name) {
        parts.push(format!("face: {}", schema.facial_expression.name()));
    }
    parts.join("; ")
}

fn describe_tendency(name: &str) -> String {
    let mut parts = vec![format!("action tendency {name}")];
    let known = ActionTendency::named(name);
    if let Some(function) = known.and_then(ActionTendency::function) {
        parts.push(format!("function: {function}"));
    }
    if let Some(term) = known.and_then(terms::nearest_tendency) {
        parts.push(format!("nearest: {}", term.in_words()));
    }
    parts.join("; ")
}

fn write_info<W: Write>(xml: &mut Writer<W>, text: &str) -> io::Result<()> {
    xml.create_element("info")
        .write_text_content(BytesText::new(&terms::text(text)))?;
    Ok(())
}

fn write_descriptor<W: Write>(
    xml: &mut Writer<W>,
    descriptor: &Descriptor,
    trace: Option<&str>,
    frequency: &str,
) -> io::Result<()> {
    let element = xml.create_element(descriptor.kind.element());
    let element = element.with_attribute(("name", descriptor.name.as_str()));

    match (&descriptor.scale, trace) {
        (Scale::Value(value), _) => element
            .with_attribute(("value", terms::scale_value(*value).as_str()))
            .write_empty()?,
        (Scale::Trace, Some(samples)) => element.write_inner_content(|xml| {
            let trace = xml.create_element("trace");
            trace
                .with_attributes([("freq", frequency), ("samples", samples)])
                .write_empty()
                .map(drop)
        })?,
        (Scale::Unknown, _) | (Scale::Trace, None) => element.write_empty()?,
    };

    Ok(())
}

fn write_reference<W: Write>(xml: &mut Writer<W>, uri: &str, role: &str) -> io::Result<()> {
    xml.create_element("reference")
        .with_attributes([("uri", uri), ("role", role)])
        .write_empty()?;
    Ok(())
}

/// Writes a vocabulary, unless it is empty: the schema requires an item.
fn write_vocabulary<W: Write>(
    xml: &mut Writer<W>,
    kind: &str,
    id: &str,
    items: Vec<(String, String)>,
) -> io::Result<()> {
    if items.is_empty() {
        return Ok(());
    }

    xml.create_element("vocabulary")
        .with_attributes([("type", kind), ("id", id)])
        .write_inner_content(|xml| {
            for (name, text) in items {
                let item = xml.create_element("item");
                let item = item.with_attribute(("name", name.as_str()));
                item.write_inner_content(|xml| write_info(xml, &text))?;
            }
            Ok(())
        })?;

    Ok(())
}
