//! Remarks about what a document cannot say. They go to the error output, since the document itself may be on its way to
//! another program.

/// Writes a remark.
pub(super) fn note(text: &str) {
    eprintln!("note: {text}");
}
