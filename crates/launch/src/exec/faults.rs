//! What a program does against the rules of the page although the run goes on: reported to a caller that wants to know, the
//! conformance kit above all.

/// What a program does against the rules of the page. The run is right all the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ProgramFault {
    /// A line has fields that have no meaning.
    UnknownFields(String),
    /// It wrote more to the log in a tick than its limits allow, or too long a line.
    LogLimits(String),
    /// It did not exit in time after the line `end`, or not with exit status 0.
    End(String),
}

/// Receives the first fault of each kind, at once, on the thread of the robot.
pub type FaultListener = Box<dyn FnMut(&ProgramFault) + Send>;

/// Reports the first fault of each kind. The text of a fault is about one line or one tick, so what is reported is bounded.
#[derive(Default)]
pub(super) struct Faults {
    listener: Option<FaultListener>,
    has_unknown_fields: bool,
    has_exceeded_log: bool,
}

impl Faults {
    pub(super) fn new(listener: Option<FaultListener>) -> Self {
        Self {
            listener,
            ..Self::default()
        }
    }

    /// A line of the program has unknown fields.
    pub(super) fn unknown_fields(&mut self, text: impl FnOnce() -> String) {
        if !std::mem::replace(&mut self.has_unknown_fields, true) {
            self.report(|| ProgramFault::UnknownFields(text()));
        }
    }

    /// The program has exceeded the limits of the log.
    pub(super) fn log_limits(&mut self, text: impl FnOnce() -> String) {
        if !std::mem::replace(&mut self.has_exceeded_log, true) {
            self.report(|| ProgramFault::LogLimits(text()));
        }
    }

    /// The program has not ended as it should. It ends once.
    pub(super) fn end(&mut self, text: &str) {
        self.report(|| ProgramFault::End(text.to_owned()));
    }

    fn report(&mut self, fault: impl FnOnce() -> ProgramFault) {
        if let Some(listener) = &mut self.listener {
            listener(&fault());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    #[test]
    fn the_first_fault_of_each_kind_is_reported() {
        let reported = Arc::new(Mutex::new(Vec::new()));
        let kept = reported.clone();
        let mut faults = Faults::new(Some(Box::new(move |fault| {
            kept.lock().unwrap().push(fault.clone());
        })));
        for text in ["a", "b"] {
            faults.unknown_fields(|| text.to_owned());
            faults.log_limits(|| text.to_owned());
        }
        faults.end("c");

        let expected = [
            ProgramFault::UnknownFields("a".to_owned()),
            ProgramFault::LogLimits("a".to_owned()),
            ProgramFault::End("c".to_owned()),
        ];
        assert_eq!(*reported.lock().unwrap(), expected);
    }
}
