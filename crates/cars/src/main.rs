//! `cars`: the command line of the Cooperative Affective Robot Simulator.

mod check;
mod conform;
mod control;
mod crowd;
mod diagram;
mod emotions;
mod errors;
mod exec;
mod execution;
mod expect;
mod experiment;
mod export;
mod fork;
mod hunt;
mod init;
mod kind;
mod launch;
mod man;
mod named;
mod net;
mod new;
mod output;
mod remarks;
mod replay;
mod replay_robot;
mod report;
mod ros;
mod router;
mod run;
mod secure;
mod siblings;
mod submit;
mod table;
mod verify;
mod why;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::errors::Result;

/// The help of `cars`, with the subcommands by what they are for.
const HELP: &str = "\
{about-with-newline}
{usage-heading} {usage}

Run:
  launch       Start the processes of a launch file and run them to the end
  run          Run a scenario in this process
  experiment   Play a scenario many times: arms, conditions, seeds; on clusters, too
  hunt         Draw faults until an expectation fails, and shrink them

Look:
  report       Write a report about runs or an experiment as one HTML file
  diagram      Draw who commanded whom, what was lost, what the robots felt
  replay       Show a recorded run to consoles as if it were in progress
  emotions     Show the tree of a robot's emotions, or what it feels in a tick of a run
  log          Show the log of a run, also of one in progress
  export       Write tables as CSV, a log for ShiViz, a trace, EmotionML, a bag of ROS 2

Compare:
  check        Check files of every kind, and all that a run has left
  verify       Execute a recorded run again, and compare it tick by tick
  diff         Compare two recorded runs
  expect       Judge a recorded run by expectations
  fork         Execute a recorded run up to a tick, and go on with changes, or with other chance
  why          Find what decided a recorded run: where its outcome became likely, and by which event
  crowd        Compare models of walking with what was measured with people

Control a run in progress:
  ctl          Start, pause, step, stop, set, cut, crash, query, command, and more

Robots of your own:
  new          Make a skeleton of a robot
  exec         Run any program as a robot, over its standard input and output
  conform      Check a robot against the rules of the protocol
  init         Write the files that come with the programs, to edit them

ROS 2:
  ros          Show a run in progress to ROS 2, and serve its controls there

Network:
  net          Faults of real links: cut, delay, bandwidth
  router       Forward between a simulator and robots on other machines
  secure       Make certificates and access control for a roster

Other:
  completions  Print shell completions
  man          Write manual pages
  help         Print the help of a subcommand

Options:
{options}
";

/// The Cooperative Affective Robot Simulator.
///
/// `cars launch hors_doeuvres` plays the experiment of the paper as separate processes.
#[derive(Debug, Parser)]
#[command(
    name = "cars",
    version,
    propagate_version = true,
    help_template = HELP
)]
struct Cli {
    #[command(subcommand)]
    subcommand: Subcommands,
}

#[derive(Debug, Subcommand)]
enum Subcommands {
    /// Run any program as a robot, over its standard input and output: `cars exec --name Leguin -- ./leguin.sh`.
    Exec(exec::ExecArgs),
    /// Make a skeleton of a robot of your own: `cars new robot Rosie --lang python`.
    New(new::NewArgs),
    /// Write the files that come with the programs to a folder, to edit them: launch files, scenarios, experiments.
    Init(init::InitArgs),
    /// Start the processes of a launch file and run them to the end.
    Launch(launch::LaunchArgs),
    /// Run a scenario, or that of a launch file, in this process.
    Run(run::RunArgs),
    /// Play an experiment over many seeds, one that ships with the project or your own: run, unit, merge, status, replay.
    Experiment(experiment::ExperimentArgs),
    /// Draw faults until an expectation of a scenario fails, and shrink them to a minimal scenario file.
    ///
    /// The exit status is 0 if nothing was found, and 1 if an expectation failed.
    Hunt(hunt::HuntArgs),
    /// Check files of every kind without running anything.
    Check(check::CheckArgs),
    /// Execute a recorded run again in this process, and compare it with its record tick by tick.
    Verify(verify::VerifyArgs),
    /// Compare two recorded runs: the first difference, and how they go on.
    Diff(verify::DiffArgs),
    /// Judge a recorded run by its expectations, or by those of another file; exit status 0 pass, 1 fail, 2 undecided.
    Expect(expect::ExpectArgs),
    /// Execute a recorded run again up to a tick, and let it go on with changes: `cars fork latest@240 --set …`.
    Fork(fork::ForkArgs),
    /// Find what decided a recorded run: the probability of its outcome after each tick, and the events at which it jumps.
    ///
    /// It is computed from forks with other chance, and each cause is confirmed by forks without it.
    Why(why::WhyArgs),
    /// Models of walking, compared with what was measured with people: `cars crowd check collision-free`.
    #[command(subcommand)]
    Crowd(crowd::CrowdCommand),
    /// Show a recorded run to consoles and other observers as if it were in progress: start, pause, step, seek, speed.
    Replay(replay::ReplayArgs),
    /// Control a run in progress, or a replay: init, start, pause, step, stop, speed, status; query and command its robots.
    Ctl(control::CtlArgs),
    /// Show the log of a run; `-f` follows one in progress.
    Log(control::LogArgs),
    /// Export a run for other programs: tables as CSV, a log for ShiViz, a trace of wall-clock time, emotions as EmotionML.
    Export(export::ExportArgs),
    /// Draw the space-time diagram of a run: who commanded whom, what was lost, what the robots felt.
    Diagram(diagram::DiagramArgs),
    /// Show the taxonomy of a robot's emotions with all components, or where in it a robot of a recorded run is.
    Emotions(emotions::EmotionsArgs),
    /// Write a report about runs as one HTML file: emotions and behaviors over time, transitions, occupancy, the network.
    Report(report::ReportArgs),
    /// Check a robot, written in any language, against the rules of the protocol.
    Conform(conform::ConformArgs),
    /// Show a run in progress to ROS 2, and serve its controls there: `cars ros bridge`.
    #[command(subcommand)]
    Ros(ros::RosCommand),
    /// Faults of real links: cut, delay, bandwidth. The record is reproducible, the timing is not.
    #[command(subcommand)]
    Net(net::NetCommand),
    /// Forward between a simulator and robots on different machines.
    Router(router::RouterArgs),
    /// Make certificates and access control for a roster, for runs on a network that others can reach.
    Secure(secure::SecureArgs),
    /// Print shell completions.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write the manual pages of all programs to a folder.
    Man(man::ManArgs),
    #[command(hide = true)]
    Child(exec::ChildArgs),
    /// The process beside a launcher that ends what is left if the launcher is killed.
    #[command(hide = true)]
    Guard {
        /// Identifies the launch.
        launch: String,
    },
    #[command(hide = true)]
    ReplayRobot(replay_robot::ReplayRobotArgs),
}

fn main() -> ExitCode {
    let cli: Cli = match terminal::arguments() {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    terminal::print_diagnostics("warn,zenoh=error");

    terminal::conclude(dispatch(cli.subcommand), errors::render)
}

/// Calls the subcommand; the hidden ones follow the public ones.
fn dispatch(subcommand: Subcommands) -> Result<ExitCode> {
    match subcommand {
        Subcommands::Launch(args) => launch::launch(args),
        Subcommands::Exec(args) => exec::exec(&args),
        Subcommands::New(args) => new::new(&args),
        Subcommands::Init(args) => init::init(&args),
        Subcommands::Run(args) => run::run(args),
        Subcommands::Experiment(args) => experiment::experiment(args),
        Subcommands::Hunt(args) => Ok(hunt::hunt(&args)),
        Subcommands::Check(args) => check::check(&args),
        Subcommands::Verify(args) => verify::verify(&args),
        Subcommands::Diff(args) => verify::diff(&args),
        Subcommands::Expect(args) => expect::expect(&args),
        Subcommands::Fork(args) => fork::fork(args),
        Subcommands::Why(args) => why::why(&args),
        Subcommands::Crowd(command) => crowd::crowd(&command),
        Subcommands::Replay(args) => replay::replay(&args),
        Subcommands::Ctl(args) => control::ctl(args),
        Subcommands::Log(args) => control::log(&args),
        Subcommands::Export(args) => export::export(&args),
        Subcommands::Diagram(args) => diagram::diagram(&args),
        Subcommands::Emotions(args) => emotions::emotions(&args),
        Subcommands::Report(args) => report::report(&args),
        Subcommands::Conform(args) => conform::conform(&args),
        Subcommands::Ros(command) => ros::ros(&command),
        Subcommands::Net(command) => net::net(command),
        Subcommands::Router(args) => router::router(&args),
        Subcommands::Secure(args) => secure::secure(args),
        Subcommands::Completions { shell } => print_completions(shell),
        Subcommands::Man(args) => man::man(&args, Cli::command()),

        Subcommands::Child(args) => Ok(exec::child(&args)),
        Subcommands::Guard { launch } => {
            ::launch::guard(&launch)?;
            Ok(ExitCode::SUCCESS)
        }
        Subcommands::ReplayRobot(args) => replay_robot::take_part(&args),
    }
}

fn print_completions(shell: clap_complete::Shell) -> Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "cars", &mut script);

    terminal::data(String::from_utf8_lossy(&script))?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_lists_every_subcommand_once() {
        let command = Cli::command();
        let visible = command.get_subcommands().filter(|one| !one.is_hide_set());
        for subcommand in visible {
            let name = subcommand.get_name();
            let lines = HELP
                .lines()
                .filter(|line| line.split_whitespace().next() == Some(name));
            let listed = lines.filter(|line| line.starts_with("  ")).count();
            assert_eq!(listed, 1, "{name}");
        }
    }
}
