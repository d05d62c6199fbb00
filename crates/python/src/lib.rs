//! The Python module `cars._cars`: what the package `cars` in `sdk/python` calls. It translates between Python and the
//! libraries: robots of Python for the crate `robot`, and for Python what the crates `lab`, `experiments` and `reports` do with
//! runs. Rules are theirs.

mod cars;
mod error;
mod experiment;
mod fork;
mod host;
mod hunt;
mod interrupt;
mod learning;
mod make;
mod payload;
mod pictures;
mod processes;
mod run;
mod runner;
mod scoped_borrow;
mod stream;
mod values;
mod why;

use pyo3::prelude::*;

/// What the package `cars` is made of.
#[pymodule]
fn _cars(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<cars::Cars>()?;
    module.add_class::<stream::Stream>()?;
    module.add_class::<learning::Environments>()?;

    module.add_function(wrap_pyfunction!(stream::stream, module)?)?;
    module.add_function(wrap_pyfunction!(stream::published_angle, module)?)?;
    module.add_function(wrap_pyfunction!(host::main, module)?)?;
    module.add_function(wrap_pyfunction!(host::take_part, module)?)?;
    module.add_function(wrap_pyfunction!(run::run, module)?)?;
    module.add_function(wrap_pyfunction!(fork::fork, module)?)?;
    module.add_function(wrap_pyfunction!(run::find, module)?)?;
    module.add_function(wrap_pyfunction!(run::export, module)?)?;
    module.add_function(wrap_pyfunction!(experiment::experiment, module)?)?;
    module.add_function(wrap_pyfunction!(experiment::verdicts, module)?)?;
    module.add_function(wrap_pyfunction!(hunt::hunt, module)?)?;
    module.add_function(wrap_pyfunction!(why::why, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::report, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::figures, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::diagram, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::answers, module)?)?;

    Ok(())
}
