//! Random streams.

use protocol::random::unit;
use pyo3::prelude::*;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::scoped_borrow::with_cars;

/// A generator of random numbers, xoshiro256++.
#[pyclass(module = "cars")]
pub(crate) struct Stream(StreamState);

enum StreamState {
    /// The stream of the robot whose tick it is.
    OfRobot,
    Own(robot::Stream),
}

impl Stream {
    /// The stream of the robot whose tick it is.
    pub(crate) fn of_robot() -> Self {
        Self(StreamState::OfRobot)
    }

    fn draw<T>(&mut self, draw: impl FnOnce(&mut robot::Stream) -> T) -> PyResult<T> {
        match &mut self.0 {
            StreamState::Own(stream) => Ok(draw(stream)),
            StreamState::OfRobot => with_cars(|cars| draw(cars.random())),
        }
    }
}

#[pymethods]
impl Stream {
    /// A stream from a seed of 64 bits.
    #[new]
    fn new(seed: u64) -> Self {
        Self(StreamState::Own(robot::Stream::seed_from_u64(seed)))
    }

    /// The next draw: an integer from 0 up to but not including 2^64.
    fn next_u64(&mut self) -> PyResult<u64> {
        self.draw(Rng::next_u64)
    }

    /// The next draw as a number from 0 up to but not including 1: its upper 53 bits over 2^53.
    fn unit(&mut self) -> PyResult<f64> {
        self.draw(unit)
    }
}

/// The stream called `name` of a run with `seed`: the same numbers as in every other language.
#[pyfunction]
pub(crate) fn stream(seed: u64, name: &str) -> Stream {
    Stream(StreamState::Own(protocol::random::stream(seed, name)))
}

/// An angle rounded to 1e-6 rad, so that languages whose arc tangents differ in the last bit publish the same number.
#[pyfunction]
pub(crate) fn published_angle(angle_rad: f64) -> f64 {
    robot::published_angle(angle_rad)
}
