//! How long a robot tries to join, over a real session.

use std::net::TcpListener;
use std::time::{Duration, Instant};

use bus::{Bus, Role};
use protocol::keys::Keys;
use protocol::{RobotName, RunName};
use robot::{Action, BadParameters, Cars, Host, HostError, HostOptions, Robot};

/// How long a robot tries to join.
const PATIENCE: Duration = Duration::from_millis(200);

struct Statue;

impl Robot for Statue {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        Action::stay(cars)
    }
}

fn run() -> RunName {
    RunName::new("joining").unwrap()
}

/// A router in the place of a simulator, which answers nothing, and its endpoint.
fn router() -> (Bus, String) {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let listen = format!("tcp/{}", free.local_addr().unwrap());
    drop(free);
    let role = Role::Router {
        listen: listen.clone(),
        trusts_network: false,
    };
    (Bus::open(&role, None).unwrap(), listen)
}

/// Runs a robot until it gives up, and measures for how long it tried.
fn give_up(connect: String) -> (HostError, Duration) {
    let options = HostOptions {
        run: run(),
        connect,
        patience: PATIENCE,
        gone_patience: Duration::from_secs(60),
        zenoh_config: None,
    };
    let name = RobotName::new("Statue").unwrap();
    let host = Host::connect(vec![(name, Box::new(Statue))], options).unwrap();
    let begun = Instant::now();
    let error = host.run().unwrap_err();
    (error, begun.elapsed())
}

#[test]
fn a_robot_goes_on_trying_while_the_simulator_is_there() {
    let (bus, connect) = router();
    let (error, _) = give_up(connect.clone());
    assert!(matches!(error, HostError::NoSimulator { .. }), "{error}");

    let _token = bus.token(&Keys::new(&run()).alive_sim()).unwrap();
    let (error, tried) = give_up(connect);
    assert!(tried >= 9 * PATIENCE, "{tried:?}");
    let text = error.to_string();
    assert!(text.contains("has not admitted Statue"), "{text}");
    assert!(text.contains("CARS_PATIENCE_S"), "{text}");
}
