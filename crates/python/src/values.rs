//! Values of the SDK in Rust as values of the package in Python, and back. Their classes are in `cars/_data.py`.

use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyDict, PyMapping, PyString, PyTuple, PyType};
use robot::{
    Action, LayerAction, LayerResult, Point, Pose, PublicState, ReceivedCommand, SensedBody,
    SensedKind, SensedLayer, SensedSite, SiteAction, SiteResult, StateVariables, Variable,
    Velocity,
};

use crate::payload::json_value;

/// Module of the classes.
const DATA: &str = "cars._data";

/// A point.
pub(crate) fn point(py: Python<'_>, point: Point) -> PyResult<Bound<'_, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    CLASS.import(py, DATA, "Point")?.call1((point.x, point.y))
}

/// A point from two numbers.
pub(crate) fn read_point(value: &Bound<'_, PyAny>) -> PyResult<Point> {
    let [x, y] = value.extract()?;
    Ok(Point::new(x, y))
}

/// The pose of a robot that drives like wheels.
pub(crate) fn pose<'py>(py: Python<'py>, pose: Pose) -> PyResult<Bound<'py, PyAny>> {
    static VELOCITY: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    static POSE: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let Velocity {
        linear_mps,
        angular_radps,
    } = pose.velocity;
    let velocity = VELOCITY
        .import(py, DATA, "Velocity")?
        .call1((linear_mps, angular_radps))?;
    let fields = (point(py, pose.location)?, pose.heading_rad, velocity);
    POSE.import(py, DATA, "Pose")?.call1(fields)
}

/// A command that arrived.
pub(crate) fn command<'py>(
    py: Python<'py>,
    command: &ReceivedCommand,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let payload = command.payload.as_ref();
    let payload = payload
        .map(|payload| json_value(py, payload.value()))
        .transpose()?;
    let fields = (command.from.as_str(), &command.text, payload);
    CLASS.import(py, DATA, "Command")?.call1(fields)
}

/// A robot within sensing range.
pub(crate) fn sensed_robot<'py>(
    py: Python<'py>,
    name: &str,
    location: Point,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let location = point(py, location)?;
    CLASS
        .import(py, DATA, "SensedRobot")?
        .call1((name, location))
}

/// A body within sensing range.
pub(crate) fn sensed_body<'py>(py: Python<'py>, body: &SensedBody) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let kind = match body.kind {
        SensedKind::Obstacle => "obstacle",
        SensedKind::Guest => "guest",
        SensedKind::Robot => "robot",
    };
    let location = point(py, body.location)?;
    CLASS
        .import(py, DATA, "SensedBody")?
        .call1((kind, location))
}

/// A site within its range.
pub(crate) fn sensed_site<'py>(py: Python<'py>, site: &SensedSite) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let fields = (
        &site.name,
        &site.kind,
        point(py, site.location)?,
        variables(py, &site.state)?,
    );
    CLASS.import(py, DATA, "SensedSite")?.call1(fields)
}

/// What became of an action on a site.
pub(crate) fn site_result<'py>(
    py: Python<'py>,
    result: &SiteResult,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let refused = result.refused.map(robot::SiteRefusal::name);
    CLASS
        .import(py, DATA, "SiteResult")?
        .call1((&result.site, refused))
}

/// What it senses of a layer.
pub(crate) fn sensed_layer<'py>(
    py: Python<'py>,
    layer: &SensedLayer,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let rows = tuple(py, &layer.rows, |row| {
        let values = PyTuple::new(py, &row.values)?;
        let fields = (row.row, row.column, values);
        Ok(fields.into_pyobject(py)?.into_any())
    })?;
    let fields = (&layer.name, layer.cell_m, rows);
    CLASS.import(py, DATA, "SensedLayer")?.call1(fields)
}

/// What became of an action on a layer.
pub(crate) fn layer_result<'py>(
    py: Python<'py>,
    result: &LayerResult,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let refused = result.refused.map(robot::LayerRefusal::name);
    CLASS
        .import(py, DATA, "LayerResult")?
        .call1((&result.layer, result.change, refused))
}

/// What a robot published of itself.
pub(crate) fn state<'py>(py: Python<'py>, state: &PublicState) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let fields = (
        state.epoch,
        state.tick,
        point(py, state.location)?,
        state.speed_mps,
        state.direction_rad,
        variables(py, &state.state_variables)?,
        &state.emotion_state,
        &state.behavior_state,
    );
    CLASS.import(py, DATA, "PublicState")?.call1(fields)
}

/// State variables as a dictionary.
pub(crate) fn variables<'py>(
    py: Python<'py>,
    variables: &StateVariables,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for (name, value) in variables {
        match value {
            Variable::Flag(flag) => all.set_item(name, flag)?,
            Variable::Number(number) => all.set_item(name, number)?,
            Variable::Text(text) => all.set_item(name, text.as_str())?,
        }
    }
    Ok(all)
}

/// State variables from a dictionary.
fn read_variables(value: &Bound<'_, PyAny>) -> PyResult<StateVariables> {
    let mut variables = StateVariables::new();
    for item in value.call_method0("items")?.try_iter()? {
        let (name, value): (String, Bound<'_, PyAny>) = item?.extract()?;
        let value = read_variable(&name, &value)?;
        variables.insert(name, value);
    }
    Ok(variables)
}

/// A flag, a number or a text, also of NumPy.
fn read_variable(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Variable> {
    if value.is_instance_of::<PyBool>() {
        return Ok(Variable::Flag(value.is_truthy()?));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Variable::from(text.to_string()));
    }

    match value.extract() {
        Ok(number) => Ok(Variable::Number(number)),
        // Not finite, which the runner leaves out and logs.
        Err(error) if error.is_instance_of::<PyOverflowError>(value.py()) => {
            Ok(Variable::Number(f64::INFINITY))
        }
        // A flag of NumPy is no number.
        Err(_) => match value.extract() {
            Ok(flag) => Ok(Variable::Flag(flag)),
            Err(_) => Err(PyTypeError::new_err(format!(
                "the state variable {name:?} must be a number, a text, True or False, not a {}",
                value.get_type().name()?
            ))),
        },
    }
}

/// An action of Python.
pub(crate) fn read_action(value: &Bound<'_, PyAny>) -> PyResult<Action> {
    let proposal = value.getattr("proposal").map_err(|_| {
        let class = value.get_type();
        PyTypeError::new_err(format!("a tick returns a cars.Action, not a {class}"))
    })?;
    let place =
        read_point(&proposal).map_err(|_| wrong_field("proposal", "a cars.Point", &proposal))?;
    let variables = value.getattr("state_variables")?;
    let is_mapping = variables.cast::<PyMapping>().is_ok();
    if !is_mapping {
        return Err(wrong_field("state_variables", "a mapping", &variables));
    }
    Ok(Action {
        proposal: place,
        speed_mps: field(value, "speed_mps", "a number")?,
        direction_rad: field(value, "direction_rad", "a number")?,
        emotion_state: field(value, "emotion_state", "a text")?,
        behavior_state: field(value, "behavior_state", "a text")?,
        state_variables: read_variables(&variables)?,
        site_actions: read_site_actions(&value.getattr("site_actions")?)?,
        layer_actions: read_layer_actions(&value.getattr("layer_actions")?)?,
        velocity: read_velocity(&value.getattr("velocity")?)?,
    })
}

/// The velocity that a robot wants, if any.
fn read_velocity(value: &Bound<'_, PyAny>) -> PyResult<Option<Velocity>> {
    if value.is_none() {
        return Ok(None);
    }
    let [linear_mps, angular_radps] = value
        .extract()
        .map_err(|_| wrong_field("velocity", "a cars.Velocity or None", value))?;
    Ok(Some(Velocity {
        linear_mps,
        angular_radps,
    }))
}

/// Actions on sites.
fn read_site_actions(value: &Bound<'_, PyAny>) -> PyResult<Vec<SiteAction>> {
    let mut actions = Vec::new();
    for action in value.try_iter()? {
        let action = action?;
        let read = |name: &str| -> PyResult<StateVariables> {
            let variables = action.getattr(name).map_err(|_| {
                let expected = "a sequence of cars.SiteAction";
                wrong_field("site_actions", expected, value)
            })?;
            read_variables(&variables)
        };
        let mut add = std::collections::BTreeMap::new();
        for (key, number) in &read("add")? {
            let number = number.as_f64().ok_or_else(|| {
                PyTypeError::new_err(format!(
                    "a SiteAction adds numbers, not {number} to {key:?}"
                ))
            })?;
            add.insert(key.to_owned(), number);
        }
        actions.push(SiteAction {
            set: read("set")?,
            add,
            only_if: read("only_if")?,
            site: action.getattr("site")?.extract()?,
        });
    }
    Ok(actions)
}

/// Actions on layers.
fn read_layer_actions(value: &Bound<'_, PyAny>) -> PyResult<Vec<LayerAction>> {
    let mut actions = Vec::new();
    for action in value.try_iter()? {
        let action = action?;
        let field = |name: &str| {
            action.getattr(name).map_err(|_| {
                let expected = "a sequence of cars.LayerAction";
                wrong_field("layer_actions", expected, value)
            })
        };
        let at = field("at")?;
        actions.push(LayerAction {
            layer: field("layer")?.extract()?,
            at: read_point(&at)
                .map_err(|_| wrong_field("layer_actions", "LayerActions at a cars.Point", &at))?,
            radius_m: field("radius_m")?.extract()?,
            set: field("set")?.extract()?,
            add: field("add")?.extract()?,
        });
    }
    Ok(actions)
}

/// A field of an action.
fn field<'py, T: FromPyObjectOwned<'py>>(
    action: &Bound<'py, PyAny>,
    name: &str,
    accepted: &str,
) -> PyResult<T> {
    let value = action.getattr(name)?;
    value
        .extract()
        .map_err(|_| wrong_field(name, accepted, &value))
}

/// The exception of a field of an action that has something else than it may.
fn wrong_field(name: &str, accepted: &str, value: &Bound<'_, PyAny>) -> PyErr {
    PyTypeError::new_err(format!(
        "the {name} of a cars.Action must be {accepted}, not {}",
        value.get_type()
    ))
}

/// A tuple of values.
pub(crate) fn tuple<'py, T>(
    py: Python<'py>,
    items: &[T],
    convert: impl Fn(&T) -> PyResult<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyTuple>> {
    let mut converted = Vec::with_capacity(items.len());
    for item in items {
        converted.push(convert(item)?);
    }
    PyTuple::new(py, converted)
}
