//! Damaged files: a scenario, a launch file, and the record of a run.

use std::process::Command;
use std::time::Duration;

use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use protocol::random::stream;
use system_tests::{Lab, programs, root};

use super::plan::below;
use crate::files::{damaged, ends_within, make_surroundings};
use crate::record;

/// Longest time for reading a damaged file, and for executing 2 s of it if it is still good.
const LIMIT: Duration = Duration::from_secs(60);

/// Damages a shipped scenario and a shipped launch file: each is used, or the error names it or the file that
/// it refers to. Returns how many files were damaged.
pub(super) fn files(lab: &Lab, seed: u64) -> usize {
    let folder = lab.out().join("files");
    let kinds = [("configs", "launch"), ("launch", "configs")];
    for (kind, others) in kinds {
        make_surroundings(&folder, kind, others);
        let file = folder.join(kind).join("damaged.toml");
        std::fs::write(&file, draw(kind, seed)).unwrap();

        let mut check = Command::new(programs().join("cars"));
        check.current_dir(root()).arg("check").arg(&file);
        let what = format!("cars check of a file in {kind}");
        let (checked, printed) = ends_within(LIMIT, check, &what);
        assert_ended(&what, checked, &[0, 1], &printed, seed, kind);
        assert!(printed.contains("damaged.toml"), "{what}: {printed}");

        let mut run = Command::new(programs().join("cars"));
        run.current_dir(root()).args(["run", "--duration", "2 s"]);
        run.arg(&file).arg("--out").arg(lab.out());
        let what = format!("cars run of a file in {kind}");
        let (ran, printed) = ends_within(LIMIT, run, &what);
        // Within 2 s a scenario need not do what it expects.
        assert_ended(&what, ran, &[0, 1, 2], &printed, seed, kind);
        if checked == Some(1) && ran == Some(1) {
            // A damaged launch file may name another scenario.
            let is_named = printed.contains("damaged.toml") || printed.contains("cannot read ");
            assert!(is_named, "{what}: {printed}");
        }
    }

    kinds.len()
}

/// A program that read a damaged file has ended in order, with one of these statuses.
fn assert_ended(
    what: &str,
    code: Option<i32>,
    statuses: &[i32],
    printed: &str,
    seed: u64,
    kind: &str,
) {
    let is_in_order =
        code.is_some_and(|code| statuses.contains(&code)) && !printed.contains("panicked");
    assert!(
        is_in_order,
        "{what}: {code:?}\n{printed}\n{}",
        draw(kind, seed)
    );
}

/// A damaged file of this folder, the same for the same seed.
fn draw(kind: &str, seed: u64) -> String {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    let random = TestRng::from_seed(RngAlgorithm::ChaCha, &bytes);
    let mut runner = TestRunner::new_with_rng(Config::default(), random);

    damaged(kind).new_tree(&mut runner).unwrap().current()
}

/// Changes one bit of a record: `cars check` must name the lines.
pub(super) fn record(lab: &Lab, run: &str, seed: u64) {
    let events = lab.file(run, "events.jsonl");
    let mut bytes = std::fs::read(&events).unwrap();
    let mut chance = stream(seed, "record");
    // Without the end of its last line a record is not damaged: it ends in the middle.
    let place = below(&mut chance, bytes.len() - 1);
    let line = 1 + bytes[..place].iter().filter(|byte| **byte == b'\n').count();
    bytes[place] ^= 1 << below(&mut chance, 8);
    std::fs::write(&events, &bytes).unwrap();

    let (code, printed) = record::check(lab, &lab.out().join(run).display().to_string());
    assert_eq!(code, 1, "byte {place} is damaged: {printed}");
    let (first, last) = record::lines_of(&printed);
    assert!(
        (first..=last).contains(&line),
        "byte {place} in line {line} is damaged: {printed}"
    );
}
