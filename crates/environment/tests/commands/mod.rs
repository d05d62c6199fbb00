//! Commands as robots put them.

use environment::medium::SentCommand;
use protocol::RobotName;
use protocol::messages::CommandText;

pub(crate) fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

pub(crate) fn command(from: &str, to: &str, seq: u64) -> SentCommand {
    SentCommand {
        to: name(to),
        from: name(from),
        seq,
        text: CommandText::named("refill"),
    }
}
