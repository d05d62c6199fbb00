//! A session whose handshake is held up: it is given up in time, and whenever the rest arrives, the client has a session that
//! works soon afterwards.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bus::{Bus, Declared, Role};

/// How long an attempt to connect may take (`settings.rs`).
const OPEN: Duration = Duration::from_secs(1);
/// How long a client that connects may take.
const ACCEPT: Duration = Duration::from_secs(2);
/// Longest wait for a session.
const PATIENCE: Duration = Duration::from_secs(20);
/// Handshakes of a sweep around the time limit.
const SWEEP: u32 = 200;
/// The last message of a handshake arrives so much later than that of the one before.
const STEP: Duration = Duration::from_micros(100);
/// Threads that compute meanwhile: what follows on the last message takes longer on a machine under load.
const BUSY_THREADS: usize = 4;

/// A router that replies to queries on `where`.
struct Router {
    _bus: Bus,
    _queryable: Declared,
    address: SocketAddr,
}

impl Router {
    fn new() -> Self {
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap();
        drop(free);
        let role = Role::Router {
            listen: format!("tcp/{address}"),
            trusts_network: false,
        };
        let bus = Bus::open(&role, None).unwrap();
        let queryable = bus.queryable("where", |query| query.reply("where", b"here".to_vec()));

        Self {
            _bus: bus,
            _queryable: queryable.unwrap(),
            address,
        }
    }
}

/// Who sends a message.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sender {
    Client,
    Router,
}

/// A message of a handshake that a relay holds, and everything of that sender after it.
#[derive(Debug, Clone, Copy)]
struct Held {
    sender: Sender,
    /// Its number among those of its sender: both have sent two when the handshake is over.
    message: usize,
    /// How long after the connection was made; for ever if `None`.
    lasting: Option<Duration>,
}

impl Held {
    /// Whether it is this message.
    fn is(self, sender: Sender, message: usize) -> bool {
        self.sender == sender && self.message == message
    }
}

/// A relay between one client and a router. It holds a message of the connection that follows a cut.
struct Relay {
    endpoint: String,
    state: Arc<Mutex<State>>,
}

#[derive(Default)]
struct State {
    /// The client's side of the last connection.
    last: Option<TcpStream>,
    /// Whether the next connection follows a cut.
    is_cut: bool,
}

impl Relay {
    fn new(router: SocketAddr, held: Held) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        let state = Arc::new(Mutex::new(State::default()));
        let shared = state.clone();
        std::thread::spawn(move || {
            for client in listener.incoming().map(Result::unwrap) {
                let mut state = shared.lock().unwrap();
                let follows_a_cut = std::mem::take(&mut state.is_cut);
                state.last = Some(client.try_clone().unwrap());
                connect(client, router, follows_a_cut.then_some(held));
            }
        });

        Self { endpoint, state }
    }

    /// Breaks the connection.
    fn cut(&self) {
        let mut state = self.state.lock().unwrap();
        state.is_cut = true;
        let last = state.last.take().unwrap();
        last.shutdown(Shutdown::Both).unwrap();
    }
}

/// Relays a connection, a thread for each direction.
fn connect(client: TcpStream, router: SocketAddr, held: Option<Held>) {
    let accepted = Instant::now();
    let router = TcpStream::connect(router).unwrap();
    let ways = [
        (
            Sender::Client,
            client.try_clone().unwrap(),
            router.try_clone().unwrap(),
        ),
        (Sender::Router, router, client),
    ];
    for (sender, from, to) in ways {
        std::thread::spawn(move || {
            // A connection that ends is not the relay's affair.
            let _is_over = relay(sender, &from, &to, held, accepted);
            let _is_closed = to.shutdown(Shutdown::Both);
        });
    }
}

/// Relays what one side sends: a length of two bytes, and a message.
fn relay(
    sender: Sender,
    mut from: &TcpStream,
    mut to: &TcpStream,
    held: Option<Held>,
    accepted: Instant,
) -> std::io::Result<()> {
    to.set_nodelay(true)?;
    for number in 0.. {
        let mut length = [0; 2];
        from.read_exact(&mut length)?;
        let mut message = vec![0; usize::from(u16::from_le_bytes(length))];
        from.read_exact(&mut message)?;

        if let Some(held) = held.filter(|held| held.is(sender, number)) {
            let Some(lasting) = held.lasting else {
                std::io::copy(&mut from, &mut std::io::sink())?;
                return Ok(());
            };
            std::thread::sleep(lasting.saturating_sub(accepted.elapsed()));
        }
        to.write_all(&[&length[..], &message].concat())?;
    }
    Ok(())
}

/// Waits until the router replies. Returns how long it took, or `None` if there is no reply.
fn reaches(client: &Bus) -> Option<Duration> {
    let begun = Instant::now();
    while begun.elapsed() < PATIENCE {
        let reply = client.get_within("where", "", None, Duration::from_secs(1));
        if reply.unwrap().is_some() {
            return Some(begun.elapsed());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    None
}

/// A session over a relay that will hold a message of the handshake after a cut.
struct Client {
    relay: Relay,
    bus: Bus,
}

impl Client {
    fn new(router: SocketAddr, held: Held, config: Option<&PathBuf>) -> Self {
        let relay = Relay::new(router, held);
        let role = Role::Client {
            connect: relay.endpoint.clone(),
            patience: PATIENCE,
        };
        let bus = Bus::open(&role, config).unwrap();
        assert!(reaches(&bus).is_some(), "the first session works");

        Self { relay, bus }
    }

    /// Cuts the link. Returns how long it takes until there is a session that works.
    fn returns(&self) -> Option<Duration> {
        self.relay.cut();
        reaches(&self.bus)
    }
}

/// Holds a message of many handshakes until around the time limit, on a machine under load.
fn sweep(sender: Sender, limit: Duration, config: Option<&PathBuf>) {
    let router = Router::new();
    let clients: Vec<(Duration, Client)> = (0..SWEEP)
        .map(|step| {
            let lasting = limit + step * STEP - SWEEP * STEP / 2;
            let held = Held {
                sender,
                message: 1,
                lasting: Some(lasting),
            };
            (lasting, Client::new(router.address, held, config))
        })
        .collect();

    let is_over = AtomicBool::new(false);
    let all_took: Vec<(Duration, Option<Duration>)> = std::thread::scope(|scope| {
        for _ in 0..BUSY_THREADS {
            scope.spawn(|| {
                while !is_over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let returning: Vec<_> = clients
            .iter()
            .map(|(lasting, client)| (*lasting, scope.spawn(|| client.returns())))
            .collect();
        let all_took = returning
            .into_iter()
            .map(|(lasting, returning)| (lasting, returning.join().unwrap_or_default()))
            .collect();
        is_over.store(true, Ordering::Relaxed);
        all_took
    });

    let lost: Vec<Duration> = all_took
        .iter()
        .filter(|(_, took)| took.is_none())
        .map(|(lasting, _)| *lasting)
        .collect();
    let longest = all_took.iter().filter_map(|(_, took)| *took).max();
    println!(
        "{} of {SWEEP} clients did not return, the others within {longest:.2?}",
        lost.len()
    );
    assert!(lost.is_empty(), "held for {lost:?}, they do not return");
}

#[test]
fn an_attempt_to_connect_that_ends_when_the_last_message_arrives_leaves_no_dead_session() {
    sweep(Sender::Router, OPEN, None);
}

/// The client's own limit is out of the way.
#[test]
fn a_client_that_is_late_by_a_little_leaves_no_dead_session() {
    let built_in = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../configs/zenoh/robot.json5"
    );
    let text = std::fs::read_to_string(built_in).unwrap();
    let patient = text.replace("open_timeout: 1000", "open_timeout: 10000");
    assert_ne!(patient, text);
    let name = format!("cars-handshake-{}.json5", std::process::id());
    let config = std::env::temp_dir().join(name);
    std::fs::write(&config, patient).unwrap();

    sweep(Sender::Client, ACCEPT, Some(&config));
    std::fs::remove_file(&config).unwrap();
}

/// Whatever message is lost, the next attempt follows soon after the time limit.
#[test]
fn an_attempt_that_stalls_is_given_up_in_time() {
    let router = Router::new();
    for sender in [Sender::Router, Sender::Client] {
        for message in [0, 1] {
            let held = Held {
                sender,
                message,
                lasting: None,
            };
            let client = Client::new(router.address, held, None);
            let took = client.returns().unwrap();
            println!("{held:?}: {took:.2?}");
            assert!(took >= OPEN, "{held:?}: it took only {took:?}");
            assert!(took < 3 * OPEN, "{held:?}: it took {took:?}");
        }
    }
}
