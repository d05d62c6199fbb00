//! The rules of the lock-step by name, so that tests can break one of them in the code that runs and show that it is
//! needed. Outside of this crate's tests every rule holds, at no cost.

/// A rule that tests can break.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Rule {
    /// A tick is complete when every awaited robot has reported.
    WaitsForAll,
    /// A report or command of another epoch does not count.
    ChecksEpoch,
    /// A report or command of another tick does not count.
    ChecksTick,
    /// A report or command of another incarnation does not count.
    ChecksGeneration,
    /// A report counts when all commands that it states have arrived.
    CountsCommands,
    /// What an incarnation put for the open tick is dropped when another one takes its place.
    DropsPredecessor,
    /// A held clock is repeated.
    RepeatsClock,
    /// The news are repeated with the clock.
    RepeatsNews,
    /// The clock flags the robots that have news.
    FlagsNews,
    /// A newcomer is taken in while the tick that waits for it is open.
    TakesInWhileOpen,
    /// A robot that takes part from the middle of an epoch on is named in every tick until it has reported.
    NamesUntilReported,
    /// An incarnation that is not the first is named in every tick.
    NamesReplacement,
    /// Every process gets a generation of its own.
    CountsGenerations,
    /// The name of a connected robot is taken.
    RefusesTakenName,
    /// A robot that was admitted has its place until its token is declared.
    ReservesPlace,
    /// The clock goes on at once without a robot that cannot report.
    GoesOnWithoutAbsent,
    /// While the scenario keeps a process stopped, its token decides nothing.
    HangDecides,
    /// A robot that has missed a tick because the scenario stopped it takes part again as a further incarnation only.
    RejoinsAfterHang,
    /// A robot is back after a hang when it has joined again.
    AwaitsRejoining,
    /// A connected robot that was lost is asked to join again.
    AsksToRejoin,
    /// A process that joins again after it was lost is a further incarnation.
    CountsRejoining,
    /// A robot that was given up is not counted in that tick any more.
    GivesUpForGood,
    /// A robot waits for its news where its flag is set.
    WaitsForNews,
    /// News count for the tick that they name.
    MatchesNews,
    /// A tick that was answered is not run again.
    AnswersOnce,
    /// A repeated clock repeats the report.
    RepeatsReport,
    /// A repeated clock repeats the commands.
    RepeatsCommands,
    /// A clock of an earlier tick or epoch is ignored.
    IgnoresLate,
    /// A clock of a later epoch makes a robot join again.
    JoinsNewEpoch,
    /// A robot that is asked to join again does so.
    JoinsWhenAsked,
    /// A robot that joins again takes no other process to be its successor before it has an answer.
    AwaitsWelcome,
    /// A process that is admitted as a further incarnation starts over.
    StartsOver,
    /// A welcome to the epoch that a robot takes part in changes nothing.
    GoesOnInOwnEpoch,
    /// A robot that joined in the middle of an epoch waits until it is named.
    WaitsToBeNamed,
    /// A process ends when news name a later incarnation.
    EndsWhenReplaced,
    /// A process that was admitted before ends when its name is taken.
    EndsWhenTaken,
    /// The token is declared after the welcome.
    TokenAfterWelcome,
    /// Only the newest clock is run.
    RunsNewest,
}

/// Which rules hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(crate) struct Rules {
    #[cfg(test)]
    pub(crate) broken: Option<Rule>,
}

impl Rules {
    #[cfg(test)]
    pub(crate) fn hold(self, rule: Rule) -> bool {
        self.broken != Some(rule)
    }

    #[cfg(not(test))]
    #[expect(clippy::unused_self, reason = "the same call as in tests")]
    pub(crate) const fn hold(self, _: Rule) -> bool {
        true
    }
}
