//! The library that Python loads. It is built with the tests, so that those of the package need not wait for it.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};

#[test]
fn python_finds_the_function_that_makes_the_module() {
    let library = std::env::current_exe()
        .unwrap()
        .with_file_name(format!("{DLL_PREFIX}_cars{DLL_SUFFIX}"));
    let wanted = b"PyInit__cars";

    let bytes = std::fs::read(library).unwrap();

    assert!(bytes.windows(wanted.len()).any(|part| part == wanted));
}
