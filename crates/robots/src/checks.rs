//! What the robots share to appraise their situation. "Checks" is the paper's word for it \[D\]; all numbers are \[I\].

use affect::akr::Appraisal;

/// How far ahead a robot predicts its measures, s.
pub(crate) const PREDICTION_S: f64 = 5.0;
/// How far back it judges what it does, s.
pub(crate) const RECENT_S: f64 = 60.0;

/// The appraisal of a robot that has perceived nothing yet.
pub(crate) fn initial() -> Appraisal {
    Appraisal::default()
        .with_novelty(0.0)
        .with_modifiability(0.5)
        .with_standards(1.0, 1.0)
}
