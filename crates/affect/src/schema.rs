//! The taxonomy of affective states as data: a tree of nodes, and the schema of each emotion in it.
//!
//! Together with an urgency and an appraisal, which depend on the situation, a schema makes a [`AffectFrame`](crate::AffectFrame).
//! The standard taxonomy is a TOML file of this crate, which marks each value as documented or chosen. A robot with an
//! emotion of its own defines a table for it and loads it with [`Schemata::from_toml`].

use crate::akr::{
    ActionTendency, AffectiveLevel, Duration, FacialExpression, Focality, Preference, Valence,
};
use crate::causal::CausalChain;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

const STANDARD: &str = include_str!("schemata.toml");

/// What a robot can measure of an affective state [D: S, the names]: the values of `measured`.
const MEASURES: [&str; 8] = [
    "intensity",
    "agency",
    "novelty",
    "controllability",
    "modifiability",
    "certainty",
    "external_norms",
    "internal_standards",
];

/// Why schemata are invalid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    /// The text is not valid TOML, or not a table of schemata.
    #[error("{0}")]
    Syntax(String),
    /// A node without a name.
    #[error("an emotion must have a name")]
    Unnamed,
    /// A node other than a personality has no parent.
    #[error(
        "{0} has no parent; add `parent = \"positive emotion\"` or `parent = \"negative emotion\"`"
    )]
    NoParent(String),
    /// The parent of a node does not exist.
    #[error("unknown parent {parent:?} of {name}; there are {known}")]
    UnknownParent {
        /// Name of the node.
        name: String,
        /// Name of its parent.
        parent: String,
        /// The names of the nodes that exist.
        known: String,
    },
    /// A node is above itself.
    #[error("{0} is its own ancestor; give one of these nodes a parent outside of the circle")]
    Cycle(String),
    /// The level of a node cannot be below that of its parent.
    #[error("{name} is of the level {level}, which cannot be below {parent}, of the level {above}", level = level.name(), above = above.name())]
    Order {
        /// Name of the node.
        name: String,
        /// Its level.
        level: AffectiveLevel,
        /// Name of its parent.
        parent: String,
        /// The level of its parent.
        above: AffectiveLevel,
    },
    /// A node has a value that its level does not allow.
    #[error("{name} is of the level {level}, which does not have `{key} = {value}`; {instead}", level = level.name())]
    NotAllowed {
        /// Name of the node.
        name: String,
        /// Its level.
        level: AffectiveLevel,
        /// The component.
        key: &'static str,
        /// The value.
        value: String,
        /// What to do.
        instead: String,
    },
    /// A node lacks a value, and so do those above it.
    #[error("{name} has no `{key}`, and no node above it has")]
    Missing {
        /// Name of the node.
        name: String,
        /// The component.
        key: &'static str,
    },
    /// A valence that contradicts that of the parent.
    #[error(
        "{name} has {valence:?} valence and is below {parent}, whose valence is the opposite; leave `valence` out or change `parent`"
    )]
    ValenceContradictsParent {
        /// Name of the node.
        name: String,
        /// Its valence.
        valence: Valence,
        /// Name of its parent.
        parent: String,
    },
    /// A facial expression that contradicts the valence.
    ///
    /// Surprise goes with either valence [D: S], and so does a neutral face.
    #[error("{name} has {valence:?} valence, which contradicts its {face:?} face")]
    FaceContradictsValence {
        /// Name of the emotion.
        name: String,
        /// Its valence.
        valence: Valence,
        /// Its facial expression.
        face: FacialExpression,
    },
}

/// The components that a node of the taxonomy can state. What it does not state it has from its parent.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Components {
    /// The traits of a personality [D: F2].
    pub traits: Option<Vec<String>>,
    /// How a personality deals with others [D: S, F2].
    pub interactive_strategy: Option<String>,
    /// The preferences of a personality about its own affect [D: S].
    pub preferences: Option<BTreeSet<Preference>>,
    /// How long the state lasts [D: S].
    pub duration: Option<Duration>,
    /// What kind of thing it is about [D: S].
    pub focality: Option<Focality>,
    /// Whether it is pleasant [D: S].
    pub valence: Option<Valence>,
    /// What the robot measures of it.
    pub measured: Option<Vec<String>>,
    /// Facial expression [D: S].
    pub facial_expression: Option<FacialExpression>,
    /// What it inclines the agent to do [D: S].
    pub action_tendency: Option<ActionTendency>,
    /// The beliefs and goals behind it [D: S].
    pub causal_chain: Option<CausalChain>,
}

impl Components {
    /// The components that are stated, with their values in words, in the order of the fields.
    pub fn entries(&self) -> Vec<(&'static str, String)> {
        let preferences = self.preferences.as_ref().map(|all| {
            let names: Vec<&str> = all.iter().map(|one| one.name()).collect();
            names.join(", ")
        });
        let entries = [
            ("traits", self.traits.as_ref().map(|all| all.join(", "))),
            ("interactive_strategy", self.interactive_strategy.clone()),
            ("preferences", preferences),
            ("duration", self.duration.map(|one| one.name().to_owned())),
            ("focality", self.focality.map(|one| one.name().to_owned())),
            ("valence", self.valence.map(|one| one.name().to_owned())),
            ("measured", self.measured.as_ref().map(|all| all.join(", "))),
            (
                "facial_expression",
                self.facial_expression.map(|one| one.name().to_owned()),
            ),
            (
                "action_tendency",
                self.action_tendency.map(|one| one.name().to_owned()),
            ),
            (
                "causal_chain",
                self.causal_chain.as_ref().map(CausalChain::to_string),
            ),
        ];

        let mut stated = Vec::new();
        for (key, value) in entries {
            stated.extend(value.map(|value| (key, value)));
        }
        stated
    }

    /// These components, and those of `above` that are not among them.
    fn over(&self, above: &Self) -> Self {
        fn either<T: Clone>(own: &Option<T>, above: &Option<T>) -> Option<T> {
            own.as_ref().or(above.as_ref()).cloned()
        }

        Self {
            traits: either(&self.traits, &above.traits),
            interactive_strategy: either(&self.interactive_strategy, &above.interactive_strategy),
            preferences: either(&self.preferences, &above.preferences),
            duration: either(&self.duration, &above.duration),
            focality: either(&self.focality, &above.focality),
            valence: either(&self.valence, &above.valence),
            measured: either(&self.measured, &above.measured),
            facial_expression: either(&self.facial_expression, &above.facial_expression),
            action_tendency: either(&self.action_tendency, &above.action_tendency),
            causal_chain: either(&self.causal_chain, &above.causal_chain),
        }
    }
}

/// A table of the file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct NodeTable {
    parent: Option<String>,
    level: Option<AffectiveLevel>,
    traits: Option<Vec<String>>,
    interactive_strategy: Option<String>,
    preferences: Option<BTreeSet<Preference>>,
    duration: Option<Duration>,
    focality: Option<Focality>,
    valence: Option<Valence>,
    measured: Option<Vec<String>>,
    facial_expression: Option<FacialExpression>,
    action_tendency: Option<ActionTendency>,
    causal_chain: Option<CausalChain>,
}

/// A node of the taxonomy: a personality, an affect, a mood or an emotion.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// The node above; `None` for the root.
    pub parent: Option<String>,
    /// Its level.
    pub level: AffectiveLevel,
    /// What it states.
    pub own: Components,
    /// What it states and inherits.
    pub all: Components,
    /// Where each value comes from, by component: documented or chosen, as in `[D: S]`. Empty for a file without marks.
    pub marks: BTreeMap<String, String>,
    stated_level: Option<AffectiveLevel>,
}

/// The components that all episodes of one emotion share.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    /// Facial expression.
    pub facial_expression: FacialExpression,
    /// Whether the emotion is pleasant.
    pub valence: Valence,
    /// How long the emotion lasts: minutes.
    pub duration: Duration,
    /// What kind of thing the emotion is about.
    pub focality: Focality,
    /// What the emotion inclines the agent to do.
    pub action_tendency: ActionTendency,
    /// The beliefs and goals behind it, with the placeholders `{g}` (goal), `{a}` (other agent) and `{n}` (amount).
    ///
    /// That causal chains mention beliefs, goals and whether goals are achieved is documented, and that they can be
    /// spoken [D: S]; so is their form, short scripts of simple words, following Wierzbicka. The published scripts were
    /// not readable; those of this crate are newly written \[I\].
    pub causal_chain: CausalChain,
}

impl Node {
    /// The schema of an emotion; an error names the first component that is missing.
    fn schema(&self) -> Result<Schema, &'static str> {
        let all = self.all.clone();
        Ok(Schema {
            facial_expression: all.facial_expression.ok_or("facial_expression")?,
            valence: all.valence.ok_or("valence")?,
            duration: all.duration.ok_or("duration")?,
            focality: all.focality.ok_or("focality")?,
            action_tendency: all.action_tendency.ok_or("action_tendency")?,
            causal_chain: all.causal_chain.ok_or("causal_chain")?,
        })
    }

    /// Rejects values that the level does not have, and contradictions, so that errors are reported when a file is loaded.
    fn check(&self) -> Result<(), SchemaError> {
        let level = self.level;
        let refuse = |key, value: &str, instead: &str| {
            Err(SchemaError::NotAllowed {
                name: self.name.clone(),
                level,
                key,
                value: format!("{value:?}"),
                instead: instead.to_owned(),
            })
        };

        for (key, value) in self.own.entries() {
            match key {
                "traits" | "interactive_strategy" | "preferences"
                    if level != AffectiveLevel::Personality =>
                {
                    return refuse(key, &value, "only a personality has it");
                }
                "facial_expression" | "action_tendency" | "causal_chain"
                    if level != AffectiveLevel::Emotion =>
                {
                    return refuse(key, &value, "only an emotion has it");
                }
                "valence" if level == AffectiveLevel::Personality => {
                    return refuse(key, &value, "a personality can have any affect");
                }
                _ => {}
            }
        }

        if let Some(focality) = self.own.focality
            && !level.allows(focality)
        {
            let instead = match level {
                AffectiveLevel::Emotion => "an emotion is about an event, an agent or an object",
                _ => "it is \"global\"",
            };
            return refuse("focality", focality.name(), instead);
        }
        if let Some(duration) = self.own.duration
            && Some(duration) != level.duration()
        {
            let instead = match level.duration() {
                Some(own) => format!("it lasts {:?}", own.name()),
                None => "leave it out".to_owned(),
            };
            return refuse("duration", duration.name(), &instead);
        }

        for measure in self.own.measured.iter().flatten() {
            let instead = match level {
                AffectiveLevel::Emotion if MEASURES.contains(&measure.as_str()) => continue,
                AffectiveLevel::Affect | AffectiveLevel::Mood if measure == "intensity" => continue,
                AffectiveLevel::Emotion => {
                    format!("what is measured is one of {}", MEASURES.join(", "))
                }
                AffectiveLevel::Mood => "a mood has no agency, and nothing elicits it".to_owned(),
                AffectiveLevel::Affect => "affect has valence and intensity only".to_owned(),
                AffectiveLevel::Personality => "nothing is measured of a personality".to_owned(),
            };
            return refuse("measured", measure, &instead);
        }

        self.check_resolved()
    }

    /// Rejects what contradicts inherited values.
    fn check_resolved(&self) -> Result<(), SchemaError> {
        let missing = |key| {
            Err(SchemaError::Missing {
                name: self.name.clone(),
                key,
            })
        };
        if self.level > AffectiveLevel::Personality && self.all.valence.is_none() {
            return missing("valence");
        }
        if self.level > AffectiveLevel::Affect && self.all.duration != self.level.duration() {
            return missing("duration");
        }
        if self.level > AffectiveLevel::Affect
            && !self.all.focality.is_some_and(|one| self.level.allows(one))
        {
            return missing("focality");
        }

        if let (Some(valence), Some(face)) = (self.all.valence, self.all.facial_expression)
            && face.valence().is_some_and(|shown| shown != valence)
        {
            return Err(SchemaError::FaceContradictsValence {
                name: self.name.clone(),
                valence,
                face,
            });
        }

        Ok(())
    }
}

/// The taxonomy of a robot: a tree of nodes, and the schemata of the emotions in it by their names.
///
/// ```
/// use affect::{Circumstances, Schemata};
/// let circumstances = Circumstances {
///     other: Some("Leguin"),
///     goal: Some("to serve the guests"),
///     amount: Some("7 treats"),
/// };
/// let concerned = Schemata::standard().get("CONCERNED").ok_or("no schema")?;
/// assert_eq!(
///     concerned.causal_chain.filled(&circumstances).spoken(),
///     "I want to serve the guests; I have 7 treats left; Leguin is not here; something bad can happen soon; \
///      I do not want it; I do not know if it will happen; because of this I feel bad."
/// );
/// let path = Schemata::standard().path("CONCERNED");
/// let names: Vec<&str> = path.iter().map(|node| node.name.as_str()).collect();
/// assert_eq!(names, ["personality", "negative affect", "negative emotion", "CONCERNED"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Schemata {
    nodes: Vec<Node>,
    by_name: BTreeMap<String, Schema>,
}

impl Schemata {
    /// The taxonomy with the standard emotions.
    pub fn standard() -> &'static Self {
        static SCHEMATA: OnceLock<Schemata> = OnceLock::new();
        SCHEMATA.get_or_init(|| match Self::default().extended(STANDARD) {
            Ok(schemata) => schemata,
            Err(error) => {
                unreachable!("schemata.toml is part of this crate and tested, but invalid: {error}")
            }
        })
    }

    /// The general part of the standard taxonomy, with the emotions of a TOML text in the place of the standard ones: a table
    /// for each, whose `parent` is `positive emotion`, `negative emotion`, or another one of the text.
    ///
    /// # Errors
    ///
    /// Returns an error if the text cannot be parsed or if a node contradicts itself or its parent.
    pub fn from_toml(text: &str) -> Result<Self, SchemaError> {
        let standard = Self::standard();
        let mut general = standard.clone();
        general
            .nodes
            .retain(|node| !standard.by_name.contains_key(&node.name));

        general.extended(text)
    }

    /// These schemata with the tables of a TOML text, which add nodes or replace those of the same name.
    ///
    /// # Errors
    ///
    /// Returns an error if the text cannot be parsed or if a node contradicts itself or its parent.
    pub fn extended(&self, text: &str) -> Result<Self, SchemaError> {
        let tables: BTreeMap<String, NodeTable> =
            toml::from_str(text).map_err(|error| SchemaError::Syntax(error.to_string()))?;
        let remarks = FileComments::of(text);

        let mut added: Vec<Node> = tables
            .into_iter()
            .map(|(name, table)| table.node(name, &remarks))
            .collect();
        added.sort_by_key(|node| remarks.place(&node.name));

        let mut nodes = self.nodes.clone();
        nodes.retain(|node| added.iter().all(|new| new.name != node.name));
        let names: Vec<String> = added.iter().map(|node| node.name.clone()).collect();
        nodes.extend(added);
        resolve(&mut nodes)?;

        let mut by_name = BTreeMap::new();
        for node in &nodes {
            node.check()?;
            if node.level != AffectiveLevel::Emotion {
                continue;
            }
            match node.schema() {
                Ok(schema) => {
                    by_name.insert(node.name.clone(), schema);
                }
                Err(key) => {
                    let is_leaf = nodes
                        .iter()
                        .all(|other| other.parent.as_ref() != Some(&node.name));
                    if is_leaf && names.contains(&node.name) {
                        return Err(SchemaError::Missing {
                            name: node.name.clone(),
                            key,
                        });
                    }
                }
            }
        }

        Ok(Self { nodes, by_name })
    }

    /// The schema of the emotion with this name.
    pub fn get(&self, name: &str) -> Option<&Schema> {
        self.by_name.get(name)
    }

    /// The names of all emotions, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.by_name.keys().map(String::as_str)
    }

    /// The node with this name.
    pub fn node(&self, name: &str) -> Option<&Node> {
        self.nodes.iter().find(|node| node.name == name)
    }

    /// The nodes directly below one, or, for `None`, the roots, in the order of the file.
    pub fn below<'a>(&'a self, parent: Option<&'a str>) -> impl Iterator<Item = &'a Node> {
        let nodes = self.nodes.iter();
        nodes.filter(move |node| node.parent.as_deref() == parent)
    }

    /// The nodes from the root to the one with this name; none if there is no such node.
    pub fn path(&self, name: &str) -> Vec<&Node> {
        let mut path = Vec::new();
        let mut next = self.node(name);
        while let Some(node) = next {
            path.push(node);
            next = node.parent.as_deref().and_then(|parent| self.node(parent));
        }

        path.reverse();
        path
    }

    /// The whole tree, each node before those below it, with its depth.
    pub fn tree(&self) -> Vec<(usize, &Node)> {
        let mut tree = Vec::new();
        self.grow(None, 0, &mut tree);
        tree
    }

    fn grow<'a>(
        &'a self,
        parent: Option<&'a str>,
        depth: usize,
        tree: &mut Vec<(usize, &'a Node)>,
    ) {
        for node in self.below(parent) {
            tree.push((depth, node));
            self.grow(Some(&node.name), depth + 1, tree);
        }
    }

    /// The node above that states a component of this node, or the node itself; `None` if none does.
    pub fn origin(&self, node: &Node, key: &str) -> Option<&Node> {
        let states = |one: &&Node| one.own.entries().iter().any(|(own, _)| *own == key);
        self.path(&node.name).into_iter().rev().find(states)
    }

    /// The schema with this name, and the name as these schemata hold it.
    pub(crate) fn entry(&self, name: &str) -> Option<(&str, &Schema)> {
        let (name, schema) = self.by_name.get_key_value(name)?;

        Some((name, schema))
    }
}

impl NodeTable {
    /// The node, whose level and inherited components are not known yet.
    fn node(self, name: String, remarks: &FileComments) -> Node {
        Node {
            marks: remarks.marks.get(&name).cloned().unwrap_or_default(),
            name,
            parent: self.parent,
            level: self.level.unwrap_or(AffectiveLevel::Emotion),
            stated_level: self.level,
            own: Components {
                traits: self.traits,
                interactive_strategy: self.interactive_strategy,
                preferences: self.preferences,
                duration: self.duration,
                focality: self.focality,
                valence: self.valence,
                measured: self.measured,
                facial_expression: self.facial_expression,
                action_tendency: self.action_tendency,
                causal_chain: self.causal_chain,
            },
            all: Components::default(),
        }
    }
}

/// Determines what each node inherits.
fn resolve(nodes: &mut [Node]) -> Result<(), SchemaError> {
    let known: BTreeMap<String, usize> = nodes
        .iter()
        .enumerate()
        .map(|(index, node)| (node.name.clone(), index))
        .collect();

    for index in 0..nodes.len() {
        let ancestors = ancestors(nodes, &known, index)?;
        let mut level = AffectiveLevel::Personality;
        let mut all = Components::default();

        // From the root down to the node.
        for (position, at) in ancestors.iter().rev().enumerate() {
            let node = &nodes[*at];
            let above = level;
            level = node.stated_level.unwrap_or(above);
            if position == 0 && node.stated_level != Some(AffectiveLevel::Personality) {
                return Err(SchemaError::NoParent(node.name.clone()));
            }
            if position > 0 && !level.refines(above) {
                return Err(SchemaError::Order {
                    name: node.name.clone(),
                    level,
                    parent: node.parent.clone().unwrap_or_default(),
                    above,
                });
            }
            if let (Some(own), Some(inherited)) = (node.own.valence, all.valence)
                && own != inherited
            {
                return Err(SchemaError::ValenceContradictsParent {
                    name: node.name.clone(),
                    valence: own,
                    parent: node.parent.clone().unwrap_or_default(),
                });
            }
            all = node.own.over(&all);
        }

        nodes[index].level = level;
        nodes[index].all = all;
    }

    Ok(())
}

/// A node and those above it, up to the root.
fn ancestors(
    nodes: &[Node],
    known: &BTreeMap<String, usize>,
    index: usize,
) -> Result<Vec<usize>, SchemaError> {
    let mut path = vec![index];
    let mut node = &nodes[index];
    if node.name.is_empty() {
        return Err(SchemaError::Unnamed);
    }

    while let Some(parent) = &node.parent {
        let Some(at) = known.get(parent) else {
            let names: Vec<&str> = known.keys().map(String::as_str).collect();
            return Err(SchemaError::UnknownParent {
                name: node.name.clone(),
                parent: parent.clone(),
                known: names.join(", "),
            });
        };
        if path.contains(at) {
            return Err(SchemaError::Cycle(nodes[*at].name.clone()));
        }
        path.push(*at);
        node = &nodes[*at];
    }

    Ok(path)
}

/// What a file says of its values in comments, which the TOML parser drops: the order of the tables, and the marks.
#[derive(Default)]
struct FileComments {
    order: Vec<String>,
    marks: BTreeMap<String, BTreeMap<String, String>>,
}

impl FileComments {
    fn of(text: &str) -> Self {
        let mut remarks = Self::default();
        for line in text.lines().map(str::trim) {
            if let Some(name) = line
                .strip_prefix('[')
                .and_then(|rest| rest.strip_suffix(']'))
            {
                remarks
                    .order
                    .push(name.trim_matches(['"', '\'', ' ']).to_owned());
                continue;
            }

            let key = line.split_once('=').map(|(key, _)| key.trim());
            let mark = line.rfind("# [").map(|at| line[at + 1..].trim());
            if let (Some(table), Some(key), Some(mark)) = (remarks.order.last(), key, mark) {
                let marks = remarks.marks.entry(table.clone()).or_default();
                marks.insert(key.to_owned(), mark.to_owned());
            }
        }

        remarks
    }

    fn place(&self, name: &str) -> usize {
        let place = self.order.iter().position(|one| one == name);
        place.unwrap_or(self.order.len())
    }
}
