//! What checks find, by rule.

use std::collections::BTreeMap;

use crate::report::{KitPart, RuleFailure, RuleVerdict};

/// What was found, by rule.
pub type VerdictsByRule = BTreeMap<&'static str, RuleVerdict>;

/// What one check finds.
#[derive(Default)]
pub struct Findings(pub VerdictsByRule);

impl Findings {
    /// The rule is broken. The first failure of a rule is the one that is reported.
    pub fn fail(&mut self, rule: &'static str, failure: RuleFailure) {
        if !self.has_failed(rule) {
            self.0.insert(rule, RuleVerdict::Failed(failure));
        }
    }

    /// The failures among them, as those of a part.
    pub fn of_part(mut self, of: KitPart) -> Self {
        self.0.retain(|_, verdict| match verdict {
            RuleVerdict::Failed(failure) => {
                failure.part = of;
                true
            }
            _ => false,
        });
        self
    }

    /// Whether any rule was found broken.
    pub fn is_broken(&self) -> bool {
        let mut verdicts = self.0.values();
        verdicts.any(|verdict| matches!(verdict, RuleVerdict::Failed(_)))
    }

    /// Whether any rule was found broken by what a busy machine can cause as well.
    pub fn may_be_load(&self) -> bool {
        let mut verdicts = self.0.values();
        verdicts.any(|verdict| {
            matches!(
                verdict,
                RuleVerdict::Failed(RuleFailure {
                    may_be_load: true,
                    ..
                })
            )
        })
    }

    /// Whether the rule was found broken.
    pub fn has_failed(&self, rule: &'static str) -> bool {
        matches!(self.0.get(rule), Some(RuleVerdict::Failed(_)))
    }

    /// Nothing is known of rules whose checks presume another one, of the second place, that is broken.
    pub fn presume(&mut self, presumed: &[(&'static str, &'static str)]) {
        for (rule, other) in presumed {
            if self.has_failed(other) && self.has_failed(rule) {
                self.0.remove(rule);
                self.skip(rule, &format!("its check presumes {other}"));
            }
        }
    }

    /// The rule holds, unless it was found broken.
    pub fn pass(&mut self, rule: &'static str) {
        self.0.entry(rule).or_insert(RuleVerdict::Passed);
    }

    /// The rule holds, or is broken.
    pub fn settle(&mut self, rule: &'static str, result: Result<(), RuleFailure>) {
        match result {
            Ok(()) => self.pass(rule),
            Err(failure) => self.fail(rule, failure),
        }
    }

    /// This robot gives no occasion to see it.
    pub fn skip(&mut self, rule: &'static str, reason: &str) {
        self.0.entry(rule).or_insert_with(|| RuleVerdict::Skipped {
            reason: reason.to_owned(),
        });
    }

    /// Adds what another check found: the worse verdict counts.
    pub fn merge(&mut self, other: Self) {
        for (rule, verdict) in other.0 {
            match verdict {
                RuleVerdict::Failed(failure) => self.fail(rule, failure),
                RuleVerdict::Skipped { reason } => self.skip(rule, &reason),
                RuleVerdict::Passed => {
                    if !self.has_failed(rule) {
                        self.0.insert(rule, verdict);
                    }
                }
            }
        }
    }

    /// A check of these rules came to its end, or broke off: then the first rule gets the reason, and nothing is known of
    /// the others.
    pub fn close(&mut self, rules: &[&'static str], end: Result<(), RuleFailure>) {
        let failure = match end {
            Ok(()) => {
                rules.iter().for_each(|rule| self.pass(rule));
                return;
            }
            Err(failure) => failure,
        };

        let lead = rules.first().copied().unwrap_or_default();
        self.fail(lead, failure);
        let reason = format!("the check did not get so far, see {lead}");
        rules.iter().for_each(|rule| self.skip(rule, &reason));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn broken() -> RuleVerdict {
        RuleVerdict::Failed(RuleFailure::new("a", "b"))
    }

    #[test]
    fn the_worse_verdict_counts() {
        let mut findings = Findings::default();
        findings.skip("x", "nothing to see");
        findings.merge(Findings([("x", RuleVerdict::Passed)].into()));
        assert_eq!(findings.0["x"], RuleVerdict::Passed);

        findings.merge(Findings([("x", broken())].into()));
        findings.merge(Findings([("x", RuleVerdict::Passed)].into()));
        assert_eq!(findings.0["x"], broken());
    }
}
