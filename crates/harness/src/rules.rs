//! The rules that are checked, and where the page explains them.

/// The page that states the rules, from the project's root.
pub const PAGE: &str = "docs/protocol.md";

/// A rule of the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProtocolRule {
    /// Its name; the page states it in a sentence that begins with the name.
    pub name: &'static str,
    /// Anchor of its section in [`PAGE`].
    pub section: &'static str,
}

impl ProtocolRule {
    /// The rule called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        rules().find(|rule| rule.name == name)
    }

    /// Where the page explains it.
    #[must_use]
    pub fn reference(self) -> String {
        format!("{PAGE}#{}", self.section)
    }
}

const fn rule(name: &'static str, section: &'static str) -> ProtocolRule {
    ProtocolRule { name, section }
}

/// The rules of robots that put and get over zenoh, in the order of the page.
pub const RULES: [ProtocolRule; 42] = [
    rule("join.request", "joining"),
    rule("join.ready-last", "joining"),
    rule("join.refused", "joining"),
    rule("tick.answer", "a-tick"),
    rule("tick.correction", "a-tick"),
    rule("tick.velocity", "a-tick"),
    rule("tick.initial", "a-tick"),
    rule("tick.state-first", "a-tick"),
    rule("command.order", "commands"),
    rule("command.twice", "commands"),
    rule("command.sent", "commands"),
    rule("command.payload", "commands"),
    rule("operator.commands", "commands"),
    rule("news.wait", "a-tick"),
    rule("tick.newest", "a-tick"),
    rule("query.reply", "queries"),
    rule("query.again", "queries"),
    rule("query.waiting", "queries"),
    rule("query.tick", "queries"),
    rule("query.at-once", "queries"),
    rule("query.asking", "queries"),
    rule("query.once", "queries"),
    rule("query.unknown", "queries"),
    rule("clock.duplicate", "repeated-and-late-messages"),
    rule("clock.late", "repeated-and-late-messages"),
    rule("epoch.init", "epochs"),
    rule("epoch.late", "epochs"),
    rule("determinism.seed", "epochs"),
    rule("return.generation", "incarnations"),
    rule("return.rejoin", "incarnations"),
    rule("return.replaced", "incarnations"),
    rule("return.own-joined", "incarnations"),
    rule("end.clock", "the-end"),
    rule("end.sigterm", "the-end"),
    rule("end.gone", "the-end"),
    rule("compat.unknown-fields", "tolerance"),
    rule("robust.malformed", "tolerance"),
    rule("number.angles", "numbers-and-chance"),
    rule("number.finite", "numbers-and-chance"),
    rule("number.integers", "numbers-and-chance"),
    rule("wire.qos", "words-and-transport"),
    rule("wire.keys", "keys"),
];

/// Rule: lines have known fields only.
pub const STDIO_FIELDS: &str = "stdio.fields";
/// Rule: the log is within its limits.
pub const STDIO_LOG: &str = "stdio.log";
/// Rule: the program exits with status 0, in time.
pub const STDIO_END: &str = "stdio.end";

/// The rules of programs that `cars exec` runs. Over zenoh nothing shows whether they hold: `cars exec` reports it.
pub const STDIO_RULES: [ProtocolRule; 3] = [
    rule(STDIO_FIELDS, "robots-over-stdin-and-stdout"),
    rule(STDIO_LOG, "robots-over-stdin-and-stdout"),
    rule(STDIO_END, "robots-over-stdin-and-stdout"),
];

/// All rules.
pub fn rules() -> impl Iterator<Item = ProtocolRule> {
    RULES.into_iter().chain(STDIO_RULES)
}
