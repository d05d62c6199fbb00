//! `planted-hunt SCENARIO SEED PLANS JOBS OUT [KINDS]`: the hunt of `cars hunt`, with robots that have defects. With KINDS it draws these
//! kinds of faults only, and ends with the first finding. It prints the report as JSON; the exit status is 1 if something was found.

#![expect(clippy::print_stdout, reason = "a test reads what this program prints")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use experiments::ByClass;
use hunts::{FaultClass, HuntBudget, HuntOptions, HuntProgress, HuntRobots, Subject, hunt};
use scenario::Changes;

fn main() -> Result<ExitCode, Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, scenario, seed, plans, jobs, out, rest @ ..] = arguments.as_slice() else {
        return Err("planted-hunt SCENARIO SEED PLANS JOBS OUT [KINDS]".into());
    };
    let mut kinds = FaultClass::ALL.to_vec();
    if let Some(names) = rest.first() {
        let named: Result<Vec<FaultClass>, String> = names.split(',').map(str::parse).collect();
        kinds = named?;
    }
    let ends_with_first = !rest.is_empty();
    let stop = AtomicBool::new(false);

    let changes = Changes::default();
    let robots = HuntRobots::InProcess(Arc::new(ByClass(system_tests::planted::make)));
    let subject = Subject::load_with(Path::new(scenario), &changes, robots)?;
    let options = HuntOptions {
        seed: seed.parse()?,
        budget: HuntBudget::Plans(plans.parse()?),
        jobs: jobs.parse()?,
        kinds,
        longest_s: 60.0,
        expect: BTreeSet::new(),
        shrink_runs: 1000,
        out: PathBuf::from(out),
        stop: &stop,
    };
    let report = hunt(&subject, &options, &mut |progress| {
        let is_shrunk = matches!(progress, HuntProgress::Shrunk(_));
        if is_shrunk && ends_with_first {
            stop.store(true, Ordering::Relaxed);
        }
    })?;
    println!("{}", serde_json::to_string(&report)?);
    Ok(if report.findings.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
