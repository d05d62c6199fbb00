//! States of robots, queries for them, and messages of the contract.

use std::collections::BTreeMap;

use protocol::messages::{CommandText, TickUpdate};

use super::{joined, name};
use crate::{Bulletin, IncarnationNotice, NoState, RecentStates, Sent, StateQuery, TickAnswer};

#[test]
fn the_last_two_states_are_kept() {
    let at = |epoch: Option<u32>, tick: Option<u64>| StateQuery { tick, epoch };
    let mut states = RecentStates::default();
    assert_eq!(states.answer(at(None, None)), Err(NoState::NotYet));

    for (epoch, tick) in [(1, 9), (2, 4), (2, 3), (2, 5), (1, 10)] {
        states.add(epoch, tick, (epoch, tick));
    }
    states.add(2, 5, (0, 0));

    assert_eq!(states.answer(at(None, None)), Ok((2, 5)));
    assert_eq!(states.answer(at(Some(2), Some(5))), Ok((2, 4)));
    assert_eq!(states.answer(at(Some(2), Some(6))), Ok((2, 5)));
    assert_eq!(states.answer(at(Some(2), Some(7))), Err(NoState::NotYet));
    assert_eq!(
        states.answer(at(Some(2), Some(8))),
        Err(NoState::OutOfRange)
    );
    assert_eq!(states.answer(at(Some(2), Some(4))), Err(NoState::Over));
    assert_eq!(
        states.answer(at(Some(2), Some(0))),
        Err(NoState::OutOfRange)
    );
    assert_eq!(states.answer(at(Some(1), Some(5))), Err(NoState::Over));
    assert_eq!(states.answer(at(Some(3), Some(1))), Err(NoState::NotYet));

    // One of both alone: a tick of the newest epoch, or the newest state if it is of that epoch.
    assert_eq!(states.answer(at(None, Some(5))), Ok((2, 4)));
    assert_eq!(states.answer(at(None, Some(7))), Err(NoState::NotYet));
    assert_eq!(states.answer(at(Some(2), None)), Ok((2, 5)));
    assert_eq!(states.answer(at(Some(1), None)), Err(NoState::Over));
    assert_eq!(states.answer(at(Some(3), None)), Err(NoState::NotYet));
}

#[test]
fn why_there_is_no_state_is_said_in_words() {
    let words = [NoState::NotYet, NoState::Over, NoState::OutOfRange].map(|why| why.to_string());

    assert_eq!(
        words,
        [
            "that tick has not been reported yet: ask again",
            "that tick is over",
            "that tick is out of range"
        ]
    );
}

#[test]
fn a_query_is_read_from_its_parameters() {
    let read = |tick: Option<&str>, epoch: Option<&str>| {
        StateQuery::read(|name| if name == "tick" { tick } else { epoch })
    };
    let query = StateQuery {
        tick: Some(7),
        epoch: Some(2),
    };

    assert_eq!(read(Some("7"), Some("2")), Ok(query));
    assert_eq!(read(None, None), Ok(StateQuery::default()));
    let wrong = Err("parameter epoch: not a whole number".to_owned());
    assert_eq!(read(None, Some("-1")), wrong);
}

#[test]
fn commands_are_numbered_in_their_order() {
    let sent = |to: &str, command: &str| Sent {
        to: name(to).into(),
        command: CommandText::named(command),
    };
    let commands = vec![sent("B", "first"), sent("C", "second")];
    let answer = TickAnswer {
        epoch: 1,
        tick: 7,
        generation: 2,
        commands: commands.clone(),
        state: (),
        report: (),
    };

    let put: Vec<_> = answer.commands_from(1).collect();

    let stamps = put
        .iter()
        .map(|(_, put)| (put.epoch, put.tick, put.generation, put.number));
    assert!(stamps.eq([(1, 7, 2, 1), (1, 7, 2, 2)]));
    let arrived = put.into_iter().map(|(to, put)| Sent::new(to.clone(), put));
    assert!(arrived.eq(commands));
}

#[test]
fn news_name_incarnations() {
    let news = TickUpdate {
        joined: Some(2),
        rejoin: Some(1),
        ..TickUpdate::default()
    };
    let notice = IncarnationNotice {
        rejoin: Some(1),
        ..joined(2)
    };
    assert_eq!(IncarnationNotice::from(&news), notice);

    let bulletin = BTreeMap::from([(name("A"), "news")]);
    assert_eq!(bulletin.robots(), [name("A")].into());
    assert_eq!(bulletin.compose(&name("A"), joined(1)), "news");
    assert_eq!(bulletin.compose(&name("B"), joined(1)), "");
}
