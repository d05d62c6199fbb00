//! What a robot of Python can do during a tick.

use std::sync::Arc;

use crate::error::{Interrupted, TooEarly, UnknownRobot, Unreachable};
use crate::payload::read_payload;
use crate::scoped_borrow::with_cars;
use crate::stream::Stream;
use crate::values::{
    command, layer_result, point, pose, read_point, sensed_body, sensed_layer, sensed_robot,
    sensed_site, site_result, state, tuple, variables,
};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use robot::{CallError, PublicState};

/// The simulation, as one robot sees it during one tick.
#[pyclass(module = "cars", frozen)]
pub(crate) struct Cars {
    welcome: Py<PyAny>,
    senses_bodies: bool,
    senses_ranges: bool,
}

impl Cars {
    /// The simulation as a robot sees it that has been welcomed.
    pub(crate) fn new(welcome: Py<PyAny>, senses_bodies: bool, senses_ranges: bool) -> Self {
        Self {
            welcome,
            senses_bodies,
            senses_ranges,
        }
    }
}

#[pymethods]
impl Cars {
    /// What it was told when it joined: field, roster, ranges, where it started.
    #[getter]
    fn welcome(&self, py: Python<'_>) -> Py<PyAny> {
        self.welcome.clone_ref(py)
    }

    /// Its own name (``getName``).
    #[getter]
    fn name(&self) -> PyResult<String> {
        with_cars(|cars| cars.name().to_string())
    }

    /// The current tick; 0 is the initial state.
    #[getter]
    fn tick(&self) -> PyResult<u64> {
        with_cars(|cars| cars.tick())
    }

    /// Length of a tick, simulated seconds.
    #[getter]
    fn tick_s(&self) -> PyResult<f64> {
        with_cars(|cars| cars.tick_s())
    }

    /// Simulated time, seconds.
    #[getter]
    fn time_s(&self) -> PyResult<f64> {
        with_cars(|cars| cars.time_s())
    }

    /// Where it stands now, meters: where it proposed to be, or where it was if that place was taken.
    #[getter]
    fn location<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        point(py, with_cars(|cars| cars.location())?)
    }

    /// Where it stands and looks, and the velocity that it has reached, if the scenario has it drive like wheels; None otherwise.
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let of_robot = with_cars(|cars| cars.pose())?;
        of_robot.map(|of_robot| pose(py, of_robot)).transpose()
    }

    /// The commands that arrived in this tick, in the order of senders and of their sending.
    #[getter]
    fn commands<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let commands = with_cars(|cars| cars.commands().to_vec())?;
        tuple(py, &commands, |one| command(py, one))
    }

    /// Its own random stream, derived from the seed and its name: the only chance it may use.
    #[getter]
    fn random(&self) -> Stream {
        Stream::of_robot()
    }

    /// Whether the place it proposed was taken, so that it still stands where it was.
    #[getter]
    fn was_blocked(&self) -> PyResult<bool> {
        with_cars(|cars| cars.was_blocked())
    }

    /// Robots within its sensing range now. Sensing is physical: a cut in the network hides no body.
    #[getter]
    fn sensed_robots<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let sensed = with_cars(|cars| cars.sensed_robots().to_vec())?;
        tuple(py, &sensed, |one| {
            sensed_robot(py, one.name.as_str(), one.location)
        })
    }

    /// All bodies within its sensing range now: obstacles, guests, robots. Its class must have ``senses_bodies = True``.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        if !self.senses_bodies {
            let name = self.name()?;
            return Err(PyRuntimeError::new_err(format!(
                "{name} uses cars.bodies and its senses_bodies is False"
            )));
        }
        let bodies = with_cars(|cars| cars.bodies().to_vec())?;
        tuple(py, &bodies, |body| sensed_body(py, body))
    }

    /// The distance along each ray to the next body or the edge of the field now, meters. Its class must have
    /// ``senses_ranges = True``.
    #[getter]
    fn ranges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        if !self.senses_ranges {
            let name = self.name()?;
            return Err(PyRuntimeError::new_err(format!(
                "{name} uses cars.ranges and its senses_ranges is False"
            )));
        }
        PyTuple::new(py, with_cars(|cars| cars.ranges().to_vec())?)
    }

    /// The sites that it senses now, by name.
    #[getter]
    fn sites<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let sites = with_cars(|cars| cars.sites().to_vec())?;
        tuple(py, &sites, |site| sensed_site(py, site))
    }

    /// What became of its actions on sites in the tick before, in their order.
    #[getter]
    fn site_results<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let results = with_cars(|cars| cars.site_results().to_vec())?;
        tuple(py, &results, |result| site_result(py, result))
    }

    /// What it senses now of the layers that have a range, by name.
    #[getter]
    fn layers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let layers = with_cars(|cars| cars.layers().to_vec())?;
        tuple(py, &layers, |layer| sensed_layer(py, layer))
    }

    /// What it senses now of a layer; None if there is no such layer, or none of its cells is in range.
    fn layer<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let layer = with_cars(|cars| cars.layer(name).cloned())?;
        layer.map(|layer| sensed_layer(py, &layer)).transpose()
    }

    /// What became of its actions on layers in the tick before, in their order.
    #[getter]
    fn layer_results<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let results = with_cars(|cars| cars.layer_results().to_vec())?;
        tuple(py, &results, |result| layer_result(py, result))
    }

    /// Its parameters, as an instance of the dataclass ``kind``: numbers in SI units.
    fn parameters<'py>(
        slf: &Bound<'py, Self>,
        kind: Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let name = slf.get().name()?;
        let given = slf.get().welcome.bind(py).getattr("parameters")?;
        let build = py.import("cars._parameters")?.getattr("parameters")?;
        build.call1((name, kind, given))
    }

    /// Writes a line to the log of the run. Long lines are cut, and lines beyond the limit of a tick are dropped.
    fn log(&self, line: String) -> PyResult<()> {
        with_cars(|cars| cars.log(line))
    }

    /// Sends a command to another robot (``setRobotCommand``). It arrives at a later tick, if the network lets it.
    fn set_robot_command(&self, to: &str, command: String) -> PyResult<()> {
        with_cars(|cars| cars.set_robot_command(to, command))?.map_err(exception)
    }

    /// Sends a command with a payload to another robot: any JSON value, of at most 64 KiB. It arrives at a later tick, if the network
    /// lets it.
    #[pyo3(signature = (to, name, payload=None))]
    fn send(&self, to: &str, name: String, payload: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let payload = read_payload(payload)?;
        with_cars(|cars| cars.send(to, name, payload))?.map_err(exception)
    }

    /// Sends a command to every other robot of the roster. The network decides for each of them.
    #[pyo3(signature = (name, payload=None))]
    fn broadcast(&self, name: String, payload: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let payload = read_payload(payload)?;
        with_cars(|cars| cars.broadcast(name, payload))
    }

    /// All six answers at once. The first query to a robot in a tick may cost a round trip, further ones are free.
    fn get_robot_state<'py>(&self, py: Python<'py>, of: &str) -> PyResult<Bound<'py, PyAny>> {
        let found = ask(py, of)?;
        state(py, &found)
    }

    /// Where another robot stood at the last tick, meters (``getRobotLocation``).
    fn get_robot_location<'py>(&self, py: Python<'py>, of: &str) -> PyResult<Bound<'py, PyAny>> {
        point(py, ask(py, of)?.location)
    }

    /// How fast another robot was at the last tick, m/s (``getRobotSpeed``).
    fn get_robot_speed(&self, py: Python<'_>, of: &str) -> PyResult<f64> {
        Ok(ask(py, of)?.speed_mps)
    }

    /// Where another robot was heading at the last tick, radians (``getRobotDirection``).
    fn get_robot_direction(&self, py: Python<'_>, of: &str) -> PyResult<f64> {
        Ok(ask(py, of)?.direction_rad)
    }

    /// What another robot published of itself at the last tick (``getRobotStateVariables``).
    fn get_robot_state_variables<'py>(
        &self,
        py: Python<'py>,
        of: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        Ok(variables(py, &ask(py, of)?.state_variables)?.into_any())
    }

    /// Another robot's emotion at the last tick (``getRobotEmotionState``).
    fn get_robot_emotion_state(&self, py: Python<'_>, of: &str) -> PyResult<String> {
        Ok(ask(py, of)?.emotion_state.clone())
    }

    /// Another robot's behavior at the last tick (``getRobotBehaviorState``).
    fn get_robot_behavior_state(&self, py: Python<'_>, of: &str) -> PyResult<String> {
        Ok(ask(py, of)?.behavior_state.clone())
    }

    /// Proposal, speed and direction of a step straight toward a goal.
    fn _go<'py>(
        &self,
        py: Python<'py>,
        goal: &Bound<'py, PyAny>,
        speed_mps: f64,
    ) -> PyResult<(Bound<'py, PyAny>, f64, f64)> {
        let goal = read_point(goal)?;
        let action = with_cars(|cars| robot::Action::go(cars, goal, speed_mps))?;
        let proposal = point(py, action.proposal)?;
        Ok((proposal, action.speed_mps, action.direction_rad))
    }

    /// Speed and direction of a robot that drives like wheels.
    fn _drive(&self, linear_mps: f64) -> PyResult<(f64, f64)> {
        let action = with_cars(|cars| robot::Action::drive(cars, linear_mps, 0.0))?;
        Ok((action.speed_mps, action.direction_rad))
    }
}

/// Asks another robot. Others may compute in Python meanwhile.
fn ask(py: Python<'_>, of: &str) -> PyResult<Arc<PublicState>> {
    py.detach(|| with_cars(|cars| cars.get_robot_state(of)))?
        .map_err(exception)
}

fn exception(error: CallError) -> PyErr {
    let text = error.to_string();
    match error {
        CallError::UnknownRobot(_) => UnknownRobot::new_err(text),
        CallError::Unreachable(_) => Unreachable::new_err(text),
        CallError::TooEarly => TooEarly::new_err(text),
        CallError::Interrupted => Interrupted::new_err(text),
    }
}
