//! The rules of EmotionML 1.0, as a checker that knows nothing of the exporter. Numbers are those of the assertions in
//! W3C's implementation report; `schema` is what only the XML schema says, `trace` is this project's own.

use std::collections::{BTreeMap, BTreeSet};

use roxmltree::{Document, Node};

const NAMESPACE: &str = "http://www.w3.org/2009/10/emotionml";
const KINDS: [&str; 4] = ["category", "dimension", "appraisal", "action-tendency"];
const ROLES: [&str; 4] = ["expressedBy", "experiencedBy", "triggeredBy", "targetedAt"];

/// Those of W3C's vocabularies that this project may use (Working Group Note, 1 April 2014): kind, id, items.
const W3C: [(&str, &str, &str); 8] = [
    (
        "category",
        "everyday-categories",
        "affectionate afraid amused angry bored confident content disappointed excited happy interested loving pleased \
         relaxed sad satisfied worried",
    ),
    (
        "category",
        "fsre-categories",
        "anger anxiety being-hurt compassion contempt contentment despair disappointment disgust fear guilt happiness hate \
         interest irritation jealousy joy love pleasure pride sadness shame stress surprise",
    ),
    (
        "category",
        "frijda-categories",
        "anger arrogance desire disgust enjoyment fear humility indifference interest resignation shock surprise",
    ),
    (
        "category",
        "occ-categories",
        "admiration anger disappointment distress fear fears-confirmed gloating gratification gratitude happy-for hate hope \
         joy love pity pride relief remorse reproach resentment satisfaction shame",
    ),
    (
        "dimension",
        "fsre-dimensions",
        "valence potency arousal unpredictability",
    ),
    ("dimension", "intensity-dimension", "intensity"),
    (
        "appraisal",
        "ema-appraisals",
        "relevance desirability agency blame likelihood unexpectedness urgency ego-involvement controllability \
         changeability power adaptability",
    ),
    (
        "action-tendency",
        "frijda-action-tendencies",
        "approach avoidance being-with attending rejecting nonattending agonistic interrupting dominating submitting",
    ),
];

/// Kind and items, by the URI under which a `*-set` attribute knows the vocabulary.
type Vocabularies<'a> = BTreeMap<String, (&'a str, BTreeSet<&'a str>)>;

/// The rules that a document breaks, by number; empty is what is wanted.
pub(crate) fn broken(text: &str) -> BTreeSet<String> {
    let Ok(document) = Document::parse(text) else {
        return ["xml".to_owned()].into();
    };

    let mut rules = Rules::default();
    let root = document.root_element();
    rules.demand("101", root.has_tag_name((NAMESPACE, "emotionml")));
    rules.demand("111", root.attribute("version") == Some("1.0"));
    let vocabularies = rules.vocabularies(root);
    rules.sets(root, &vocabularies, "114 117 120 123");
    rules.children(root, &["info"], &["emotion", "vocabulary"], &[]);
    let mut ids = BTreeSet::new();
    for node in root.descendants().filter(Node::is_element) {
        if let Some(id) = node.attribute("id") {
            rules.demand("schema id", is_id(id) && ids.insert(id));
        }
        if node.has_tag_name((NAMESPACE, "info")) {
            let inner = node.descendants().skip(1).filter(Node::is_element);
            let has_own = inner
                .map(|inner| inner.tag_name().namespace())
                .any(|name| name == Some(NAMESPACE));
            rules.demand("304", !has_own);
        }
    }

    rules.end_ms = elements(root, "emotion").filter_map(end_ms).max();
    for emotion in elements(root, "emotion") {
        rules.emotion(root, emotion, &vocabularies);
    }

    rules.broken
}

#[derive(Default)]
struct Rules {
    broken: BTreeSet<String>,
    /// When the last emotion ends.
    end_ms: Option<i64>,
}

/// When an emotion ends, after the reference.
fn end_ms(emotion: Node) -> Option<i64> {
    let offset_ms: i64 = emotion.attribute("offset-to-start")?.parse().ok()?;
    let duration_ms: i64 = emotion.attribute("duration")?.parse().ok()?;
    Some(offset_ms + duration_ms)
}

impl Rules {
    fn demand(&mut self, rule: &str, is_met: bool) {
        if !is_met {
            self.broken.insert(rule.to_owned());
        }
    }

    /// The vocabularies that can be referred to: W3C's and the document's own.
    fn vocabularies<'a>(&mut self, root: Node<'a, '_>) -> Vocabularies<'a> {
        let mut all = Vocabularies::new();
        for (kind, id, items) in W3C {
            let uri = format!("http://www.w3.org/TR/emotion-voc/xml#{id}");
            all.insert(uri, (kind, items.split_whitespace().collect()));
        }

        for vocabulary in elements(root, "vocabulary") {
            let (kind, id) = (
                vocabulary.attribute("type").unwrap_or(""),
                vocabulary.attribute("id"),
            );
            self.demand("schema vocabulary", KINDS.contains(&kind) && id.is_some());
            let mut items = BTreeSet::new();
            for item in elements(vocabulary, "item") {
                let name = item.attribute("name").unwrap_or("");
                self.demand("schema item", is_token(name) && items.insert(name));
            }
            self.demand("schema vocabulary", !items.is_empty());
            all.insert(format!("#{}", id.unwrap_or("")), (kind, items));
        }

        all
    }

    /// A set refers to a vocabulary of its kind.
    fn sets(&mut self, of: Node, vocabularies: &Vocabularies, rules: &str) {
        for (kind, rule) in KINDS.into_iter().zip(rules.split(' ')) {
            if let Some(set) = of.attribute(format!("{kind}-set").as_str()) {
                self.demand(
                    rule,
                    vocabularies
                        .get(set)
                        .is_some_and(|(known, _)| *known == kind),
                );
            }
        }
    }

    /// Children come in three groups, of which the first holds one at most.
    fn children(&mut self, of: Node, first: &[&str], middle: &[&str], last: &[&str]) {
        let mut reached = 0;
        for child in of.children().filter(Node::is_element) {
            let name = child.tag_name().name();
            let groups = [first, middle, last];
            let group = groups.iter().position(|group| group.contains(&name));
            let is_ordered =
                group.is_some_and(|group| group >= reached && (group > 0 || reached == 0));
            self.demand(
                "schema order",
                is_ordered && child.tag_name().namespace() == Some(NAMESPACE),
            );
            reached = group.unwrap_or(reached).max(reached);
        }

        self.demand("schema order", elements(of, "info").count() <= 1);
    }

    fn emotion(&mut self, root: Node, emotion: Node, vocabularies: &Vocabularies) {
        self.children(emotion, &["info"], &KINDS, &["reference"]);
        self.sets(emotion, vocabularies, "161 164 167 170");
        let descriptors: Vec<Node> = KINDS
            .iter()
            .flat_map(|kind| elements(emotion, kind))
            .collect();
        self.demand("156", !descriptors.is_empty());

        for (kind, hundred) in KINDS.into_iter().zip([210, 220, 230, 240]) {
            let mut names = BTreeSet::new();
            for descriptor in elements(emotion, kind) {
                let attribute = format!("{kind}-set");
                let set = emotion
                    .attribute(attribute.as_str())
                    .or(root.attribute(attribute.as_str()));
                self.demand(&hundred.to_string(), set.is_some());
                let name = descriptor.attribute("name").unwrap_or("");
                let known = set.and_then(|set| vocabularies.get(set));
                let is_known = known.is_none_or(|(_, items)| items.contains(name));
                self.demand(&(hundred + 2).to_string(), is_known);
                self.demand(&(hundred + 3).to_string(), names.insert(name));
                self.scale(emotion, descriptor, hundred);
            }
        }

        for reference in elements(emotion, "reference") {
            self.demand(
                "410",
                reference
                    .attribute("uri")
                    .is_some_and(|uri| !uri.is_empty()),
            );
            self.demand(
                "schema role",
                reference
                    .attribute("role")
                    .is_none_or(|role| ROLES.contains(&role)),
            );
        }

        self.times(emotion);
    }

    /// A value or a trace, never both; a dimension has one of them.
    fn scale(&mut self, emotion: Node, descriptor: Node, hundred: u32) {
        let (value, traces) = (
            descriptor.attribute("value"),
            elements(descriptor, "trace").count(),
        );
        self.demand(&(hundred + 6).to_string(), value.is_none() || traces == 0);
        self.demand("schema order", traces <= 1);

        if hundred == 220 {
            self.demand("224", value.is_some() || traces > 0);
        }

        self.demand("schema value", value.is_none_or(is_scale_value));

        for trace in elements(descriptor, "trace") {
            let frequency_hz = frequency_hz(trace.attribute("freq").unwrap_or(""));
            self.demand("schema freq", frequency_hz.is_some());
            let samples: Vec<&str> = trace
                .attribute("samples")
                .unwrap_or("")
                .split_whitespace()
                .collect();
            self.demand(
                "schema samples",
                !samples.is_empty() && samples.into_iter().all(is_scale_value),
            );
            let count = trace
                .attribute("samples")
                .unwrap_or("")
                .split_whitespace()
                .count() as f64;
            let duration_ms = emotion
                .attribute("duration")
                .and_then(|text| text.parse::<f64>().ok());
            if let (Some(frequency_hz), Some(duration_ms)) = (frequency_hz, duration_ms) {
                // A sample lasts until the next one. The run ends with its last sample, which lasts for no time.
                let is_until_end = end_ms(emotion) == self.end_ms;
                let lasts = |samples: f64| {
                    let rounding_ms = 1.0;
                    (samples / frequency_hz * 1000.0 - duration_ms).abs() <= rounding_ms
                };
                self.demand("trace", lasts(count) || is_until_end && lasts(count - 1.0));
            }
        }
    }

    /// Whole milliseconds; simulated times are relative to something, never since 1970.
    fn times(&mut self, emotion: Node) {
        for name in ["start", "end", "duration"] {
            let is_whole = |text: &str| text.parse::<u64>().is_ok();
            self.demand("schema time", emotion.attribute(name).is_none_or(is_whole));
        }

        let offset = emotion.attribute("offset-to-start");
        self.demand(
            "schema time",
            offset.is_none_or(|text| text.parse::<i64>().is_ok()),
        );
        let is_absolute = emotion.has_attribute("start") || emotion.has_attribute("end");
        self.demand(
            "trace",
            !is_absolute && emotion.has_attribute("time-ref-uri"),
        );
    }
}

fn elements<'a, 'input>(
    of: Node<'a, 'input>,
    name: &str,
) -> impl Iterator<Item = Node<'a, 'input>> {
    let name = name.to_owned();
    of.children()
        .filter(move |child| child.has_tag_name((NAMESPACE, name.as_str())))
}

fn is_scale_value(text: &str) -> bool {
    text.parse::<f64>()
        .is_ok_and(|value| (0.0..=1.0).contains(&value))
}

fn frequency_hz(text: &str) -> Option<f64> {
    let number = text.strip_suffix("Hz")?.trim_end();
    let is_plain = number.starts_with(|char: char| char.is_ascii_digit())
        && number
            .chars()
            .all(|char| char.is_ascii_digit() || char == '.');
    number.parse().ok().filter(|_| is_plain)
}

/// An `NMTOKEN` of ASCII.
fn is_token(name: &str) -> bool {
    !name.is_empty()
        && name
            .chars()
            .all(|char| char.is_ascii_alphanumeric() || ".-_:".contains(char))
}

/// An `NCName` of ASCII.
fn is_id(id: &str) -> bool {
    is_token(id)
        && !id.contains(':')
        && id.starts_with(|char: char| char.is_ascii_alphabetic() || char == '_')
}
