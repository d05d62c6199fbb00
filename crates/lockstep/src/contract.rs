//! Messages of the contract as what the state machines take and give.

use std::str::FromStr;

use protocol::messages::{Command, CommandText, Refusal, Report, Target, TickUpdate, Welcome};

use crate::actions::TickAnswer;
use crate::exchange::{IncarnationNotice, Sent};
use crate::member::Admission;
use crate::outputs::{Refused, Stamp};
use crate::states::StateQuery;

impl From<&Report> for Stamp {
    fn from(report: &Report) -> Self {
        Self {
            epoch: report.epoch,
            tick: report.tick,
            generation: report.generation,
        }
    }
}

impl From<&Command> for Stamp {
    fn from(command: &Command) -> Self {
        Self {
            epoch: command.epoch,
            tick: command.tick,
            generation: command.generation,
        }
    }
}

impl<S, C, R> From<&TickAnswer<S, C, R>> for Stamp {
    fn from(answer: &TickAnswer<S, C, R>) -> Self {
        Self {
            epoch: answer.epoch,
            tick: answer.tick,
            generation: answer.generation,
        }
    }
}

impl From<&Welcome> for Admission {
    fn from(welcome: &Welcome) -> Self {
        Self {
            epoch: welcome.epoch,
            generation: welcome.generation,
            news_flag: welcome.news_flag,
        }
    }
}

impl From<&TickUpdate> for IncarnationNotice {
    fn from(news: &TickUpdate) -> Self {
        Self {
            joined: news.joined,
            rejoin: news.rejoin,
        }
    }
}

impl StateQuery {
    /// Reads the parameters `tick` and `epoch` of a query.
    ///
    /// # Errors
    /// The text of the error reply.
    pub fn read<'a>(parameter: impl Fn(&str) -> Option<&'a str>) -> Result<Self, String> {
        Ok(Self {
            tick: number(parameter("tick"), "tick")?,
            epoch: number(parameter("epoch"), "epoch")?,
        })
    }
}

fn number<T: FromStr>(text: Option<&str>, name: &str) -> Result<Option<T>, String> {
    let Some(text) = text else {
        return Ok(None);
    };

    match text.parse() {
        Ok(number) => Ok(Some(number)),
        Err(_) => Err(format!("parameter {name}: not a whole number")),
    }
}

impl From<Refused> for Refusal {
    fn from(refused: Refused) -> Self {
        match refused {
            Refused::UnknownName => Self::UnknownName,
            Refused::NameTaken => Self::NameTaken,
            Refused::Ended => Self::Ended,
        }
    }
}

impl Sent<CommandText> {
    /// The content of a command that was put for `to`.
    #[must_use]
    pub fn new(to: Target, command: Command) -> Self {
        Self {
            to,
            command: command.into(),
        }
    }
}

impl<S, R> TickAnswer<S, CommandText, R> {
    /// The commands as they are put, in their order, each with its target. The first has the number `first`: 1, if no rule is
    /// to be broken.
    pub fn commands_from(&self, first: u32) -> impl Iterator<Item = (&Target, Command)> {
        (first..).zip(&self.commands).map(|(number, sent)| {
            let command = Command {
                epoch: self.epoch,
                tick: self.tick,
                generation: self.generation,
                number,
                to: Some(sent.to.clone()),
                performative: sent.command.performative,
                command: sent.command.command.clone(),
                payload: sent.command.payload.clone(),
            };
            (&sent.to, command)
        })
    }
}
