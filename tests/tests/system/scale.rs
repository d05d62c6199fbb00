//! Many robots in one process that all speak to each other: what they put grows with what they send.

use std::collections::BTreeSet;
use std::process::Command;
use std::sync::mpsc::channel;
use std::thread;

use bus::{Bus, Role};
use protocol::keys::Keys;
use protocol::messages::{Command as Put, Payload, Target};
use protocol::{RobotName, RunName, Tick, decode};
use robot::{Action, BadParameters, Cars, Host, HostOptions, Robot};
use system_tests::processes::Running;
use system_tests::{Lab, PATIENCE, free_port, programs};

/// With a listener for each pair of robots the first tick of 80 robots took more than 100 s.
const ROBOTS: usize = 100;
/// The tick in which each robot sends a broadcast, and the one in which it sends a command to each other one.
const BROADCASTS: Tick = 1;
const SENDS: Tick = 2;

/// Speaks to all others.
struct Speaker;

impl Robot for Speaker {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn is_quick(&self) -> bool {
        true
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        if cars.tick() == BROADCASTS {
            cars.broadcast("here", Payload::new(cars.name().as_str().into()));
        }
        if cars.tick() == SENDS {
            let own = cars.name();
            for other in cars.welcome().roster.iter().filter(|other| *other != own) {
                cars.set_robot_command(other.as_str(), "hello").unwrap();
            }
        }
        Action::stay(cars)
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_hundred_robots_of_one_process_all_speak_to_each_other() {
    let lab = Lab::new();
    let run = "scale";
    let mut scenario = "duration = \"2 s\"\n[field]\nsize = [\"60 m\", \"60 m\"]\n".to_owned();
    let names: Vec<String> = (0..ROBOTS).map(|index| format!("R{index}")).collect();
    for (index, name) in names.iter().enumerate() {
        let (x, y) = (1 + 2 * (index % 20), 1 + 2 * (index / 20));
        scenario += &format!("[[robot]]\nname = \"{name}\"\nat = [\"{x} m\", \"{y} m\"]\n");
    }
    let scenario = lab.write("many.toml", &scenario);
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let mut command = Command::new(programs().join("cars-sim"));
    command
        .arg(scenario)
        .args([
            "--run", run, "--listen", &endpoint, "--speed", "max", "--out",
        ])
        .arg(lab.out());
    let mut simulator = Running::start(command, run, lab.out().join(run));

    // Beside the robots: what they put.
    let role = Role::Client {
        connect: endpoint.clone(),
        patience: PATIENCE,
    };
    let witness = Bus::open(&role, None).unwrap();
    let keys = Keys::new(&RunName::new(run).unwrap());
    let (sender, put) = channel();
    let mut subscribers = Vec::new();
    for keys in [keys.outboxes(), keys.commands()] {
        let sender = sender.clone();
        let subscriber = witness.subscribe(&keys, move |key, bytes| {
            let command: Put = decode(key, "a robot", bytes).unwrap();
            let _is_over = sender.send((key.to_owned(), command));
        });
        subscribers.push(subscriber.unwrap());
    }

    let robots = names.iter().map(|name| {
        let name = RobotName::new(name).unwrap();
        (name, Box::new(Speaker) as Box<dyn Robot>)
    });
    let options = HostOptions {
        run: RunName::new(run).unwrap(),
        connect: endpoint,
        patience: PATIENCE,
        gone_patience: PATIENCE,
        zenoh_config: None,
    };
    let host = Host::connect(robots.collect(), options).unwrap();
    let host = thread::spawn(move || host.run());
    assert!(simulator.wait().success());
    host.join().unwrap().unwrap();
    witness.close();

    let events = lab.events(run);
    let count = |kind: &str| events.iter().filter(|event| event["event"] == kind).count();
    let pairs = ROBOTS * (ROBOTS - 1);
    assert_eq!(count("command_sent"), 2 * pairs);
    assert_eq!(count("command_delivered"), 2 * pairs);

    // A clock that was held is put again, and so are the answers to it.
    drop(sender);
    let put: Vec<(String, Put)> = put.try_iter().collect();
    let keys: BTreeSet<&str> = put.iter().map(|(key, _)| key.as_str()).collect();
    assert_eq!(
        keys.len(),
        ROBOTS,
        "a key for each robot, not for each pair"
    );
    let messages: BTreeSet<(&str, Tick, u32)> = put
        .iter()
        .map(|(key, command)| (key.as_str(), command.tick, command.number))
        .collect();
    assert_eq!(messages.len(), ROBOTS + pairs);
    let is_broadcast = |(_, command): &&(String, Put)| command.to == Some(Target::Others);
    assert!(
        put.iter()
            .filter(is_broadcast)
            .all(|(_, command)| command.tick == BROADCASTS)
    );
}
