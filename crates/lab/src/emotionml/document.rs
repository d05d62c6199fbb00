//! The document: its beginning, an `<emotion>` for each episode, its vocabularies at the end, when they are known.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use affect::akr::{ActionTendency, FacialExpression, Valence};
use affect::{AgencyRole, Circumstances, DynamicsParameters, Schema, SchemaValence, Schemata};
use protocol::RobotName;
use protocol::keys::Keys;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};

use super::episode::{Episode, Seen};
use super::notes::note;
use super::source::Facts;
use super::terms::{self, Term};

const NAMESPACE: &str = "http://www.w3.org/2009/10/emotionml";
const ROOT: &str = "emotionml";

/// Ids of the vocabularies that the document declares.
const EMOTIONS: &str = "cars-emotions";
const TENDENCIES: &str = "cars-action-tendencies";

/// What the refiller's way is blocked by, in words [I: as her panel says it].
const CROWD: &str = "the crowd";

/// A document that is being written.
pub(super) struct Document<W: Write> {
    xml: Writer<W>,
    facts: Facts,
    keys: Keys,
    /// Names of the robots: who can be a target.
    roster: BTreeSet<RobotName>,
    /// Whether W3C's vocabularies alone are spoken.
    is_standard: bool,
    /// What occurred, for the vocabularies.
    emotions: BTreeSet<String>,
    tendencies: BTreeSet<ActionTendency>,
    /// Emotions that cannot be said in this view.
    left_out: BTreeMap<String, u64>,
}

/// What an `<emotion>` says of one aspect.
struct Descriptor {
    kind: Kind,
    /// The vocabulary of its name, as the `*-set` attribute has it; the same for all of a kind.
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

/// How strongly: never both a value and a trace.
enum Scale {
    Unsaid,
    Value(f64),
    /// The episode's intensity.
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
    /// Begins a document.
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
        let (emotions, tendencies, left_out) = Default::default();

        Ok(Self {
            xml,
            facts,
            keys,
            roster,
            is_standard,
            emotions,
            tendencies,
            left_out,
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
                .extend(schema.map(|schema| schema.action_tendency));
        }
        let told = schema.map(|schema| Told::new(schema, episode, &self.facts));
        let experienced_by = self.robot_uri(&episode.begun.name);
        let targeted_at = told
            .as_ref()
            .and_then(|told| self.target(told.other.as_deref()?));
        let trace = episode.intensity.values().map(samples);
        let frequency = format!("{}Hz", 1.0 / self.facts.tick_s);

        let element = self.xml.create_element("emotion").with_attributes([
            (
                "id",
                format!("emotion.{}.{}", episode.begun.name, episode.first).as_str(),
            ),
            ("time-ref-uri", &self.keys.clock()),
            (
                "offset-to-start",
                &milliseconds(episode.first, self.facts.tick_s).to_string(),
            ),
            (
                "duration",
                &duration_ms(episode, self.facts.tick_s).to_string(),
            ),
        ]);
        let element = element.with_attributes(sets(&descriptors));
        // A neutral face expresses nothing.
        let is_seen =
            schema.is_some_and(|schema| schema.facial_expression != FacialExpression::Neutral);
        let element = element.with_attributes(is_seen.then_some(("expressed-through", "face")));
        element.write_inner_content(|xml| {
            if let Some(told) = &told {
                write_info(xml, &told.account)?;
            }
            for descriptor in &descriptors {
                write_descriptor(xml, descriptor, trace.as_deref(), &frequency)?;
            }
            write_reference(xml, &experienced_by, "experiencedBy")?;
            targeted_at.map_or(Ok(()), |uri| write_reference(xml, &uri, "targetedAt"))
        })?;
        // Whoever reads along gets whole emotions.
        self.xml.get_mut().flush()
    }

    /// Ends the document: the vocabularies, and what could not be said.
    pub(super) fn end(mut self) -> io::Result<()> {
        let emotions: Vec<_> = self
            .emotions
            .iter()
            .map(|name| (terms::token(name), describe_emotion(name)))
            .collect();

        write_vocabulary(&mut self.xml, "category", EMOTIONS, emotions)?;
        let tendencies = self
            .tendencies
            .iter()
            .map(|t| (t.name().to_owned(), describe_tendency(*t)));
        let tendencies: Vec<_> = tendencies.collect();
        write_vocabulary(&mut self.xml, "action-tendency", TENDENCIES, tendencies)?;

        for (name, count) in &self.left_out {
            note(&format!(
                "{count} episodes of {name:?} are left out: no standard vocabulary can say it"
            ));
        }

        self.xml.write_event(Event::End(BytesEnd::new(ROOT)))?;

        self.xml.get_mut().write_all(b"\n")
    }

    /// All that is known of an episode, in the order of kinds.
    fn descriptors(&self, episode: &Episode, schema: Option<&Schema>) -> Vec<Descriptor> {
        let mean_intensity = episode.intensity.values().and_then(mean);
        let mut descriptors = Vec::new();
        descriptors.extend(self.category(episode));

        if let Some(schema) = schema {
            let value = mean_intensity
                .zip(sign(schema.valence))
                .map(|(mean, sign)| 0.5 + 0.5 * sign * mean);
            descriptors.extend(value.map(|value| Descriptor::dimension(terms::VALENCE, value)));
            let unpredictability = terms::unpredictability(schema.certainty);
            descriptors.push(Descriptor::dimension(
                terms::UNPREDICTABILITY,
                unpredictability,
            ));
            descriptors.extend(components(schema));
        } else if self.is_standard && mean_intensity.is_some() {
            descriptors.push(Descriptor::of_w3c(
                Kind::Dimension,
                terms::INTENSITY,
                Scale::Trace,
            ));
        }

        if let Some(urgency) = self.urgency(episode) {
            descriptors.push(Descriptor::appraisal(terms::URGENCY, urgency));
            descriptors.push(Descriptor::appraisal(terms::DESIRABILITY, 1.0 - urgency));
        }

        descriptors.extend(schema.and_then(|schema| self.tendency(schema.action_tendency)));

        descriptors
    }

    fn category(&self, episode: &Episode) -> Option<Descriptor> {
        let emotion = &episode.begun.emotion;
        let scale = if episode.intensity.values().is_some() {
            Scale::Trace
        } else {
            Scale::Unsaid
        };

        if self.is_standard {
            let term = terms::nearest_category(emotion)?;
            return Some(Descriptor::of_w3c(Kind::Category, term, scale));
        }

        Some(Descriptor::own(
            Kind::Category,
            EMOTIONS,
            terms::token(emotion),
            scale,
        ))
    }

    fn tendency(&self, tendency: ActionTendency) -> Option<Descriptor> {
        if self.is_standard {
            let term = terms::nearest_tendency(tendency)?;
            return Some(Descriptor::of_w3c(
                Kind::ActionTendency,
                term,
                Scale::Unsaid,
            ));
        }

        let name = tendency.name().to_owned();
        Some(Descriptor::own(
            Kind::ActionTendency,
            TENDENCIES,
            name,
            Scale::Unsaid,
        ))
    }

    /// How much the need pressed, on the average: 1 is the need that saturates the robot's emotion.
    fn urgency(&self, episode: &Episode) -> Option<f64> {
        let parameters = self.facts.parameters.get(&episode.begun.name);
        let rho_max = parameters.and_then(|own| own.get("dynamics")?.get("rho_max")?.as_f64());
        let rho_max = rho_max
            .filter(|rho| *rho > 0.0)
            .unwrap_or_else(|| DynamicsParameters::default().rho_max);
        let urgencies: Vec<f64> = episode
            .need_ratio
            .values()?
            .iter()
            .map(|rho| (rho / rho_max).min(1.0))
            .collect();

        mean(&urgencies)
    }

    fn robot_uri(&self, name: &RobotName) -> String {
        // Without a query, the address under which the robot answers them.
        self.keys.query(name, "").trim_end_matches('/').to_owned()
    }

    fn target(&self, other: &str) -> Option<String> {
        self.roster.get(other).map(|robot| self.robot_uri(robot))
    }
}

/// An emotion as its robot would account for it.
struct Told {
    account: String,
    /// Who is responsible, if that is not the robot itself.
    other: Option<String>,
}

impl Told {
    /// Reads what the shipped robots publish: `refiller` and `treats` of a waiter, `waiter` and `hurried` of a refiller.
    /// A robot of another kind that publishes the same is told likewise; of one that does not, less is told.
    fn new(schema: &Schema, episode: &Episode, facts: &Facts) -> Self {
        let (begun, before) = (&episode.begun, &episode.before);
        let parameters = facts.parameters.get(&begun.name);
        let parameter = |name: &str| parameters.and_then(|own| own.get(name)?.as_str());
        let goods = parameter("goods").unwrap_or("treats");
        let waiter = begun.text("waiter");
        let other = begun
            .text("refiller")
            .or(waiter.map(|waiter| blamed(before, waiter)));
        let goal = parameter("goal").map(str::to_owned);
        let goal = goal.or(waiter.map(|waiter| format!("to bring {goods} to {waiter}")));
        let amount = begun
            .number_in_words("treats")
            .map(|treats| format!("{treats} {goods}"));
        let circumstances = Circumstances {
            other,
            goal: goal.as_deref(),
            amount: amount.as_deref(),
            valence: None,
        };
        let account = schema.account(&circumstances).spoken();
        let other = other
            .filter(|_| schema.agency == AgencyRole::Other)
            .map(str::to_owned);

        Self { account, other }
    }
}

/// On the way it is the crowd that a refiller blames, unless it is the waiter who presses.
fn blamed<'a>(before: &Seen, waiter: &'a str) -> &'a str {
    let is_crowd = before.behavior == "REFILL" && !before.flag("hurried");
    if is_crowd { CROWD } else { waiter }
}

/// What is the same in every instance of an emotion.
fn components(schema: &Schema) -> [Descriptor; 4] {
    let agency = match schema.agency {
        AgencyRole::Oneself => 1.0,
        AgencyRole::Other => 0.0,
    };
    [
        Descriptor::appraisal(terms::AGENCY, agency),
        Descriptor::appraisal(terms::UNEXPECTEDNESS, terms::unexpectedness(schema.novelty)),
        Descriptor::appraisal(
            terms::CONTROLLABILITY,
            terms::degree(schema.controllability),
        ),
        Descriptor::appraisal(terms::CHANGEABILITY, terms::degree(schema.modifiability)),
    ]
}

fn sign(valence: SchemaValence) -> Option<f64> {
    match valence {
        SchemaValence::Positive => Some(Valence::Positive.sign()),
        SchemaValence::Negative => Some(Valence::Negative.sign()),
        SchemaValence::Either => None,
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn samples(values: &[f64]) -> String {
    let samples: Vec<String> = values.iter().copied().map(terms::scale_value).collect();
    samples.join(" ")
}

fn milliseconds(tick: u64, tick_s: f64) -> u64 {
    (tick as f64 * tick_s * 1000.0).round() as u64
}

/// From the beginning of the first to the end of the last tick, so that one episode ends where the next one begins.
fn duration_ms(episode: &Episode, tick_s: f64) -> u64 {
    milliseconds(episode.last + 1, tick_s) - milliseconds(episode.first, tick_s)
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

/// What a reader of the document has to know.
fn about(facts: &Facts, keys: &Keys) -> String {
    let Facts {
        run,
        seed,
        tick_s,
        file,
        ..
    } = facts;
    let epoch = facts
        .epoch
        .map_or_else(String::new, |epoch| format!(", epoch {epoch}"));

    format!(
        "Emotions of robots in the simulated run {run}{epoch}, seed {seed}, from its {file}, by cars {}. \
         Times are simulated milliseconds since tick 0 of {}; a tick lasts {tick_s} s and a trace has one sample a tick. \
         Robots are named by their addresses on the network. A category is as intense as its trace; valence, urgency and \
         desirability are means over the episode.",
        env!("CARGO_PKG_VERSION"),
        keys.clock()
    )
}

fn describe_emotion(name: &str) -> String {
    let mut parts = vec![format!("emotion state {name}")];
    parts.extend(terms::nearest_category(name).map(|term| format!("nearest: {}", term.in_words())));
    if let Some(schema) = Schemata::standard().get(name) {
        parts.push(format!(
            "face: {}",
            format!("{:?}", schema.facial_expression).to_lowercase()
        ));
    }
    parts.join("; ")
}

fn describe_tendency(tendency: ActionTendency) -> String {
    let mut parts = vec![format!("action tendency {}", tendency.name())];
    parts.extend(
        tendency
            .function()
            .map(|function| format!("function: {function}")),
    );
    parts.extend(
        terms::nearest_tendency(tendency).map(|term| format!("nearest: {}", term.in_words())),
    );

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
        (Scale::Unsaid, _) | (Scale::Trace, None) => element.write_empty()?,
    };

    Ok(())
}

fn write_reference<W: Write>(xml: &mut Writer<W>, uri: &str, role: &str) -> io::Result<()> {
    xml.create_element("reference")
        .with_attributes([("uri", uri), ("role", role)])
        .write_empty()?;
    Ok(())
}

/// A vocabulary has at least one item.
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
                let item = xml
                    .create_element("item")
                    .with_attribute(("name", name.as_str()));
                item.write_inner_content(|xml| write_info(xml, &text))?;
            }
            Ok(())
        })?;

    Ok(())
}
