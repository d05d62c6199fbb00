//! Control, wherever ticks come from: the CD-player buttons of the paper.

use bus::Query;
use protocol::decode;
use protocol::messages::{Control, ControlAnswer, End, SetupAnswer};
use scenario::Scenario;

use super::event::{ServerEvent, StopReason};
use super::frontend::{Frontend, answer, refuse};
use super::source::TickSource;

/// Handles one event.
pub(super) fn handle<S: TickSource>(
    event: ServerEvent,
    source: &mut S,
    frontend: &mut Frontend,
) -> Result<(), S::Interrupt> {
    match event {
        ServerEvent::Control(query) => on_control(query, source, frontend),
        ServerEvent::Terminate => Err(StopReason::End(End::Stopped).into()),
        other => source.handle(other, frontend),
    }
}

/// People ask for something; they are answered at once.
pub(super) fn on_control<S: TickSource>(
    query: Query,
    source: &mut S,
    frontend: &mut Frontend,
) -> Result<(), S::Interrupt> {
    match decode::<Control>(query.key(), "an operator", &query.body()) {
        Ok(control) => source.request(query, control, frontend),
        Err(error) => {
            refuse(&query, &error.to_string());
            Ok(())
        }
    }
}

/// Does what a request asks for, and answers it.
pub(super) fn execute<S: TickSource>(
    query: Query,
    control: &Control,
    source: &mut S,
    frontend: &mut Frontend,
) -> Result<(), S::Interrupt> {
    match control {
        Control::Step { n } => step(*n, query, source, frontend),
        Control::Setup => answer_setup(&query, source.scenario()),
        Control::Log => frontend.observers.answer_log(&query),
        Control::Stop => {
            // Answered when the record is complete.
            frontend.stopping = Some(query);
            return Err(StopReason::End(End::Stopped).into());
        }
        other => match act(other, source, frontend) {
            Ok(()) => {
                source.answer_status(&query, frontend);
                source.show(frontend);
            }
            Err(explanation) => refuse(&query, &explanation),
        },
    }

    Ok(())
}

fn act<S: TickSource>(
    control: &Control,
    source: &mut S,
    frontend: &mut Frontend,
) -> Result<(), String> {
    match control {
        Control::Status => Ok(()),
        Control::Start => source
            .check_next_tick()
            .and_then(|()| frontend.pace.start()),

        Control::Pause => {
            frontend.pace.pause()?;
            source.answer_stepping(frontend);
            Ok(())
        }
        Control::Speed { factor } => frontend.pace.set_speed(*factor),
        other => source.act(other, frontend),
    }
}

fn step<S: TickSource>(n: u64, query: Query, source: &mut S, frontend: &mut Frontend) {
    let granted = source
        .check_next_tick()
        .and_then(|()| frontend.pace.step(n));
    if let Err(explanation) = granted {
        return refuse(&query, &explanation);
    }
    let Some(until) = source.tick_after(frontend.pace.pending_steps) else {
        return source.answer_status(&query, frontend);
    };

    // Only the last client that steps is kept waiting; the one before gets the status as it is.
    if let Some((earlier, _)) = frontend.pace.stepping.replace((query, until)) {
        source.answer_status(&earlier, frontend);
    }
}

fn answer_setup(query: &Query, scenario: Result<Scenario, String>) {
    let setup = scenario.and_then(|scenario| {
        let text = scenario.to_toml().map_err(|error| error.to_string())?;
        Ok(SetupAnswer {
            setup: scenario.setup(),
            scenario: text,
        })
    });
    match setup {
        Ok(setup) => answer(query, &ControlAnswer::Setup(Box::new(setup))),
        Err(reason) => refuse(query, &reason),
    }
}
