//! A robot that takes from every site that it senses, and goes to the right as far as its first ray allows:
//! `sdk/python/tests/forager.py` in Rust.

use std::process::ExitCode;

use robot::{Action, BadParameters, Cars, Point, Robot, SiteAction, SiteRefusal};

#[derive(Default)]
struct Forager {
    taken: u32,
    refused: &'static str,
}

impl Robot for Forager {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        for result in cars.site_results() {
            match result.refused {
                None => self.taken += 1,
                Some(reason) => self.refused = SiteRefusal::name(reason),
            }
        }

        let ahead_m = cars.ranges()[0];
        let step_m = if ahead_m > 0.5 { 0.2 } else { 0.0 };
        let here = cars.location();
        let goal = Point::new(here.x + step_m, here.y);
        let mut action = Action::go(cars, goal, 0.4)
            .variable("ahead_m", ahead_m)
            .variable("refused", self.refused)
            .variable("taken", self.taken);
        for site in cars.sites() {
            let take = SiteAction::set(site.name.as_str(), "last", cars.name().as_str())
                .and_add("stock", -1.0)
                .only_if("open", true);
            action = action.on_site(take);
        }
        action
    }

    fn senses_ranges(&self) -> bool {
        true
    }
}

fn main() -> ExitCode {
    robot::main("A", |_| Box::new(Forager::default()))
}
