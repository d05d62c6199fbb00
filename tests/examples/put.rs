//! Puts what comes on standard input on a key of a run's bus: for tests of what others make of it.
//!
//!     put tcp/127.0.0.1:7447 cars/default/robot/Leguin/panel < message.json

use std::error::Error;
use std::io::Read;
use std::time::Duration;

use bus::{Bus, Role};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [connect, key] = arguments.as_slice() else {
        return Err("put ENDPOINT KEY < MESSAGE".into());
    };

    let mut message = Vec::new();
    std::io::stdin().read_to_end(&mut message)?;
    let bus = Bus::open(
        &Role::Client {
            connect: connect.clone(),
            patience: Duration::from_secs(5),
        },
        None,
    )?;

    bus.put(key, message)?;
    bus.close();

    Ok(())
}
