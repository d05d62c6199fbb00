//! Leguin's parameters, in SI units. A parameter file may have text with a unit: `"4 ft"`.

use affect::{Caution, DynamicsParameters, MoodParameters};
use serde::{Deserialize, Serialize};

use crate::belief::BeliefParameters;
use crate::bounds::{not_negative, positive};
use crate::checks::AppraisalParameters;
use crate::drive::LOOK_S;
use crate::policy::Policy;
use crate::recruitment::shame::HelperParameters;
use crate::script::{Script, ScriptRole};
use crate::switch::Switch;
use crate::units::FT_M;

/// Leguin's parameters. A name that is not among them is refused: a misspelled one would silently run another
/// experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LeguinParameters {
    /// The robot whose tray she refills. Default "Butler" \[D\].
    pub waiter: String,
    /// The name of what she brings, for her panel. Default "treats" \[D\]; at the second venue pencils and leaflets.
    pub goods: String,
    /// Whether she has emotions. Default on \[I\].
    pub affect: Switch,
    /// What her speed and her giving up follow from. `rules` and `timer` give up alike; by `rules` she also hurries when her
    /// way is blocked, as she does when that makes her CONCERNED. Default emotion \[D\].
    pub policy: Policy,
    /// Emotions that she shows and acts by in the place of her own, for experiments. Default none \[I\].
    #[serde(skip_serializing_if = "Script::is_empty")]
    pub script: Script,
    /// Whether the script takes the place of what is felt, or only of what is shown. Default felt \[I\].
    pub scripted: ScriptRole,
    /// Whether the emotion that the other robot shows is an input of its own \[D: that emotions signaled to others have
    /// consequences for them; I: which\]. Default off \[I\].
    pub signals: Switch,
    /// Whether her emotion acts on her speed: the sensory-motor level \[D: Murphy et al. 2002, abstract\]. With `off`,
    /// "hurry" changes her emotion and not her speed. Default on \[I\].
    pub sensory_motor: Switch,
    /// Whether her emotion acts on her behavior: the schematic level \[D: the same\]. With `off` she has emotions and
    /// publishes them, and never gives up or jokes. Default on \[I\].
    pub schematic: Switch,
    /// How cautious she is, 0 to 1. Default 0.5 \[I\]; that there is this trait \[D\].
    pub caution: Caution,
    /// Distance within which an exchange is possible, m. Default 4 ft \[D\].
    pub exchange_radius_m: f64,
    /// Duration of an exchange, s. Default 2 \[I\].
    pub exchange_s: f64,
    /// Speed on the way to the waiter and home, m/s. Default 3 ft/s \[I\].
    pub v_refill_mps: f64,
    /// Factor on it (dimensionless) while she is fully CONCERNED on the way to the waiter. Default 1.5 \[I\]; that she
    /// increases her speed \[D\].
    pub hurry_mult: f64,
    /// Time from a call until she leaves the table, s. Default 1 \[I\].
    pub prep_s: f64,
    /// Pressure of an errand, 0 to 1. Default 0.35 \[I\]: it makes her CONFIDENT.
    pub errand_pressure: f64,
    /// Pressure of an errand on which she was told to hurry, 0 to 1. Default 0.6 \[I\]: it makes her CONCERNED.
    pub hurry_pressure: f64,
    /// Intensity of concern from which she moves faster. Default 0.25 \[I\].
    pub haste_onset: f64,
    /// Intensity of concern from which she moves as fast as she can. Default 0.55 \[I\].
    pub haste_full: f64,
    /// Time without coming nearer to the waiter after which the pressure is 1, s; divided by her gain. Default 32 \[I\]: she is
    /// FRUSTRATED with the way after some 25 s. That is above the time after which the waiter is FRUSTRATED, or she turns
    /// back before he can come to meet her.
    pub block_patience_s: f64,
    /// Time without being sent home after which the pressure is 1, s; divided by her gain. Default 26 \[I\]: she is
    /// FRUSTRATED with the waiter after some 20 s.
    pub await_patience_s: f64,
    /// By how much a distance must be smaller than ever before on this way to count as progress, m. Default 0.5 ft \[I\].
    pub progress_m: f64,
    /// Distance from her place at the table within which she has come home, m. Default 1.5 ft \[I\].
    pub arrive_m: f64,
    /// Time without progress after which a place near her own is home as well, s. Default 5 \[I\].
    pub settle_s: f64,
    /// Distance from her own place within which this holds, m. Default 6 ft \[I\]: three bodies.
    pub settle_m: f64,
    /// Distance at which she stops before a waiter who does not exchange, m. Default 3 ft \[I\].
    pub stand_off_m: f64,
    /// Age at which the last answer of the waiter no longer counts, s. Default 5 \[I\].
    pub query_stale_s: f64,
    /// Time in which she is to answer a call, s. Default 20 \[I\].
    pub answer_s: f64,
    /// Mean time from one turn to the next while she searches for a waiter of whom nothing is known, s. Default 5 \[I\].
    pub turn_mean_s: f64,
    /// Time for which she looks around before each step after she was blocked, s. Default 2 \[I\].
    pub look_s: f64,
    /// Mean time from one joke to the next while she is HAPPY and waits, s. Default 60 \[I\]; that she jokes \[D\].
    pub joke_mean_s: f64,
    /// How she answers a waiter who calls for help.
    pub recruitment: HelperParameters,
    /// Her beliefs about herself.
    pub deliberation: BeliefParameters,
    /// How far she looks to appraise her situation.
    pub appraisal: AppraisalParameters,
    /// Her mood.
    pub mood: MoodParameters,
    /// Constants of her emotions.
    pub dynamics: DynamicsParameters,
}

impl Default for LeguinParameters {
    fn default() -> Self {
        Self {
            waiter: "Butler".to_owned(),
            goods: "treats".to_owned(),
            affect: Switch::On,
            policy: Policy::Emotion,
            script: Script::default(),
            scripted: ScriptRole::default(),
            signals: Switch::Off,
            sensory_motor: Switch::On,
            schematic: Switch::On,
            caution: Caution::default(),
            exchange_radius_m: 4.0 * FT_M,
            exchange_s: 2.0,
            v_refill_mps: 3.0 * FT_M,
            hurry_mult: 1.5,
            prep_s: 1.0,
            errand_pressure: 0.35,
            hurry_pressure: 0.6,
            haste_onset: 0.25,
            haste_full: 0.55,
            block_patience_s: 32.0,
            await_patience_s: 26.0,
            progress_m: 0.5 * FT_M,
            arrive_m: 1.5 * FT_M,
            settle_s: 5.0,
            settle_m: 6.0 * FT_M,
            stand_off_m: 3.0 * FT_M,
            query_stale_s: 5.0,
            answer_s: 20.0,
            turn_mean_s: 5.0,
            look_s: LOOK_S,
            joke_mean_s: 60.0,
            recruitment: HelperParameters::default(),
            deliberation: BeliefParameters::default(),
            appraisal: AppraisalParameters::default(),
            mood: MoodParameters::default(),
            dynamics: DynamicsParameters::default(),
        }
    }
}

impl LeguinParameters {
    /// What she gives up by, with regard to what is switched off.
    pub(super) fn policy(&self) -> Policy {
        self.policy
            .given(self.affect.is_on() && self.schematic.is_on())
    }

    /// How strongly she reacts: 1 with the defaults.
    pub(super) fn gain(&self) -> f64 {
        self.dynamics.gain(self.caution)
    }

    /// The emotions that are given, and in the place of what.
    pub(super) fn script(&self) -> (Script, ScriptRole) {
        (self.script.clone(), self.scripted)
    }

    /// Checks the values, except those of her haste and of the dynamics, which are checked where they are used.
    ///
    /// # Errors
    /// The first value that is wrong.
    pub(super) fn check(&self) -> Result<(), String> {
        positive("exchange_radius_m", self.exchange_radius_m)?;
        positive("block_patience_s", self.block_patience_s)?;
        positive("await_patience_s", self.await_patience_s)?;
        positive("turn_mean_s", self.turn_mean_s)?;
        positive("joke_mean_s", self.joke_mean_s)?;
        not_negative("exchange_s", self.exchange_s)?;
        not_negative("v_refill_mps", self.v_refill_mps)?;
        not_negative("prep_s", self.prep_s)?;
        positive("progress_m", self.progress_m)?;
        not_negative("errand_pressure", self.errand_pressure)?;
        not_negative("hurry_pressure", self.hurry_pressure)?;
        self.script.check()?;
        self.recruitment.check()?;
        self.deliberation.check()?;
        self.appraisal.check()?;
        not_negative("answer_s", self.answer_s)?;
        not_negative("arrive_m", self.arrive_m)?;
        not_negative("settle_s", self.settle_s)?;
        not_negative("settle_m", self.settle_m)?;
        not_negative("stand_off_m", self.stand_off_m)?;
        not_negative("query_stale_s", self.query_stale_s)?;
        not_negative("look_s", self.look_s)
    }
}
