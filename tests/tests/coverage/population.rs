//! A population of runs, and samples of it.

use experiments::engine::{self, EngineOptions, Queue};
use experiments::{Experiment, Launches, Measured, Plan, Request, Results, Robots, Store};
use protocol::random::{self, Stream};
use statistics::CensoredTime;
use system_tests::root;

/// The experiment whose runs they are.
const FILE: &str = "tests/statistics/population.toml";
/// Measures that are times.
pub(crate) const TIMES: [&str; 4] = ["t_exchange2", "t_intercept", "t_risk", "t_first"];
/// Measures that are numbers.
pub(crate) const NUMBERS: [&str; 8] = [
    "served",
    "tray",
    "frustrated",
    "exchanges",
    "hurries",
    "longest",
    "blocked",
    "rare",
];

/// Runs, in the order of arms and seeds.
pub(crate) struct Population(Results);

impl Population {
    pub(crate) fn play() -> Self {
        let file = root().join(FILE);
        let mut experiment = Experiment::find(&file).unwrap();
        experiment.scenario = root().join("configs/hors_doeuvres.toml");
        let plan = Plan::new(&Request {
            name: "population".to_owned(),
            experiment,
            set: Vec::new(),
            robots: Robots::InProcess,
            own: None,
        });
        let plan = plan.unwrap();

        let folder = tempfile::tempdir().unwrap();
        plan.save(folder.path()).unwrap();
        let options = EngineOptions {
            units: 0..plan.units(),
            jobs: std::thread::available_parallelism().map_or(1, usize::from),
            retries_failed: false,
        };
        let mut store = Store::open(folder.path()).unwrap();
        let mut queue = Queue::of(&plan, &store, &options);
        engine::play(
            &plan,
            folder.path(),
            &mut store,
            &mut queue,
            &options,
            &Launches::none(),
            &|| {},
        )
        .unwrap();

        let results = Results::of(plan, &store);
        assert!(results.missing.is_empty() && results.failures.is_empty());
        Self(results)
    }

    /// What was measured in the runs of an arm, by seed.
    fn measured(&self, arm: &str, measure: &str) -> Vec<&Measured> {
        let runs = self.0.outcomes.iter().filter(|run| run.arm == arm);
        runs.map(|run| &run.measures[measure]).collect()
    }

    /// The numbers of an arm.
    pub(crate) fn numbers(&self, arm: &str, measure: &str) -> Vec<f64> {
        let measured = self.measured(arm, measure).into_iter();
        measured.filter_map(Measured::value).collect()
    }

    /// The times of an arm.
    pub(crate) fn times(&self, arm: &str, measure: &str) -> Vec<CensoredTime> {
        let measured = self.measured(arm, measure).into_iter();
        measured.filter_map(time_of).collect()
    }

    /// The differences between an arm and the baseline.
    pub(crate) fn differences(&self, arm: &str, measure: &str) -> Vec<f64> {
        let pairs = self.pairs(arm, measure, Measured::value);
        pairs.iter().map(|(arm, base)| arm - base).collect()
    }

    /// The times of an arm and of the baseline.
    pub(crate) fn pairs_of_times(
        &self,
        arm: &str,
        measure: &str,
    ) -> Vec<(CensoredTime, CensoredTime)> {
        self.pairs(arm, measure, time_of)
    }

    fn pairs<T>(
        &self,
        arm: &str,
        measure: &str,
        number: impl Fn(&Measured) -> Option<T>,
    ) -> Vec<(T, T)> {
        let runs = self.measured(arm, measure).into_iter();
        let pairs = runs.zip(self.measured("base", measure));
        let both = pairs.filter_map(|(run, other)| number(run).zip(number(other)));
        both.collect()
    }
}

fn time_of(measured: &Measured) -> Option<CensoredTime> {
    let (time_s, is_event) = measured.time()?;
    Some(CensoredTime { time_s, is_event })
}

/// A sample with replacement.
pub(crate) fn draw<T: Copy>(population: &[T], n: usize, stream: &mut Stream) -> Vec<T> {
    let mut sample = Vec::with_capacity(n);
    for _ in 0..n {
        let index = random::unit(stream) * population.len() as f64;
        sample.push(population[index as usize]);
    }
    sample
}

/// One result for each, in their order, on all processors.
pub(crate) fn side_by_side<T: Sync, R: Send>(all: &[T], one: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let mut done: Vec<(usize, R)> = std::thread::scope(|scope| {
        let start = |worker: usize| {
            let one = &one;
            scope.spawn(move || {
                let places = (worker..all.len()).step_by(workers);
                places.map(|place| (place, one(&all[place]))).collect()
            })
        };
        let started: Vec<_> = (0..workers).map(start).collect();
        let finished = started.into_iter();
        finished
            .flat_map(
                |worker: std::thread::ScopedJoinHandle<'_, Vec<(usize, R)>>| worker.join().unwrap(),
            )
            .collect()
    });
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, result)| result).collect()
}
