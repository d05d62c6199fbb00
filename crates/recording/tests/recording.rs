//! Recordings as they are written and read, whole, cut off and damaged.

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set up its subject fails"
)]

use std::collections::BTreeMap;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use protocol::messages::{
    Awaited, Cut, DisplayUnit, End, GuestMood, LogKind, LogRecord, Panel, Performative, Point,
    Reason, Report, Variable, Widget,
};
use protocol::{Event, RobotName, RunName, Tick};
use recording::content::Missed;
use recording::{
    Frame, Header, PlacedRobot, RecordedTick, Recording, RecordingError, WallTimes, Writer,
};

const SCENARIO: &str = "seed = 7\n";
/// Enough for several chunks.
const TICKS: Tick = 3000;

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

fn header() -> Header {
    Header {
        run: RunName::new("hall").unwrap(),
        epoch: 2,
        seed: 7,
        version: "1.2.3".to_owned(),
        commit: Some("abc".to_owned()),
        protocol: 2,
        tick_s: 0.1,
        duration_s: 300.0,
        field_m: [30.0, 20.0],
        body_m: 0.5,
        display_unit: DisplayUnit::Feet,
        sites: Vec::new(),
        layers: Vec::new(),
        obstacles: vec![[1.0, 2.0]],
        static_world: Default::default(),
        robots: vec![name("Butler"), name("Leguin")],
    }
}

fn report(tick: Tick) -> Report {
    Report {
        epoch: 2,
        tick,
        generation: 1 + (tick / 1000) as u32,
        proposal: Point {
            x: (tick as f64).sqrt(),
            y: 1.0 / (1.0 + tick as f64),
        },
        speed_mps: 0.1,
        direction_rad: -0.000_001,
        emotion_state: "HAPPY".to_owned(),
        behavior_state: format!("behavior-{}", tick % 7),
        state_variables: [
            ("treats".to_owned(), Variable::Number(tick as f64)),
            ("is_full".to_owned(), Variable::Flag(tick.is_multiple_of(2))),
        ]
        .into(),
        commands: (tick % 3) as u32,
        log: vec![format!("line {tick}")],
        site_actions: Vec::new(),
        layer_actions: Vec::new(),
        velocity: None,
    }
}

/// A tick; Leguin misses every tenth one.
fn tick(tick: Tick) -> RecordedTick {
    let is_missed = tick % 10 == 9;
    let mut reports = BTreeMap::from([(name("Butler"), report(tick).into())]);
    if !is_missed {
        reports.insert(name("Leguin"), report(tick).into());
    }
    let mut panels = BTreeMap::new();
    if tick == 5 || tick == 1234 {
        let label = format!("panel {tick}");
        let text = String::new();
        let widgets = vec![Widget::Text {
            label: label.into(),
            text: text.into(),
        }];
        panels.insert(name("Leguin"), Panel { widgets });
    }

    RecordedTick {
        frame: Frame {
            tick,
            robots: vec![
                PlacedRobot {
                    name: name("Butler"),
                    location: Point { x: 0.1, y: 0.3 },
                    heading_rad: Some(-1.25),
                    blocked: tick.is_multiple_of(4),
                    missed: None,
                },
                PlacedRobot {
                    name: name("Leguin"),
                    location: Point { x: 0.7, y: 1e-9 },
                    heading_rad: None,
                    blocked: false,
                    missed: is_missed.then_some(Missed {
                        last_report: tick.checked_sub(1),
                    }),
                },
            ],
            guests_mm: (0..40)
                .map(|i| (i * 7919 + tick as i64 * 31) % 29_989)
                .collect(),
            // Of the first three ticks, as where guests do not enter and leave.
            guest_numbers: if tick < 3 {
                Vec::new()
            } else {
                (5..25).collect()
            },
            guest_moods: [(GuestMood::Waiting, vec![3, 7])].into(),
            measures: [("left".to_owned(), tick as f64 / 3.0)].into(),
            expectations: Vec::new(),
            sites: BTreeMap::new(),
            layers: Vec::new(),
            cuts: vec![Cut {
                from: name("Butler"),
                to: name("Leguin"),
                commands: true,
                queries: false,
            }],
            unreachable: [(name("Butler"), vec![name("Leguin")])].into(),
        },
        events: vec![
            Event::CommandSent {
                from: name("Leguin"),
                to: name("Butler"),
                seq: tick,
                performative: Performative::Achieve,
                command: "come".to_owned(),
                payload: None,
                payload_of: None,
            },
            Event::Tick {
                digest: format!("{tick:032x}"),
                seal: None,
            },
        ]
        .into(),
        reports,
        panels,
        wall: WallTimes {
            opened_ns: tick * 1000,
            completed_ns: tick * 1000 + 500,
            reports_ns: [(name("Butler"), tick * 1000 + 400)].into(),
            awaited: vec![Awaited {
                name: name("Butler"),
                since_s: 0.5,
                because: Reason::Silent,
            }],
            late: vec![LogRecord {
                epoch: 1,
                tick,
                time_s: 0.0,
                tick_s: 0.5,
                source: "simulator".to_owned(),
                kind: LogKind::Late,
                text: "the clock is held".to_owned(),
            }],
        },
    }
}

fn end() -> Event {
    Event::End {
        reason: End::Finished,
        because: None,
        waited_for: Vec::new(),
        digest: "0".repeat(32),
        seal: None,
    }
}

/// The tick as it is read: the last one has the end of the run.
fn expected(number: Tick, ticks: Tick) -> RecordedTick {
    let mut expected = tick(number);
    if number + 1 == ticks {
        Arc::make_mut(&mut expected.events).push(end());
    }
    expected
}

fn write(folder: &Path, ticks: Tick) -> PathBuf {
    let path = folder.join("run.mcap");
    let mut writer = Writer::create(&path, &header(), SCENARIO).unwrap();
    for number in 0..ticks {
        writer.tick(tick(number)).unwrap();
    }
    writer.end(ticks - 1, end()).unwrap();
    writer.finish().unwrap();
    path
}

#[test]
fn what_is_read_is_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let recording = Recording::open(&write(folder.path(), TICKS)).unwrap();

    assert_eq!(*recording.header(), header());
    assert_eq!(recording.scenario().unwrap(), SCENARIO);
    assert!(recording.is_finished());
    assert_eq!(recording.len(), TICKS);
    let ticks = recording.read(0, TICKS + 5).unwrap();
    assert_eq!(ticks.len() as u64, TICKS);
    for (number, tick) in ticks.into_iter().enumerate() {
        assert_eq!(tick, expected(number as u64, TICKS));
    }

    for from in (0..TICKS).step_by(97) {
        let ticks = recording.read(from, from + 3).unwrap();
        for (number, tick) in (from..).zip(&ticks) {
            assert_eq!(*tick, expected(number, TICKS));
        }
        assert_eq!(ticks.len() as u64, 3.min(TICKS - from));
    }
    assert_eq!(recording.read(TICKS, TICKS + 1).unwrap(), []);
}

#[test]
fn an_old_report_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let recording = Recording::open(&write(folder.path(), TICKS)).unwrap();
    let leguin = name("Leguin");

    let found = recording.report(&leguin, 1008).unwrap().unwrap();
    let found: Report = serde_json::from_slice(found.as_bytes()).unwrap();
    assert_eq!(found, report(1008));
    assert_eq!(recording.report(&leguin, 1009).unwrap(), None);
}

/// Opens a file with this content; whatever it has must be what was written.
fn check(folder: &Path, bytes: &[u8], what: &str) -> Result<u64, RecordingError> {
    let path = folder.join("other.mcap");
    std::fs::write(&path, bytes).unwrap();
    let recording = Recording::open(&path)?;
    assert_eq!(*recording.header(), header(), "{what}");
    if let Ok(scenario) = recording.scenario() {
        assert_eq!(scenario, SCENARIO, "{what}");
    }

    // Range by range, so that the parts before and after damage are read.
    let mut damage = None;
    for from in (0..recording.len()).step_by(100) {
        match recording.read(from, from + 100) {
            Ok(ticks) => {
                for (number, found) in (from..).zip(ticks) {
                    // The end of the run is lost with the chunk that has it.
                    let is_whole = found == expected(number, TICKS);
                    assert!(is_whole || found == tick(number), "{what}: tick {number}");
                }
            }
            Err(error) => {
                let text = error.to_string();
                let names_place = text.contains("other.mcap") && text.contains(" byte ");
                assert!(names_place, "{what}: {text}");
                damage = Some(error);
            }
        }
    }
    match damage {
        Some(error) => Err(error),
        None => Ok(recording.len()),
    }
}

#[test]
fn a_recording_that_was_cut_off_has_its_complete_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(write(folder.path(), TICKS)).unwrap();

    let mut before = 0;
    for tenth in 1..10 {
        let what = format!("{tenth} tenths");
        let cut = &bytes[..bytes.len() * tenth / 10];
        let ticks = check(folder.path(), cut, &what).unwrap();
        assert!((before..=TICKS).contains(&ticks), "{what}: {ticks}");
        before = ticks;
    }
    assert!(before > TICKS / 2, "{before} of {TICKS} ticks");

    // Without anything of the index, all ticks are left.
    let end = bytes.len() - 100;
    assert_eq!(
        check(folder.path(), &bytes[..end], "no end").unwrap(),
        TICKS
    );
    for len in [0, 7, 8, 40] {
        let error = check(folder.path(), &bytes[..len], "beginning").unwrap_err();
        assert!(matches!(error, RecordingError::Headless { .. }), "{error}");
    }
}

#[test]
fn a_damaged_byte_is_an_error_that_names_the_place_or_changes_nothing() {
    damage_bytes(0x80, 4);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn each_damaged_byte_is_an_error_that_names_the_place_or_changes_nothing() {
    damage_bytes(0x80, 1);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_byte_that_is_damaged_a_little_is_an_error_that_names_the_place_or_changes_nothing() {
    damage_bytes(0x01, 1);
}

/// Changes these bits of one byte after the other, at one of so many places.
fn damage_bytes(mask: u8, one_of: usize) {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(write(folder.path(), TICKS)).unwrap();
    let inner = (400..bytes.len() - 400).step_by(bytes.len() / 60);
    let begin = (0..400).step_by(9);
    let end = (bytes.len() - 400..bytes.len()).step_by(9);
    let places = begin.chain(inner).chain(end).step_by(one_of);
    let places: Vec<usize> = places.collect();
    let damage = &|places: &[usize]| {
        let folder = tempfile::tempdir().unwrap();
        let mut errors = 0;
        for at in places {
            let mut damaged = bytes.clone();
            damaged[*at] ^= mask;
            let what = format!("byte {at} of {} ^ {mask:#x}", bytes.len());
            if let Err(error) = check(folder.path(), &damaged, &what) {
                assert!(error.to_string().contains("other.mcap"), "{what}: {error}");
                errors += 1;
            }
        }
        errors
    };

    let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
    let errors: usize = std::thread::scope(|scope| {
        let parts = places.chunks(places.len().div_ceil(threads));
        let workers: Vec<_> = parts
            .map(|part| scope.spawn(move || damage(part)))
            .collect();
        workers
            .into_iter()
            .map(|worker| worker.join().unwrap())
            .sum()
    });
    assert!(errors > 25 / one_of, "{errors}");
}

/// Whether every byte of the file is found to be as it was written.
fn is_as_written(folder: &Path, bytes: &[u8]) -> bool {
    let path = folder.join("other.mcap");
    std::fs::write(&path, bytes).unwrap();
    let Ok(recording) = Recording::open(&path) else {
        return false;
    };
    recording.is_finished() && recording.check().is_ok()
}

#[test]
fn a_changed_byte_anywhere_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(write(folder.path(), 300)).unwrap();
    assert!(is_as_written(folder.path(), &bytes));

    let inner = (800..bytes.len() - 1200).step_by(bytes.len() / 100);
    let begin = 0..800;
    let end = bytes.len() - 1200..bytes.len();
    for at in begin.chain(inner).chain(end) {
        let mut changed = bytes.clone();
        changed[at] ^= 1;
        assert!(!is_as_written(folder.path(), &changed), "byte {at}");
    }
}

#[test]
fn metadata_of_a_file_without_an_end_is_compared_with_its_header() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = std::fs::read(write(folder.path(), 300)).unwrap();
    bytes.truncate(bytes.len() - 100);
    let path = folder.path().join("other.mcap");
    let seed = b"seed\x01\x00\x00\x007";
    let at = bytes.windows(seed.len()).position(|part| part == seed);
    let at = at.unwrap() + seed.len() - 1;

    std::fs::write(&path, &bytes).unwrap();
    Recording::open(&path).unwrap().check().unwrap();
    bytes[at] = b'8';
    std::fs::write(&path, &bytes).unwrap();
    let error = Recording::open(&path).unwrap().check().unwrap_err();
    assert!(error.to_string().contains("the metadata"), "{error}");
}

#[test]
fn zeros_after_the_last_chunk_were_never_written() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(write(folder.path(), TICKS)).unwrap();
    let cut = &bytes[..bytes.len() / 2];
    let ticks = check(folder.path(), cut, "cut").unwrap();

    // Behind a whole record, or within one, as a file system leaves it.
    let ends = record_ends(&bytes);
    let whole = ends.iter().rfind(|end| **end <= cut.len()).unwrap();
    for (kept, zeros) in [(*whole, 1), (*whole, 4096), (*whole, 3 << 20)] {
        let longer = [&bytes[..kept], &vec![0; zeros]].concat();
        assert_eq!(check(folder.path(), &longer, "zeros").unwrap(), ticks);
    }
    let error = check(
        folder.path(),
        &[&bytes[..*whole], &[0; 4096], &bytes[*whole..cut.len()]].concat(),
        "a hole",
    );
    let error = error.unwrap_err().to_string();
    assert!(
        error.contains(&format!("damaged at byte {whole}")),
        "{error}"
    );
}

/// The offset after each record of a file and, of every record, whether a reader sees it whole there.
fn record_ends(bytes: &[u8]) -> Vec<usize> {
    let mut ends = Vec::new();
    let mut at = 8;
    while at + 9 <= bytes.len() - 8 {
        let len = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
        at += 9 + len as usize;
        ends.push(at);
    }
    ends
}

#[test]
fn a_recording_is_read_while_it_grows() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(write(folder.path(), TICKS)).unwrap();
    let path = folder.path().join("growing.mcap");
    let whole = |recording: &Recording| {
        let len = recording.len();
        let from = len.saturating_sub(5);
        for (number, tick) in (from..).zip(recording.read(from, len).unwrap()) {
            assert!(tick == expected(number, TICKS) || tick == self::tick(number));
        }
        len
    };

    // It is written in pieces that end anywhere: within records, and at the end of each.
    let mut cuts: Vec<usize> = (500..bytes.len()).step_by(bytes.len() / 40).collect();
    cuts.extend(record_ends(&bytes));
    cuts.sort_unstable();
    let mut growing: Option<Recording> = None;
    let mut before = 0;
    for cut in cuts {
        std::fs::write(&path, &bytes[..cut]).unwrap();
        match &mut growing {
            Some(recording) => recording.grow().unwrap(),
            None => growing = Recording::open(&path).ok(),
        }
        let Some(recording) = &growing else { continue };
        let len = whole(recording);
        assert!(len >= before, "{len} ticks after {before}");
        // It has what a reader that opens the file now has.
        assert_eq!(len, Recording::open(&path).unwrap().len());
        assert!(!recording.is_finished() || cut == bytes.len());
        before = len;
    }

    std::fs::write(&path, &bytes).unwrap();
    let mut recording = growing.unwrap();
    recording.grow().unwrap();
    assert_eq!(whole(&recording), TICKS);
    assert!(recording.is_finished());
    recording.grow().unwrap();
    assert_eq!(recording.len(), TICKS);
}

#[test]
fn a_file_that_another_one_replaced_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), 10);
    let recording = Recording::open(&path).unwrap();
    assert!(recording.is_at(&path));

    std::fs::rename(&path, folder.path().join("run-epoch2.mcap")).unwrap();
    assert!(!recording.is_at(&path));
    write(folder.path(), 10);
    assert!(!recording.is_at(&path));
    assert_eq!(recording.read(0, 10).unwrap().len(), 10);
}
