//! `planted-hunt SCENARIO SEED PLANS JOBS OUT`: the hunt of `cars hunt`, with a Leguin that has a defect. It prints the report
//! as JSON; the exit status is 1 if something was found.

#![expect(clippy::print_stdout, reason = "a test reads what this program prints")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use experiments::ByClass;
use experiments::hunt::{FaultClass, HuntBudget, HuntOptions, HuntRobots, Subject, hunt};
use scenario::Changes;

fn main() -> Result<ExitCode, Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, scenario, seed, plans, jobs, out] = arguments.as_slice() else {
        return Err("planted-hunt SCENARIO SEED PLANS JOBS OUT".into());
    };

    let changes = Changes::default();
    let robots = HuntRobots::InProcess(Arc::new(ByClass(system_tests::planted::make)));
    let subject = Subject::load_with(Path::new(scenario), &changes, robots)?;
    let options = HuntOptions {
        seed: seed.parse()?,
        budget: HuntBudget::Plans(plans.parse()?),
        jobs: jobs.parse()?,
        kinds: FaultClass::ALL.to_vec(),
        longest_s: 60.0,
        expect: BTreeSet::new(),
        shrink_runs: 1000,
        out: PathBuf::from(out),
        stop: &AtomicBool::new(false),
    };
    let report = hunt(&subject, &options, &mut |_| {})?;
    println!("{}", serde_json::to_string(&report)?);
    Ok(if report.findings.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
