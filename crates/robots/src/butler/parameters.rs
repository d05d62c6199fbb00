//! Butler's parameters, in SI units. A parameter file may have text with a unit: `"4 ft"`.

use affect::progress::{ApproachParameters, RateParameters};
use affect::{Caution, DynamicsParameters, MoodParameters};
use serde::{Deserialize, Serialize};

use super::deliberation::Deliberation;
use super::tables::ButlerBehavior;
use crate::bounds::{not_negative, positive};
use crate::checks::AppraisalParameters;
use crate::drive::LOOK_S;
use crate::policy::Policy;
use crate::recruitment::recruiter::RecruiterParameters;
use crate::script::{Script, ScriptRole};
use crate::switch::Switch;
use crate::units::FT_M;

/// Butler's parameters. A name that is not among them is refused: a misspelled one would silently run another
/// experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ButlerParameters {
    /// The robot he calls, unless he recruits. Default "Leguin" \[D\].
    pub refiller: String,
    /// Whether he calls any refiller for help instead, and how.
    pub recruitment: RecruiterParameters,
    /// The name of what he offers, for his panel. Default "treats" \[D\]; at the second venue pencils and leaflets.
    pub goods: String,
    /// His goal, as words that follow "I want" in his panel. Default "to serve the guests" \[I\].
    pub goal: String,
    /// Whether he has emotions. Default on \[I\].
    pub affect: Switch,
    /// What his actions follow from. Default emotion \[D\].
    pub policy: Policy,
    /// Emotions that he shows and acts by in the place of his own, for experiments. Default none \[I\].
    #[serde(skip_serializing_if = "Script::is_empty")]
    pub script: Script,
    /// Whether the script takes the place of what is felt, or only of what is shown. Default felt \[I\].
    pub scripted: ScriptRole,
    /// Whether the emotion that the other robot shows is an input of its own \[D: that emotions signaled to others have
    /// consequences for them; I: which\]. Default off \[I\].
    pub signals: Switch,
    /// Whether his emotion acts on his behavior: the schematic level \[D: Murphy et al. 2002, abstract\]. With `off` he
    /// has emotions and publishes them, and acts as without. Default on \[I\].
    pub schematic: Switch,
    /// Whether he repeats a command that has no visible effect, by a timer. Default off \[I\].
    pub resend: Switch,
    /// Time after which he repeats it, s. Default 5 \[I\].
    pub resend_s: f64,
    /// How cautious he is, 0 to 1. Default 0.5 \[I\]; that there is this trait \[D\].
    pub caution: Caution,
    /// Treats at the start and after every exchange. Default 30 \[D\].
    pub treat_capacity: u32,
    /// Mean time from one treat to the next, s. Default 1 \[I\]; that it is exponential \[D\].
    pub treat_mean_s: f64,
    /// Behaviors in which guests take treats. Default SERVE and GO_BACK \[D: the paper; that he stops serving to intercept:
    /// Murphy et al. 2002, abstract\].
    pub consume_in: Vec<ButlerBehavior>,
    /// Distance within which an exchange is possible, m. Default 4 ft \[D\].
    pub exchange_radius_m: f64,
    /// Duration of an exchange, s. Default 2 \[I\].
    pub exchange_s: f64,
    /// Speed while serving, m/s. Default 1 ft/s \[I\].
    pub v_serve_mps: f64,
    /// Speed while intercepting, m/s. Default 3 ft/s \[I\].
    pub v_intercept_mps: f64,
    /// Speed on the way back to the start, m/s. Default 2 ft/s \[I\].
    pub v_goback_mps: f64,
    /// The speed of the refiller that he assumes, m/s. Default 3 ft/s \[I\].
    pub v_refill_mps: f64,
    /// Time for which he assumes that the refiller reloads, s. Default 2 \[I\].
    pub reload_s: f64,
    /// Location of the refiller's table, m. Default: where the refiller is first known to be \[I\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<[f64; 2]>,
    /// Distance from the start within which he has come back, m. Default 1.5 ft \[I\].
    pub arrive_m: f64,
    /// Time without progress on the way back after which he stays where he is, if a robot is in his way, s. Default 5 \[I\], as
    /// Leguin's.
    pub settle_s: f64,
    /// Distance of a robot within which it counts as in his way, m. Default 6 ft \[I\]: three bodies.
    pub settle_m: f64,
    /// Distance at which he stops before a refiller who could exchange and does not yet, m. Default 3 ft \[I\].
    pub stand_off_m: f64,
    /// Whether he intercepts a refiller who is still at the table. Default true \[I\].
    pub intercept_any: bool,
    /// Time for which he intercepts without coming nearer to the refiller before he gives up, s. Default 15 \[I\].
    pub intercept_patience_s: f64,
    /// Time for which he does not intercept again after that, s. Default 30 \[I\].
    pub intercept_again_s: f64,
    /// By how much a distance must be smaller than ever before to count as progress, m. Default 0.5 ft \[I\].
    pub progress_m: f64,
    /// With the policy `timer`: time since the need arose after which he asks to hurry, s. Default 5 \[I\].
    pub hurry_after_s: f64,
    /// With the policy `timer`: time since the need arose after which he intercepts, s. Default 15 \[I\].
    pub intercept_after_s: f64,
    /// Age at which the last answer of the refiller no longer counts, s. Default 5 \[I\].
    pub query_stale_s: f64,
    /// Mean time from one turn of the random walk to the next, s. Default 5 \[I\].
    pub turn_mean_s: f64,
    /// Time for which he looks around before each step after he was blocked, s. Default 2 \[I\].
    pub look_s: f64,
    /// Mean time from one joke to the next while he is HAPPY and serves, s. Default 60 \[I\].
    pub joke_mean_s: f64,
    /// Estimate of the rate at which treats are taken; `prior_interval_s` is set to `treat_mean_s`.
    pub rate: Rate,
    /// Estimate of the speed at which the refiller approaches; it starts at `v_refill_mps`.
    pub approach: Approach,
    /// What he deliberates about: beliefs and plans. Default nothing.
    pub deliberation: Deliberation,
    /// How far he looks to appraise his situation.
    pub appraisal: AppraisalParameters,
    /// His mood.
    pub mood: MoodParameters,
    /// Constants of his emotions.
    pub dynamics: DynamicsParameters,
}

/// How the rate at which treats are taken is estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rate {
    /// Length of the window of the estimate, seconds of serving. Default 15 \[I\].
    pub window_s: f64,
    /// Weight of the expected rate, in treats. Default 5 \[I\].
    pub prior_n: f64,
}

/// How the refiller's approach is estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Approach {
    /// Least speed that an arrival time is computed with, m/s. Default 0.3 ft/s \[I\].
    pub floor_mps: f64,
    /// Time constant, s. Default 3 \[I\].
    pub tau_s: f64,
}

impl Default for Rate {
    fn default() -> Self {
        Self {
            window_s: 15.0,
            prior_n: 5.0,
        }
    }
}

impl Default for Approach {
    fn default() -> Self {
        Self {
            floor_mps: 0.3 * FT_M,
            tau_s: 3.0,
        }
    }
}

impl Default for ButlerParameters {
    fn default() -> Self {
        Self {
            refiller: "Leguin".to_owned(),
            recruitment: RecruiterParameters::default(),
            goods: "treats".to_owned(),
            goal: "to serve the guests".to_owned(),
            affect: Switch::On,
            policy: Policy::Emotion,
            script: Script::default(),
            scripted: ScriptRole::default(),
            signals: Switch::Off,
            schematic: Switch::On,
            resend: Switch::Off,
            resend_s: 5.0,
            caution: Caution::default(),
            treat_capacity: 30,
            treat_mean_s: 1.0,
            consume_in: vec![ButlerBehavior::Serve, ButlerBehavior::GoBack],
            exchange_radius_m: 4.0 * FT_M,
            exchange_s: 2.0,
            v_serve_mps: FT_M,
            v_intercept_mps: 3.0 * FT_M,
            v_goback_mps: 2.0 * FT_M,
            v_refill_mps: 3.0 * FT_M,
            reload_s: 2.0,
            table: None,
            arrive_m: 1.5 * FT_M,
            settle_s: 5.0,
            settle_m: 6.0 * FT_M,
            stand_off_m: 3.0 * FT_M,
            intercept_any: true,
            intercept_patience_s: 15.0,
            intercept_again_s: 30.0,
            progress_m: 0.5 * FT_M,
            hurry_after_s: 5.0,
            intercept_after_s: 15.0,
            query_stale_s: 5.0,
            turn_mean_s: 5.0,
            look_s: LOOK_S,
            joke_mean_s: 60.0,
            rate: Rate::default(),
            approach: Approach::default(),
            deliberation: Deliberation::default(),
            appraisal: AppraisalParameters::default(),
            mood: MoodParameters::default(),
            dynamics: DynamicsParameters::default(),
        }
    }
}

impl ButlerParameters {
    /// The emotions that are given, and in the place of what.
    pub(super) fn script(&self) -> (Script, ScriptRole) {
        (self.script.clone(), self.scripted)
    }

    /// Checks the values, except those of estimators and dynamics, which are checked where they are used.
    ///
    /// # Errors
    /// The first value that is wrong.
    pub(super) fn check(&self) -> Result<(), String> {
        // Each treat is an event of its own: this bounds their number in a tick.
        if !(self.treat_mean_s >= 1e-3 && self.treat_mean_s.is_finite()) {
            return Err(format!(
                "treat_mean_s must be at least 0.001 s, not {}",
                self.treat_mean_s
            ));
        }

        self.appraisal.check()?;
        positive("exchange_radius_m", self.exchange_radius_m)?;
        positive("v_refill_mps", self.v_refill_mps)?;
        positive("turn_mean_s", self.turn_mean_s)?;
        positive("joke_mean_s", self.joke_mean_s)?;
        positive("resend_s", self.resend_s)?;
        not_negative("exchange_s", self.exchange_s)?;
        not_negative("v_serve_mps", self.v_serve_mps)?;
        not_negative("v_intercept_mps", self.v_intercept_mps)?;
        not_negative("v_goback_mps", self.v_goback_mps)?;
        not_negative("reload_s", self.reload_s)?;
        not_negative("arrive_m", self.arrive_m)?;
        not_negative("settle_s", self.settle_s)?;
        not_negative("settle_m", self.settle_m)?;
        not_negative("stand_off_m", self.stand_off_m)?;
        positive("intercept_patience_s", self.intercept_patience_s)?;
        positive("progress_m", self.progress_m)?;
        not_negative("intercept_again_s", self.intercept_again_s)?;
        not_negative("hurry_after_s", self.hurry_after_s)?;
        not_negative("intercept_after_s", self.intercept_after_s)?;
        not_negative("query_stale_s", self.query_stale_s)?;
        not_negative("look_s", self.look_s)?;

        self.script.check()?;
        self.recruitment.check()?;
        if self.treat_capacity == 0 {
            return Err("treat_capacity must be at least 1".to_owned());
        }

        Ok(())
    }

    /// What his actions follow from, with regard to what is switched off.
    pub(super) fn policy(&self) -> Policy {
        self.policy
            .given(self.affect.is_on() && self.schematic.is_on())
    }

    pub(super) fn rate(&self) -> RateParameters {
        let Rate { window_s, prior_n } = self.rate;
        RateParameters {
            window_s,
            prior_n,
            prior_interval_s: self.treat_mean_s,
        }
    }

    pub(super) fn approach(&self) -> ApproachParameters {
        let Approach { floor_mps, tau_s } = self.approach;
        ApproachParameters {
            expected_mps: self.v_refill_mps,
            floor_mps,
            tau_s,
        }
    }
}
