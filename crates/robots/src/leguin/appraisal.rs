//! How Leguin appraises her situation, from what she measures and knows \[I\].

use affect::akr::{Agency, Appraisal};

use super::Leguin;
use super::tables::{KEPT_WAITING, urgency};

/// The name of what blocks her way.
const CROWD: &str = "the crowd";

impl Leguin {
    /// Her judgment of this moment.
    ///
    /// Goal congruence is the urgency of her errand: 1 for none, -1 where her patience ends. Controllability is the share
    /// of her patience with a blocked way that is left. Certainty falls with the time since she last knew where the waiter
    /// is. He is responsible if he told her to hurry or keeps her waiting, and the crowd if it blocks her.
    pub(super) fn appraisal(&self) -> Appraisal {
        let measures = &self.state.measures;
        let urgency = urgency(measures, &self.behavior()).value();

        let agency = if measures.hurried || measures.waiting >= KEPT_WAITING {
            Agency::Other(self.parameters.waiter.clone())
        } else if measures.blocked >= measures.th_concerned {
            Agency::Other(CROWD.to_owned())
        } else {
            Agency::Oneself
        };

        let waiter = &self.state.waiter;
        Appraisal::new(
            1.0 - 2.0 * urgency,
            1.0 - measures.blocked.min(1.0),
            waiter.location_certainty(self.parameters.query_stale_s),
            agency,
        )
    }
}
