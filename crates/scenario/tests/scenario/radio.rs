//! `[network.radio]`: what is read, what is refused where, and what is remarked.

use std::path::Path;

use radio::{Fading, PathLoss};
use scenario::diagnostic::{FileError, Source};
use scenario::network::Radio;
use scenario::{Changes, Network, Scenario};

const ROBOTS: &str = "[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n[[robot]]\nname = \"B\"\nat = [\"4 m\", \"2 m\"]\n";

fn parse_text(text: String) -> Result<Scenario, FileError> {
    let name = "test".into();
    Scenario::parse(&Source { name, text }, Path::new("."))
}

fn parse(radio: &str) -> Result<Network, FileError> {
    let scenario = parse_text(format!("[network.radio]\n{radio}\n{ROBOTS}"))?;
    let written = parse_text(scenario.to_toml().unwrap())?;
    assert_eq!(written.network, scenario.network, "what is written is read");
    Ok(scenario.network)
}

fn radio(radio: &str) -> Radio {
    let network = parse(radio).unwrap_or_else(|error| panic!("{}", error.in_words()));
    network.radio.unwrap()
}

#[test]
fn keys_have_the_defaults_of_the_page() {
    let only_range = radio("range = \"5 m\"");
    assert!(only_range.model.is_none() && only_range.transmitter.is_none());
    assert_eq!(only_range.reach_m(), Some(5.0));

    let model = radio("path_loss = { exponent = 3 }").model.unwrap();
    assert_eq!((model.transmit_dbm, model.sensitivity_dbm), (0.0, -85.0));
    assert_eq!((model.walls_db, model.bodies_db), (0.0, 0.0));
    assert_eq!((model.shadowing, &model.fading), (None, &Fading::None));
    let PathLoss::LogDistance { reference_db, .. } = model.path_loss else {
        panic!("{model:?}");
    };
    // Free space at 2.4 GHz and 1 m: 20 log10(4 pi f / c).
    assert!((reference_db - 40.052).abs() < 1e-3, "{reference_db}");

    let rate = radio("bit_rate = \"250 kbit/s\"").transmitter.unwrap();
    assert_eq!(rate.bit_rate_bps, 250_000.0);
    assert_eq!((rate.queue_bytes, rate.overhead_bytes), (65_536.0, 32.0));
}

#[test]
fn all_keys_are_read_and_written() {
    let all = radio(
        "range = \"60 m\"\npath_loss = { exponent = 2.7, reference = \"2 m\", frequency = \"868 MHz\" }\ntransmit_dbm = 14\n\
         sensitivity_dbm = -97.5\nwalls_db = 6\nbodies_db = 3\nshadowing = { sigma_db = 4, distance = \"3 m\" }\n\
         fading = { nakagami = 1.5, beyond = [{ distance = \"80 m\", nakagami = 0.75 }] }\nbit_rate = \"1 Mbit/s\"\n\
         queue_bytes = 4096\noverhead_bytes = 12",
    );
    let model = all.model.as_ref().unwrap();
    assert_eq!(model.fading.shape(100.0), Some(0.75));
    assert_eq!(all.reach_m(), Some(60.0));
    let free = radio("path_loss = { frequency = \"2.4 GHz\" }\nfading = \"rayleigh\"");
    let model = free.model.unwrap();
    assert_eq!(model.fading, Fading::Rayleigh);
    assert_eq!(
        model.path_loss,
        PathLoss::Friis {
            frequency_hz: 2.4e9
        }
    );
}

#[test]
fn what_makes_no_sense_is_refused_where_it_is() {
    let path = "path_loss = { exponent = 3 }\n";
    let rate = "bit_rate = \"1 kbit/s\"\n";
    for (text, line, reason) in [
        (
            String::new(),
            1,
            "a radio needs a limit: `range = \"20 m\"`",
        ),
        (
            "range = \"5 m\"\nwalls_db = 3".to_owned(),
            3,
            "`walls_db` needs a `path_loss`",
        ),
        (
            "range = \"5 m\"\nfading = \"rayleigh\"".to_owned(),
            3,
            "`fading` needs a `path_loss`",
        ),
        (
            "range = \"5 m\"\nqueue_bytes = 9".to_owned(),
            3,
            "`queue_bytes` needs a `bit_rate`",
        ),
        (
            "path_loss = {}".to_owned(),
            2,
            "an `exponent`, or a `frequency`",
        ),
        (
            "path_loss = { loss_db = 40 }".to_owned(),
            2,
            "need an `exponent`",
        ),
        (
            "path_loss = { exponent = 0.5 }".to_owned(),
            2,
            "exponent is 1 to 10",
        ),
        (
            "path_loss = { exponent = nan }".to_owned(),
            2,
            "exponent is 1 to 10",
        ),
        (
            "path_loss = { frequency = \"5 m\" }".to_owned(),
            2,
            "a frequency such as",
        ),
        (
            "path_loss = { exponent = 3, loss_db = 40, frequency = \"1 GHz\" }".to_owned(),
            2,
            "leave one out",
        ),
        (
            format!("{path}transmit_dbm = 101"),
            3,
            "transmit_dbm is -200 to 100",
        ),
        (format!("{path}walls_db = -1"), 3, "walls_db is 0 to 300"),
        (
            format!("{path}shadowing = {{ sigma_db = 31 }}"),
            3,
            "sigma_db is 0 to 30",
        ),
        (
            format!("{path}shadowing = {{ sigma_db = 3, distance = \"0 m\" }}"),
            3,
            "distance in m is 0.01",
        ),
        (format!("{path}fading = \"rice\""), 3, "{ nakagami = 1.5 }"),
        (
            format!("{path}fading = {{ nakagami = 0.4 }}"),
            3,
            "nakagami is 0.5 to 100",
        ),
        (
            format!(
                "{path}fading = {{ nakagami = 1, beyond = [{{ distance = \"9 m\", nakagami = 1 }}, {{ distance = \"8 m\", nakagami = 2 }}] }}"
            ),
            3,
            "ordered by `distance`",
        ),
        (format!("{rate}queue_bytes = 20"), 3, "no message fits"),
        (
            format!("{rate}overhead_bytes = 0"),
            3,
            "overhead_bytes is 1 to",
        ),
        (
            "bit_rate = \"0 bit/s\"".to_owned(),
            2,
            "bit_rate in bit/s is 1",
        ),
        ("bit_rate = 5".to_owned(), 2, "a bit rate such as"),
        (format!("{path}colour = 1"), 3, "unknown field `colour`"),
    ] {
        let error = parse(&text).expect_err(&text).in_words();
        assert!(error.contains(reason), "{text}: {error}");
        assert!(
            error.starts_with(&format!("line {line}")),
            "{text}: {error}"
        );
    }
}

/// Remarks about a radio.
fn remarks(radio: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("test.toml");
    std::fs::write(&file, format!("[network.radio]\n{radio}\n{ROBOTS}")).unwrap();
    let remarks = Scenario::remarks(&file, &Changes::default()).unwrap();
    remarks.iter().map(FileError::in_words).collect()
}

#[test]
fn a_range_where_nothing_is_received_is_remarked() {
    let model = "path_loss = { exponent = 3, loss_db = 40 }\nsensitivity_dbm = -70\n";
    for (radio, words) in [
        (format!("{model}range = \"50 m\""), "up to 10.000 m"),
        (
            format!("{model}range = \"50 m\"\nfading = \"rayleigh\""),
            "less than one message in 1000",
        ),
        (format!("{model}transmit_dbm = -40"), "however close"),
    ] {
        let remarks = remarks(&radio);
        assert_eq!(remarks.len(), 1, "{radio}: {remarks:?}");
        assert!(remarks[0].contains(words), "{remarks:?}");
    }

    for radio in [
        format!("{model}range = \"9 m\""),
        format!("{model}range = \"15 m\"\nfading = \"rayleigh\""),
        format!("{model}range = \"50 m\"\nshadowing = {{ sigma_db = 12 }}"),
        model.to_owned(),
    ] {
        assert_eq!(remarks(&radio), Vec::<String>::new(), "{radio}");
    }
}
