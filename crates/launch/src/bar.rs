//! The progress bar: how far the run is, and, while the clock is held, for whom and for how long.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use protocol::messages::{Awaited, Phase, Status, WorldFrame};

/// Redraws per second at most.
const REDRAWS_HZ: u8 = 10;
/// The speed that is shown is the mean over this time.
const SPEED_WINDOW: Duration = Duration::from_secs(2);

/// How far a run is.
#[derive(Debug, Clone)]
pub(super) struct Progress {
    time_s: f64,
    duration_s: f64,
    phase: Phase,
    awaiting: Vec<Awaited>,
    at: Instant,
}

impl From<WorldFrame> for Progress {
    fn from(frame: WorldFrame) -> Self {
        let WorldFrame {
            time_s,
            duration_s,
            phase,
            awaiting,
            ..
        } = frame;

        Self {
            time_s,
            duration_s,
            phase,
            awaiting,
            at: Instant::now(),
        }
    }
}

impl From<Status> for Progress {
    fn from(status: Status) -> Self {
        let Status {
            time_s,
            duration_s,
            phase,
            awaiting,
            ..
        } = status;

        Self {
            time_s,
            duration_s,
            phase,
            awaiting,
            at: Instant::now(),
        }
    }
}

/// The bar on the terminal.
pub(super) struct Bar {
    bar: ProgressBar,
    progress: Option<Progress>,
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

    /// Whether the clock waits for somebody.
    pub(super) fn is_held(&self) -> bool {
        self.progress
            .as_ref()
            .is_some_and(|progress| !progress.awaiting.is_empty())
    }

    /// Shows where the run is now; without news, for how long it has been held.
    pub(super) fn update(&mut self, news: Option<Progress>) {
        let was_held = self.is_held();

        if let Some(news) = news {
            self.speed.add(&news);
            self.progress = Some(news);
        }

        let Some(progress) = &self.progress else {
            return;
        };

        let millis = |seconds: f64| (seconds * 1000.0) as u64;
        self.bar.update(|state| {
            state.set_len(millis(progress.duration_s).max(1));
            state.set_pos(millis(progress.time_s));
        });
        self.bar.set_message(message(
            progress,
            self.speed.factor(),
            Instant::now(),
            self.has_colors,
        ));

        // Nothing may follow for a long time: the last thing to say must not fall to the limit on redraws.
        if was_held || self.is_held() || progress.phase != Phase::Running {
            self.bar.force_draw();
        }
    }

    /// Writes something else, with the bar out of its way.
    pub(super) fn aside(&self, write: impl FnOnce()) {
        self.bar.suspend(write);
    }

    pub(super) fn clear(self) {
        self.bar.finish_and_clear();
    }
}

fn message(progress: &Progress, factor: Option<f64>, now: Instant, has_colors: bool) -> String {
    let Progress {
        time_s,
        duration_s,
        phase,
        ..
    } = progress;
    let percent = if *duration_s > 0.0 {
        (100.0 * time_s / duration_s).floor()
    } else {
        100.0
    };

    let place = format!("{percent:>3} %  {time_s:.1} of {duration_s:.1} s");

    if let Some(held) = held(&progress.awaiting, now.duration_since(progress.at)) {
        return if has_colors {
            format!("{place}  \u{1b}[33m{held}\u{1b}[0m")
        } else {
            format!("{place}  {held}")
        };
    }

    match factor.filter(|_| *phase == Phase::Running) {
        Some(factor) => format!("{place}  {phase}  {factor:.1} x real time"),
        None => format!("{place}  {phase}"),
    }
}

/// Robots that are named one by one; of more it is said how many.
const MAX_NAMED: usize = 4;

/// For whom the clock waits, why, and since when; `seen_ago` is the age of what is known.
fn held(awaiting: &[Awaited], seen_ago: Duration) -> Option<String> {
    let longest_s = awaiting
        .iter()
        .map(|awaited| awaited.since_s)
        .reduce(f64::max)?;
    let for_s = (longest_s + seen_ago.as_secs_f64()).floor();
    let name = |awaited: &Awaited| format!("{} ({})", awaited.name, awaited.because);
    let mut names: Vec<String> = awaiting.iter().take(MAX_NAMED).map(name).collect();
    if awaiting.len() > MAX_NAMED {
        names.push(format!("{} more", awaiting.len() - MAX_NAMED));
    }

    Some(format!(
        "held for {for_s} s: waiting for {}",
        names.join(", ")
    ))
}

/// Simulated seconds per second, as achieved lately.
#[derive(Debug, Default)]
struct Speedometer {
    samples: VecDeque<(Instant, f64)>,
}

impl Speedometer {
    fn add(&mut self, news: &Progress) {
        let Progress { at, time_s, .. } = *news;
        let is_new_epoch = self
            .samples
            .back()
            .is_some_and(|(_, before_s)| time_s < *before_s);

        // What the clock does while it is held says nothing of how fast it goes.
        if is_new_epoch || news.phase != Phase::Running || !news.awaiting.is_empty() {
            self.samples.clear();
        }

        while self
            .samples
            .front()
            .is_some_and(|(then, _)| at.duration_since(*then) > SPEED_WINDOW)
        {
            self.samples.pop_front();
        }

        self.samples.push_back((at, time_s));
    }

    fn factor(&self) -> Option<f64> {
        let ((from, from_s), (to, to_s)) = (self.samples.front()?, self.samples.back()?);
        let elapsed_s = to.duration_since(*from).as_secs_f64();
        (elapsed_s > 0.1).then(|| (to_s - from_s) / elapsed_s)
    }
}

#[cfg(test)]
mod tests {
    use protocol::RobotName;
    use protocol::messages::Reason;

    use super::*;

    fn progress(awaiting: Vec<Awaited>) -> Progress {
        Progress {
            time_s: 123.5,
            duration_s: 600.0,
            phase: Phase::Running,
            awaiting,
            at: Instant::now(),
        }
    }

    #[test]
    fn the_bar_says_how_far_and_how_fast() {
        let progress = progress(Vec::new());
        assert_eq!(
            message(&progress, Some(19.96), progress.at, false),
            " 20 %  123.5 of 600.0 s  running  20.0 x real time"
        );
    }

    #[test]
    fn the_bar_says_for_whom_the_clock_is_held_why_and_for_how_long() {
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
    fn the_speed_is_that_of_late() {
        let (mut speed, begin) = (Speedometer::default(), Instant::now());

        for tenth in 0..100_u32 {
            let factor = if tenth < 50 { 1.0 } else { 20.0 };
            let (at, time_s) = (
                begin + Duration::from_millis(100) * tenth,
                f64::from(tenth) * 0.1 * factor,
            );
            speed.add(&Progress {
                at,
                time_s,
                ..progress(Vec::new())
            });
        }

        assert!((speed.factor().unwrap() - 20.0).abs() < 1e-6);

        speed.add(&Progress {
            time_s: 0.0,
            ..progress(Vec::new())
        });
        assert_eq!(speed.factor(), None);
    }
}
