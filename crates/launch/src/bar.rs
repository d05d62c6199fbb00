//! The progress bar: simulated time and speed, and while the clock is held, the robots it waits for.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use protocol::messages::{Awaited, Phase, Status, WorldFrame};
use protocol::time::seconds;

/// Most redraws per second.
const REDRAWS_HZ: u8 = 10;
/// Window of the speed, which is a mean.
const SPEED_WINDOW: Duration = Duration::from_secs(2);

/// Progress of a run.
#[derive(Debug, Clone)]
pub(super) struct RunProgress {
    /// Simulated time, s.
    time_s: f64,
    /// Simulated duration of the run, s.
    duration_s: f64,
    /// Length of a tick, s.
    tick_s: f64,
    phase: Phase,
    /// Robots for which the clock is held.
    awaiting: Vec<Awaited>,
    /// When it was received.
    at: Instant,
}

impl From<WorldFrame> for RunProgress {
    fn from(frame: WorldFrame) -> Self {
        Self {
            time_s: frame.time_s,
            duration_s: frame.duration_s,
            tick_s: frame.tick_s,
            phase: frame.phase,
            awaiting: frame.awaiting,
            at: Instant::now(),
        }
    }
}

impl From<Status> for RunProgress {
    fn from(status: Status) -> Self {
        Self {
            time_s: status.time_s,
            duration_s: status.duration_s,
            tick_s: status.tick_s,
            phase: status.phase,
            awaiting: status.awaiting,
            at: Instant::now(),
        }
    }
}

/// The bar on the terminal.
pub(super) struct Bar {
    bar: ProgressBar,
    progress: Option<RunProgress>,
    speed: Speedometer,
    has_colors: bool,
}

impl Bar {
    pub(super) fn new(has_colors: bool) -> Self {
        let target = ProgressDrawTarget::stderr_with_hz(REDRAWS_HZ);
        let bar = ProgressBar::with_draw_target(Some(1), target);
        let template = if has_colors {
            "{bar:24.green} {wide_msg}"
        } else {
            "{bar:24} {wide_msg}"
        };

        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }

        bar.set_message("starting");
        bar.force_draw();

        Self {
            bar,
            progress: None,
            speed: Speedometer::default(),
            has_colors,
        }
    }

    /// Whether the clock waits for a robot.
    pub(super) fn is_held(&self) -> bool {
        let progress = self.progress.as_ref();
        progress.is_some_and(|progress| !progress.awaiting.is_empty())
    }

    /// Redraws the bar; without a newer progress, only the time for which the clock has been held changes.
    pub(super) fn update(&mut self, newer: Option<RunProgress>) {
        let was_held = self.is_held();
        if let Some(newer) = newer {
            self.speed.add(&newer);
            self.progress = Some(newer);
        }
        let Some(progress) = &self.progress else {
            return;
        };

        self.bar.update(|state| {
            state.set_len(millis(progress.duration_s).max(1));
            state.set_pos(millis(progress.time_s));
        });
        let factor = self.speed.factor();
        let message = message(progress, factor, Instant::now(), self.has_colors);
        self.bar.set_message(message);

        // No update may follow for a long time, so this one must not be dropped by the limit on redraws.
        if was_held || self.is_held() || progress.phase != Phase::Running {
            self.bar.force_draw();
        }
    }

    /// Hides the bar during `write`.
    pub(super) fn aside(&self, write: impl FnOnce()) {
        self.bar.suspend(write);
    }

    pub(super) fn clear(self) {
        self.bar.finish_and_clear();
    }
}

fn message(progress: &RunProgress, factor: Option<f64>, now: Instant, has_colors: bool) -> String {
    let phase = progress.phase;
    let time = describe_time(progress);
    match held(&progress.awaiting, now.duration_since(progress.at)) {
        Some(held) if has_colors => return format!("{time}  \u{1b}[33m{held}\u{1b}[0m"),
        Some(held) => return format!("{time}  {held}"),
        None => {}
    }

    match factor.filter(|_| phase == Phase::Running) {
        Some(factor) => format!("{time}  {phase}  {factor:.1} x real time"),
        None => format!("{time}  {phase}"),
    }
}

fn describe_time(progress: &RunProgress) -> String {
    let RunProgress {
        time_s,
        duration_s,
        tick_s,
        ..
    } = *progress;
    let percent = if duration_s > 0.0 {
        (100.0 * time_s / duration_s).floor()
    } else {
        100.0
    };
    let time = seconds(time_s, tick_s);
    let duration = seconds(duration_s, tick_s);
    format!("{percent:>3} %  {time} of {duration} s")
}

fn millis(seconds: f64) -> u64 {
    (seconds * 1000.0) as u64
}

/// Most robots that are named; the others are counted.
const MAX_NAMED: usize = 4;

/// The robots for which the clock waits, why, and for how long; `age` is that of the information.
fn held(awaiting: &[Awaited], age: Duration) -> Option<String> {
    let times_s = awaiting.iter().map(|awaited| awaited.since_s);
    let longest_s = times_s.reduce(f64::max)?;
    let for_s = (longest_s + age.as_secs_f64()).floor();

    let mut names = Vec::new();
    for awaited in awaiting.iter().take(MAX_NAMED) {
        names.push(format!("{} ({})", awaited.name, awaited.because));
    }
    if awaiting.len() > MAX_NAMED {
        names.push(format!("{} more", awaiting.len() - MAX_NAMED));
    }

    let names = names.join(", ");
    Some(format!("held for {for_s} s: waiting for {names}"))
}

/// Recent simulated seconds per second.
#[derive(Debug, Default)]
struct Speedometer {
    samples: VecDeque<(Instant, f64)>,
}

impl Speedometer {
    fn add(&mut self, progress: &RunProgress) {
        let time_s = progress.time_s;
        let last = self.samples.back();
        let is_new_epoch = last.is_some_and(|(_, before_s)| time_s < *before_s);

        // Times at which the clock is held do not count.
        if is_new_epoch || progress.phase != Phase::Running || !progress.awaiting.is_empty() {
            self.samples.clear();
        }

        while let Some((oldest, _)) = self.samples.front()
            && progress.at.duration_since(*oldest) > SPEED_WINDOW
        {
            self.samples.pop_front();
        }
        self.samples.push_back((progress.at, time_s));
    }

    fn factor(&self) -> Option<f64> {
        let (from, from_s) = self.samples.front()?;
        let (to, to_s) = self.samples.back()?;
        let elapsed_s = to.duration_since(*from).as_secs_f64();
        (elapsed_s > 0.1).then(|| (to_s - from_s) / elapsed_s)
    }
}

#[cfg(test)]
mod tests {
    use protocol::RobotName;
    use protocol::messages::Reason;

    use super::*;

    fn progress(awaiting: Vec<Awaited>) -> RunProgress {
        RunProgress {
            time_s: 123.5,
            duration_s: 600.0,
            tick_s: 0.5,
            phase: Phase::Running,
            awaiting,
            at: Instant::now(),
        }
    }

    #[test]
    fn the_bar_shows_time_and_speed() {
        let progress = progress(Vec::new());
        assert_eq!(
            message(&progress, Some(19.96), progress.at, false),
            " 20 %  123.5 of 600.0 s  running  20.0 x real time"
        );
    }

    #[test]
    fn the_bar_shows_the_robots_for_which_the_clock_is_held() {
        let name = RobotName::new("Leguin").unwrap();
        let progress = progress(vec![Awaited {
            name,
            since_s: 0.6,
            because: Reason::Silent,
        }]);
        let now = progress.at + Duration::from_millis(2500);
        let text = " 20 %  123.5 of 600.0 s  held for 3 s: waiting for Leguin (is there but has not reported)";
        assert_eq!(message(&progress, None, now, false), text);
    }

    #[test]
    fn the_speed_is_a_recent_mean() {
        let mut speed = Speedometer::default();
        let begin = Instant::now();
        for tenth in 0..100_u32 {
            let factor = if tenth < 50 { 1.0 } else { 20.0 };
            speed.add(&RunProgress {
                at: begin + Duration::from_millis(100) * tenth,
                time_s: f64::from(tenth) * 0.1 * factor,
                ..progress(Vec::new())
            });
        }
        assert!((speed.factor().unwrap() - 20.0).abs() < 1e-6);

        speed.add(&RunProgress {
            time_s: 0.0,
            ..progress(Vec::new())
        });
        assert_eq!(speed.factor(), None);
    }
}
