//! Payloads of commands as values of Python, and back: any value that JSON has.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use robot::Payload;
use serde_json::{Map, Number, Value};

/// Most lists and dictionaries within one another that are read: more than a payload may have, which is refused in the words of the
/// SDK.
const MAX_DEPTH: usize = protocol::messages::MAX_PAYLOAD_DEPTH + 1;

/// The payload that a value of Python is; none for `None`.
pub(crate) fn read_payload(value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Payload>> {
    let Some(value) = value else {
        return Ok(None);
    };
    let payload = Payload::new(read(value, MAX_DEPTH)?);
    if let Some(payload) = &payload {
        payload
            .check("payload")
            .map_err(|error| PyValueError::new_err(format!("the payload has {}", error.reason)))?;
    }

    Ok(payload)
}

fn read(value: &Bound<'_, PyAny>, levels: usize) -> PyResult<Value> {
    if levels == 0 {
        return Err(PyValueError::new_err(format!(
            "the payload has more than {} lists and objects within one another",
            MAX_DEPTH - 1
        )));
    }
    if value.is_none() {
        return Ok(Value::Null);
    }
    // Before integers: in Python a bool is one.
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::Bool(value.is_truthy()?));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::String(text.extract()?));
    }
    if let Ok(fields) = value.cast::<PyDict>() {
        return read_fields(fields, levels);
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let mut items = Vec::new();
        for item in value.try_iter()? {
            items.push(read(&item?, levels - 1)?);
        }
        return Ok(Value::Array(items));
    }

    read_number(value).map(Value::Number)
}

fn read_fields(fields: &Bound<'_, PyDict>, levels: usize) -> PyResult<Value> {
    let mut read_fields = Map::new();
    for (name, value) in fields {
        let Ok(text) = name.cast::<PyString>() else {
            let kind = name.get_type().name()?;
            return Err(PyTypeError::new_err(format!(
                "the keys of a dict in a payload must be texts, not {kind}"
            )));
        };
        read_fields.insert(text.extract()?, read(&value, levels - 1)?);
    }

    Ok(Value::Object(read_fields))
}

/// An integer of 64 bits or a floating point number, also of NumPy.
fn read_number(value: &Bound<'_, PyAny>) -> PyResult<Number> {
    if !value.is_instance_of::<PyFloat>() {
        if let Ok(integer) = value.extract::<i64>() {
            return Ok(integer.into());
        }
        if let Ok(integer) = value.extract::<u64>() {
            return Ok(integer.into());
        }
        if value.is_instance_of::<PyInt>() {
            return Err(PyValueError::new_err(
                "an integer in a payload must have at most 64 bits: send a larger one as a text",
            ));
        }
    }

    let kind = value.get_type().name()?;
    let number: f64 = value.extract().map_err(|_| {
        PyTypeError::new_err(format!(
            "a payload is what JSON can write: dict, list, tuple, text, number, True, False and None, not a {kind}"
        ))
    })?;
    Number::from_f64(number)
        .ok_or_else(|| PyValueError::new_err(format!("JSON has no number {number}")))
}

/// A value of Python from one of JSON.
pub(crate) fn json_value<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Null => py.None().into_bound(py),
        Value::Bool(flag) => PyBool::new(py, *flag).to_owned().into_any(),
        Value::Number(number) => json_number(py, number)?,
        Value::String(text) => PyString::new(py, text).into_any(),
        Value::Array(items) => {
            let list = PyList::empty(py);
            for item in items {
                list.append(json_value(py, item)?)?;
            }
            list.into_any()
        }
        Value::Object(fields) => {
            let dict = PyDict::new(py);
            for (name, value) in fields {
                dict.set_item(name, json_value(py, value)?)?;
            }
            dict.into_any()
        }
    })
}

fn json_number<'py>(py: Python<'py>, number: &Number) -> PyResult<Bound<'py, PyAny>> {
    if let Some(integer) = number.as_i64() {
        return Ok(integer.into_pyobject(py)?.into_any());
    }
    if let Some(integer) = number.as_u64() {
        return Ok(integer.into_pyobject(py)?.into_any());
    }
    let float = number.as_f64().unwrap_or(f64::NAN);
    Ok(PyFloat::new(py, float).into_any())
}
