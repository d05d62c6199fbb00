//! Commands as robots put them.

use protocol::RobotName;
use protocol::messages::CommandText;
use simulator::medium::SentCommand;

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
