//! The table `[network.radio]` as written in the file.

use std::ops::RangeInclusive;

use config::units::{BitRate, Frequency, Length};
use config::{FileError, Source};
use radio::{Fading, NakagamiStep, PathLoss, RadioModel, Shadowing, Transmitter, outage};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::super::network::Radio;
use super::unplaced::unplaced;

/// Power of the transmitter without `transmit_dbm`: 1 mW.
const TRANSMIT_DBM: f64 = 0.0;
/// Sensitivity without `sensitivity_dbm`: what IEEE 802.15.4 asks of receivers at 2.4 GHz.
const SENSITIVITY_DBM: f64 = -85.0;
/// Frequency of the loss at the reference distance without `frequency` and `loss_db`.
const FREQUENCY_HZ: f64 = 2.4e9;
/// Reference distance without `reference`.
const REFERENCE_M: f64 = 1.0;
/// Distance over which shadowing loses its correlation without `distance`; chosen here, for halls.
const SHADOWING_M: f64 = 5.0;
/// Bytes that may wait without `queue_bytes`.
const QUEUE_BYTES: f64 = 65_536.0;
/// Bytes of a message beside its content without `overhead_bytes`: about those of a frame of IEEE 802.15.4.
const OVERHEAD_BYTES: f64 = 32.0;

const EXPONENTS: RangeInclusive<f64> = 1.0..=10.0;
const LENGTHS_M: RangeInclusive<f64> = 0.01..=100_000.0;
const FREQUENCIES_HZ: RangeInclusive<f64> = 1e6..=1e12;
const POWERS_DBM: RangeInclusive<f64> = -200.0..=100.0;
const LOSSES_DB: RangeInclusive<f64> = 0.0..=300.0;
const SIGMAS_DB: RangeInclusive<f64> = 0.0..=30.0;
const SHAPES: RangeInclusive<f64> = 0.5..=100.0;
const BIT_RATES_BPS: RangeInclusive<f64> = 1.0..=1e12;
const QUEUES_BYTES: RangeInclusive<f64> = 1.0..=1e9;
/// No message takes no time: the number of those that wait is bounded.
const OVERHEADS_BYTES: RangeInclusive<f64> = 1.0..=65_535.0;
/// Most distances at which the shape of fading changes.
const MAX_STEPS: usize = 16;
/// A range at which a larger share of the messages is lost is worth a remark.
const MAX_LOST: f64 = 0.999;

#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields, expecting = "the keys of [network.radio]")]
pub(super) struct RadioTable {
    range: Option<Spanned<Length>>,
    path_loss: Option<Spanned<PathLossTable>>,
    transmit_dbm: Option<Spanned<f64>>,
    sensitivity_dbm: Option<Spanned<f64>>,
    walls_db: Option<Spanned<f64>>,
    bodies_db: Option<Spanned<f64>>,
    shadowing: Option<Spanned<ShadowingTable>>,
    fading: Option<Spanned<FadingEntry>>,
    bit_rate: Option<Spanned<BitRate>>,
    queue_bytes: Option<Spanned<f64>>,
    overhead_bytes: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct PathLossTable {
    exponent: Option<f64>,
    reference: Option<Length>,
    loss_db: Option<f64>,
    frequency: Option<Frequency>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct ShadowingTable {
    sigma_db: f64,
    distance: Option<Length>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(
    untagged,
    expecting = "fading is \"none\", \"rayleigh\", or { nakagami = 1.5 }"
)]
enum FadingEntry {
    Named(FadingName),
    Nakagami(NakagamiTable),
}

#[derive(Debug, Clone, Copy, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
enum FadingName {
    None,
    Rayleigh,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct NakagamiTable {
    nakagami: f64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    beyond: Vec<BeyondTable>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct BeyondTable {
    distance: Length,
    nakagami: f64,
}

impl RadioTable {
    /// Checks the radios of a table that is at `span`.
    pub(super) fn check(
        &self,
        span: std::ops::Range<usize>,
        source: &Source,
    ) -> Result<Radio, FileError> {
        let refuse =
            |span: std::ops::Range<usize>, why: &str| FileError::at(source, Some(span), why);
        if self.range.is_none() && self.path_loss.is_none() && self.bit_rate.is_none() {
            let why = "a radio needs a limit: `range = \"20 m\"`, `path_loss = { exponent = 3.0 }`, \
                       `bit_rate = \"250 kbit/s\"`, or several of these";
            return Err(refuse(span, why));
        }
        if self.path_loss.is_none()
            && let Some((key, span)) = self.needs_path_loss()
        {
            let why = format!("`{key}` needs a `path_loss`, for example {{ exponent = 3.0 }}");
            return Err(refuse(span, &why));
        }
        if self.bit_rate.is_none() {
            let keys = [
                ("queue_bytes", &self.queue_bytes),
                ("overhead_bytes", &self.overhead_bytes),
            ];
            for (key, value) in keys {
                if let Some(value) = value {
                    let why = format!("`{key}` needs a `bit_rate`, for example \"250 kbit/s\"");
                    return Err(refuse(value.span(), &why));
                }
            }
        }

        let range_m = self.range_m(source)?;
        let model = match &self.path_loss {
            Some(path_loss) => Some(self.model(path_loss, source)?),
            None => None,
        };
        let transmitter = match &self.bit_rate {
            Some(bit_rate) => Some(self.transmitter(bit_rate, source)?),
            None => None,
        };
        Ok(Radio {
            range_m,
            model,
            transmitter,
        })
    }

    fn range_m(&self, source: &Source) -> Result<Option<f64>, FileError> {
        let Some(range) = &self.range else {
            return Ok(None);
        };
        let Length(range_m) = *range.get_ref();
        if range_m > 0.0 && range_m.is_finite() {
            return Ok(Some(range_m));
        }
        let why = "a radio reaches farther than 0 m";
        Err(FileError::at(source, Some(range.span()), why))
    }

    /// The first key that says nothing without a path loss.
    fn needs_path_loss(&self) -> Option<(&'static str, std::ops::Range<usize>)> {
        let numbers = [
            ("transmit_dbm", &self.transmit_dbm),
            ("sensitivity_dbm", &self.sensitivity_dbm),
            ("walls_db", &self.walls_db),
            ("bodies_db", &self.bodies_db),
        ];
        let mut keys = Vec::new();
        for (key, number) in numbers {
            keys.extend(number.as_ref().map(|number| (key, number.span())));
        }
        let shadowing = self.shadowing.as_ref();
        keys.extend(shadowing.map(|table| ("shadowing", table.span())));
        let fading = self.fading.as_ref();
        keys.extend(fading.map(|entry| ("fading", entry.span())));
        keys.into_iter().next()
    }

    fn model(
        &self,
        path_loss: &Spanned<PathLossTable>,
        source: &Source,
    ) -> Result<RadioModel, FileError> {
        let number = |key, value: &Option<Spanned<f64>>, bounds, default| {
            within_or(source, key, value.as_ref(), bounds, default)
        };
        let path_loss = placed(source, path_loss, path_loss.get_ref().check())?;
        let shadowing = match &self.shadowing {
            Some(table) => Some(placed(source, table, table.get_ref().check())?),
            None => None,
        };
        let fading = match &self.fading {
            Some(entry) => placed(source, entry, entry.get_ref().check())?,
            None => Fading::None,
        };

        Ok(RadioModel {
            transmit_dbm: number(
                "transmit_dbm",
                &self.transmit_dbm,
                &POWERS_DBM,
                TRANSMIT_DBM,
            )?,
            sensitivity_dbm: number(
                "sensitivity_dbm",
                &self.sensitivity_dbm,
                &POWERS_DBM,
                SENSITIVITY_DBM,
            )?,
            path_loss,
            walls_db: number("walls_db", &self.walls_db, &LOSSES_DB, 0.0)?,
            bodies_db: number("bodies_db", &self.bodies_db, &LOSSES_DB, 0.0)?,
            // A deviation of 0 is no shadowing.
            shadowing: shadowing.filter(|shadowing| shadowing.sigma_db > 0.0),
            fading,
        })
    }

    fn transmitter(
        &self,
        bit_rate: &Spanned<BitRate>,
        source: &Source,
    ) -> Result<Transmitter, FileError> {
        let number = |key, value: &Option<Spanned<f64>>, bounds, default| {
            within_or(source, key, value.as_ref(), bounds, default)
        };
        let BitRate(bit_rate_bps) = *bit_rate.get_ref();
        let transmitter = Transmitter {
            bit_rate_bps: placed(
                source,
                bit_rate,
                within("bit_rate in bit/s", bit_rate_bps, &BIT_RATES_BPS),
            )?,
            queue_bytes: number("queue_bytes", &self.queue_bytes, &QUEUES_BYTES, QUEUE_BYTES)?,
            overhead_bytes: number(
                "overhead_bytes",
                &self.overhead_bytes,
                &OVERHEADS_BYTES,
                OVERHEAD_BYTES,
            )?,
        };

        if transmitter.overhead_bytes > transmitter.queue_bytes {
            let why = format!(
                "no message fits into the queue: {} bytes, and each message has {} beside its content",
                transmitter.queue_bytes, transmitter.overhead_bytes
            );
            let span = self.queue_bytes.as_ref().or(self.overhead_bytes.as_ref());
            return Err(FileError::at(source, span.map(Spanned::span), &why));
        }
        Ok(transmitter)
    }

    /// What in a radio that can be used makes no sense, with its place.
    pub(super) fn remark(&self, source: &Source) -> Option<FileError> {
        let radio = self.check(0..0, source).ok()?;
        let model = radio.model?;
        let nominal_m = model.nominal_range_m();
        if let (Some(range), Some(range_m)) = (&self.range, radio.range_m)
            && outage::at_distance(&model, range_m) > MAX_LOST
        {
            let text = format!(
                "less than one message in 1000 is received from {range_m} m: the power reaches the sensitivity up to {nominal_m:.3} m"
            );
            return Some(FileError::warning(source, Some(range.span()), &text));
        }

        let path_loss = self.path_loss.as_ref()?;
        // Robots do not come closer than this to each other.
        const CLOSE_M: f64 = 0.1;
        if outage::at_distance(&model, CLOSE_M) > MAX_LOST {
            let text = "nothing is received, however close the robots are: the loss is above `transmit_dbm` less `sensitivity_dbm`";
            return Some(FileError::warning(source, Some(path_loss.span()), text));
        }
        None
    }
}

impl PathLossTable {
    fn check(&self) -> Result<PathLoss, String> {
        let frequency_hz = match self.frequency {
            Some(Frequency(hertz)) => Some(within("frequency in Hz", hertz, &FREQUENCIES_HZ)?),
            None => None,
        };
        let Some(exponent) = self.exponent else {
            if self.reference.is_some() || self.loss_db.is_some() {
                return Err("`reference` and `loss_db` need an `exponent`".to_owned());
            }
            let frequency_hz = frequency_hz
                .ok_or("a path loss has an `exponent`, or a `frequency` for free space")?;
            return Ok(PathLoss::Friis { frequency_hz });
        };

        let reference_m = match self.reference {
            Some(Length(length_m)) => within("reference in m", length_m, &LENGTHS_M)?,
            None => REFERENCE_M,
        };
        let reference_db = match self.loss_db {
            Some(_) if frequency_hz.is_some() => {
                return Err("`loss_db` and `frequency` both say what is lost up to the reference distance: leave one out".to_owned());
            }
            Some(loss_db) => within("loss_db", loss_db, &LOSSES_DB)?,
            None => {
                let frequency_hz = frequency_hz.unwrap_or(FREQUENCY_HZ);
                PathLoss::Friis { frequency_hz }.loss_db(reference_m)
            }
        };
        Ok(PathLoss::LogDistance {
            exponent: within("exponent", exponent, &EXPONENTS)?,
            reference_m,
            reference_db,
        })
    }
}

impl ShadowingTable {
    fn check(&self) -> Result<Shadowing, String> {
        let distance_m = match self.distance {
            Some(Length(length_m)) => within("distance in m", length_m, &LENGTHS_M)?,
            None => SHADOWING_M,
        };
        Ok(Shadowing {
            sigma_db: within("sigma_db", self.sigma_db, &SIGMAS_DB)?,
            distance_m,
        })
    }
}

impl FadingEntry {
    fn check(&self) -> Result<Fading, String> {
        let table = match self {
            Self::Named(FadingName::None) => return Ok(Fading::None),
            Self::Named(FadingName::Rayleigh) => return Ok(Fading::Rayleigh),
            Self::Nakagami(table) => table,
        };
        if table.beyond.len() > MAX_STEPS {
            return Err(format!("`beyond` has at most {MAX_STEPS} entries"));
        }

        let mut steps = vec![NakagamiStep {
            from_m: 0.0,
            m: within("nakagami", table.nakagami, &SHAPES)?,
        }];
        for beyond in &table.beyond {
            let from_m = within("distance in m", beyond.distance.0, &LENGTHS_M)?;
            if steps.last().is_some_and(|step| from_m <= step.from_m) {
                return Err("the entries of `beyond` are ordered by `distance`".to_owned());
            }
            let m = within("nakagami", beyond.nakagami, &SHAPES)?;
            steps.push(NakagamiStep { from_m, m });
        }
        Ok(Fading::Nakagami(steps))
    }
}

/// A number within bounds; otherwise what is wrong.
fn within(key: &str, value: f64, bounds: &RangeInclusive<f64>) -> Result<f64, String> {
    if bounds.contains(&value) {
        Ok(value)
    } else {
        Err(format!("{key} is {} to {}", bounds.start(), bounds.end()))
    }
}

fn within_or(
    source: &Source,
    key: &str,
    value: Option<&Spanned<f64>>,
    bounds: &RangeInclusive<f64>,
    default: f64,
) -> Result<f64, FileError> {
    match value {
        Some(value) => placed(source, value, within(key, *value.get_ref(), bounds)),
        None => Ok(default),
    }
}

/// A result whose error is at the place of an entry.
fn placed<T, V>(
    source: &Source,
    entry: &Spanned<V>,
    result: Result<T, String>,
) -> Result<T, FileError> {
    result.map_err(|why| FileError::at(source, Some(entry.span()), &why))
}

impl From<&Radio> for RadioTable {
    fn from(radio: &Radio) -> Self {
        let mut table = Self {
            range: radio.range_m.map(|range_m| unplaced(Length(range_m))),
            ..Self::default()
        };

        if let Some(model) = &radio.model {
            table.path_loss = Some(unplaced(model.path_loss.into()));
            table.transmit_dbm = Some(unplaced(model.transmit_dbm));
            table.sensitivity_dbm = Some(unplaced(model.sensitivity_dbm));
            table.walls_db = Some(unplaced(model.walls_db));
            table.bodies_db = Some(unplaced(model.bodies_db));
            table.shadowing = model.shadowing.map(|shadowing| {
                unplaced(ShadowingTable {
                    sigma_db: shadowing.sigma_db,
                    distance: Some(Length(shadowing.distance_m)),
                })
            });
            table.fading = Some(unplaced((&model.fading).into()));
        }
        if let Some(transmitter) = &radio.transmitter {
            table.bit_rate = Some(unplaced(BitRate(transmitter.bit_rate_bps)));
            table.queue_bytes = Some(unplaced(transmitter.queue_bytes));
            table.overhead_bytes = Some(unplaced(transmitter.overhead_bytes));
        }
        table
    }
}

impl From<PathLoss> for PathLossTable {
    fn from(path_loss: PathLoss) -> Self {
        match path_loss {
            PathLoss::LogDistance {
                exponent,
                reference_m,
                reference_db,
            } => Self {
                exponent: Some(exponent),
                reference: Some(Length(reference_m)),
                loss_db: Some(reference_db),
                frequency: None,
            },
            PathLoss::Friis { frequency_hz } => Self {
                exponent: None,
                reference: None,
                loss_db: None,
                frequency: Some(Frequency(frequency_hz)),
            },
        }
    }
}

impl From<&Fading> for FadingEntry {
    fn from(fading: &Fading) -> Self {
        let steps = match fading {
            Fading::None => return Self::Named(FadingName::None),
            Fading::Rayleigh => return Self::Named(FadingName::Rayleigh),
            Fading::Nakagami(steps) => steps,
        };
        let mut beyond = Vec::new();
        for step in steps.iter().skip(1) {
            beyond.push(BeyondTable {
                distance: Length(step.from_m),
                nakagami: step.m,
            });
        }
        Self::Nakagami(NakagamiTable {
            nakagami: steps.first().map_or(1.0, |step| step.m),
            beyond,
        })
    }
}
