//! A TCP proxy with faults on request. It needs no privileges: a robot connects to it instead of to the simulator. It cannot
//! lose single packets, because it forwards streams.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use bus::endpoint::TLS;
use launch::LaunchError;
use launch::endpoint::NO_PORT;
use protocol::RobotName;
use protocol::random::{stream, unit};

use super::gate::{Gate, LinkSchedule};
use super::plan::FaultPlan;
use super::shape::{Flow, LinkShape};

/// Most connections at the same time; further ones are closed. A robot needs one, and makes one a second during a cut.
const MAX_CONNECTIONS: usize = 256;
/// Most bytes of a piece.
const PIECE_BYTES: usize = 16 * 1024;
/// Most pieces under way in one direction of a connection; the sender waits while there are more.
const MAX_PIECES: usize = 256;
/// Longest wait for a connection to the target.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// A link with limited bandwidth sends in slices; this is their number per second.
const SLICES_PER_S: u64 = 20;

/// An endpoint is not an address of TCP.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// It is not an address.
    #[error("{0:?} is not an address such as tcp/127.0.0.1:7447")]
    NotAnAddress(String),
    /// It is written as a URL.
    #[error("{0:?} is not written as a URL: write {1}")]
    Url(String, String),
}

/// The address of an endpoint of TCP, or of TLS, which passes a proxy unchanged.
///
/// # Errors
/// [`AddressError`] if the protocol is another one, or the host is a name.
pub fn address(endpoint: &str) -> Result<SocketAddr, AddressError> {
    let bad = || AddressError::NotAnAddress(endpoint.to_owned());
    if let Some((protocol, address)) = endpoint.split_once("://") {
        let meant = format!("{protocol}/{}", address.trim_end_matches('/'));
        return match self::address(&meant) {
            Ok(_) => Err(AddressError::Url(endpoint.to_owned(), meant)),
            Err(_) => Err(bad()),
        };
    }

    let (protocol, address) = endpoint.split_once('/').ok_or_else(bad)?;
    if !["tcp", TLS].contains(&protocol) {
        return Err(bad());
    }
    address.parse().map_err(|_| bad())
}

/// A running proxy. It runs until the end of the process.
#[derive(Debug)]
pub struct Proxy {
    local: SocketAddr,
    gate: Arc<Gate>,
    open: Arc<Connections>,
}

/// Both sockets of every connection, to close them.
#[derive(Debug, Default)]
struct Connections(Mutex<BTreeMap<u64, Vec<TcpStream>>>);

impl Connections {
    fn close_all(&self) {
        self.with(|open| {
            for side in open.values().flatten() {
                let _is_closed_already = side.shutdown(Shutdown::Both);
            }
        });
    }

    fn with<T>(&self, f: impl FnOnce(&mut BTreeMap<u64, Vec<TcpStream>>) -> T) -> T {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Proxy {
    /// Starts to forward from one address to the other.
    ///
    /// # Errors
    /// If the address cannot be bound.
    pub fn start(listen: SocketAddr, to: SocketAddr) -> std::io::Result<Self> {
        let listener = TcpListener::bind(listen)?;
        let proxy = Self {
            local: listener.local_addr()?,
            gate: Arc::default(),
            open: Arc::default(),
        };
        let gate = proxy.gate.clone();
        let open = proxy.open.clone();
        Builder::new().spawn(move || accept(&listener, to, &gate, &open))?;
        Ok(proxy)
    }

    /// The address at which it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.local
    }

    /// The current shape of the link.
    #[must_use]
    pub fn shape(&self) -> LinkShape {
        self.gate.shape()
    }

    /// Plays the faults of a plan, the times of which begin with the first connection. `apply` receives each shape and the
    /// time since then.
    pub fn play(&self, plan: &FaultPlan, mut apply: impl FnMut(LinkShape, Duration)) {
        let apply = |_: &RobotName, shape: LinkShape, at: Duration| {
            apply(shape, at);
            Ok::<(), std::convert::Infallible>(())
        };
        let Ok(()) = plan.play(self.gate.wait_for_use(), apply, || false);
    }

    /// Changes the shape of the link.
    pub fn set(&self, shape: LinkShape) {
        self.gate.set(shape);
        if shape.flow == Flow::Closed {
            self.open.close_all();
        }
    }
}

fn accept(listener: &TcpListener, to: SocketAddr, gate: &Arc<Gate>, open: &Arc<Connections>) {
    for id in 0.. {
        let client = match listener.accept() {
            Ok((client, _)) => client,
            Err(error) => {
                // Most likely there are no free file descriptors at the moment.
                tracing::warn!("a connection could not be accepted: {error}");
                std::thread::sleep(CONNECT_TIMEOUT);
                continue;
            }
        };

        // Only this thread adds connections, so there is still room below.
        let is_full = open.with(|open| open.len() >= MAX_CONNECTIONS);
        if is_full || gate.shape().flow == Flow::Closed {
            continue; // Dropping the socket closes it.
        }
        gate.touch();
        let Ok(own) = client.try_clone() else {
            continue;
        };
        // Noted before the thread begins, so that a link that closes now closes this connection as
        // well.
        open.with(|open| open.insert(id, vec![own]));

        let gate = gate.clone();
        let open = open.clone();
        let forwarded = open.clone();
        let forwards = move || {
            if let Err(error) = forward(id, client, to, &gate, &forwarded) {
                tracing::debug!("a connection through the proxy: {error}");
            }
            forwarded.with(|open| open.remove(&id));
        };
        if let Err(error) = Builder::new().spawn(forwards) {
            tracing::warn!("a connection through the proxy is closed: {error}");
            open.with(|open| open.remove(&id));
        }
    }
}

/// Forwards one connection to its end.
fn forward(
    id: u64,
    client: TcpStream,
    to: SocketAddr,
    gate: &Arc<Gate>,
    open: &Connections,
) -> std::io::Result<()> {
    // During a cut, the connection to the target is made when the cut heals.
    gate.pass();
    let server = TcpStream::connect_timeout(&to, CONNECT_TIMEOUT)?;
    server.set_nodelay(true)?;
    client.set_nodelay(true)?;
    let own = server.try_clone()?;
    let is_open = open.with(|open| open.get_mut(&id).map(|sides| sides.push(own)).is_some());
    // The link may have closed while the target was connected: then this socket was not among those
    // that were closed.
    if !is_open || gate.shape().flow == Flow::Closed {
        return Ok(());
    }

    let number = id.wrapping_mul(2);
    let there = pipe(
        client.try_clone()?,
        server.try_clone()?,
        gate.clone(),
        number,
    )?;
    let back = pipe(server, client, gate.clone(), number + 1)?;
    for writer in [there, back] {
        drop(writer.join());
    }
    Ok(())
}

/// When a piece may arrive, and its bytes.
type Piece = (Instant, Vec<u8>);

/// One direction: one thread reads, another one writes, and the queue between them holds delayed pieces. Returns the
/// writer. `number` names the stream of random numbers.
fn pipe(
    from: TcpStream,
    to: TcpStream,
    gate: Arc<Gate>,
    number: u64,
) -> std::io::Result<JoinHandle<()>> {
    let (send, pieces) = sync_channel(MAX_PIECES);
    let reader = gate.clone();
    let writer = Builder::new().spawn(move || write(to, &pieces, &gate))?;
    Builder::new().spawn(move || read(from, &send, &reader, number))?;
    Ok(writer)
}

fn read(mut from: TcpStream, send: &SyncSender<Piece>, gate: &Gate, number: u64) {
    let mut luck = stream(number, "proxy");
    let mut pace = LinkSchedule::new();
    let mut buffer = vec![0; PIECE_BYTES];

    loop {
        gate.pass();
        // After an error the writer closes the other side, as at the end.
        let Ok(bytes @ 1..) = from.read(&mut buffer) else {
            return;
        };
        // The time of arrival counts, so that pieces are delayed side by side and not one after the
        // other.
        let due = pace.due(Instant::now(), gate.shape(), unit(&mut luck));
        if send.send((due, buffer[..bytes].to_vec())).is_err() {
            return; // The writer has ended because the other side is closed.
        }
    }
}

fn write(mut to: TcpStream, pieces: &Receiver<Piece>, gate: &Gate) {
    let mut pace = LinkSchedule::new();
    let mut written = Ok(());
    for (due, piece) in pieces {
        sleep_until(due);
        written = write_piece(&mut to, &piece, &mut pace, gate);
        if written.is_err() {
            break;
        }
    }
    // The end of a connection is held by a cut like its bytes.
    gate.pass();

    // The end of one direction leaves the other one open; a failure closes both.
    let how = match written {
        Ok(()) => Shutdown::Write,
        Err(_) => Shutdown::Both,
    };
    let _is_closed_already = to.shutdown(how);
}

/// Writes a piece in slices, as slowly as the bandwidth requires.
fn write_piece(
    to: &mut TcpStream,
    piece: &[u8],
    pace: &mut LinkSchedule,
    gate: &Gate,
) -> std::io::Result<()> {
    let bps = gate.shape().bandwidth_bps.unwrap_or(u64::MAX);
    let slice_bytes = usize::try_from(bps / 8 / SLICES_PER_S).unwrap_or(usize::MAX);

    for slice in piece.chunks(slice_bytes.max(1)) {
        // Before and after the wait: a cut that begins during it holds the slice as well.
        gate.pass();
        sleep_until(pace.sent(Instant::now(), gate.shape(), slice.len()));
        gate.pass();
        to.write_all(slice)?;
    }

    Ok(())
}

fn sleep_until(due: Instant) {
    std::thread::sleep(due.saturating_duration_since(Instant::now()));
}

/// Starts a proxy on a free port of the loopback interface, on to another port of it.
pub(super) fn on_loopback(to_port: u16) -> Result<Proxy, LaunchError> {
    let on_port = |port| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    Proxy::start(on_port(0), on_port(to_port)).map_err(LaunchError::system(NO_PORT))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: Duration = Duration::from_millis(150);

    /// A proxy with a connection through it: the sockets of client and server.
    fn link() -> (Proxy, TcpStream, TcpStream) {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let proxy =
            Proxy::start(([127, 0, 0, 1], 0).into(), listener.local_addr().unwrap()).unwrap();
        let client = TcpStream::connect(proxy.local).unwrap();
        let (server, _) = listener.accept().unwrap();
        for side in [&client, &server] {
            side.set_read_timeout(Some(Duration::from_secs(20)))
                .unwrap();
        }

        (proxy, client, server)
    }

    fn receive(from: &mut TcpStream, bytes: usize) -> Vec<u8> {
        let mut received = vec![0; bytes];
        from.read_exact(&mut received).unwrap();
        received
    }

    fn is_silent(side: &mut TcpStream) -> bool {
        side.set_read_timeout(Some(SHORT)).unwrap();
        let read = side.read(&mut [0]);
        side.set_read_timeout(Some(Duration::from_secs(20)))
            .unwrap();
        matches!(read, Err(error) if error.kind() == std::io::ErrorKind::WouldBlock)
    }

    #[test]
    fn a_cut_holds_what_is_sent_and_loses_nothing() {
        let (proxy, mut client, mut server) = link();
        client.write_all(b"one").unwrap();
        assert_eq!(receive(&mut server, 3), b"one");

        proxy.set(LinkShape {
            flow: Flow::Cut,
            ..LinkShape::default()
        });
        client.write_all(b"two").unwrap();
        server.write_all(b"back").unwrap();
        assert!(
            is_silent(&mut server) && is_silent(&mut client),
            "nothing passes a cut"
        );

        proxy.set(LinkShape::default());
        assert_eq!(receive(&mut server, 3), b"two");
        assert_eq!(receive(&mut client, 4), b"back");

        drop(client);
        let end = server.read(&mut [0]).unwrap();
        assert_eq!(end, 0, "the end passes, too");
    }

    #[test]
    fn a_connection_during_a_cut_is_made_when_it_heals() {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let proxy =
            Proxy::start(([127, 0, 0, 1], 0).into(), listener.local_addr().unwrap()).unwrap();
        proxy.set(LinkShape {
            flow: Flow::Cut,
            ..LinkShape::default()
        });
        let mut client = TcpStream::connect(proxy.local).unwrap();
        client.write_all(b"hello").unwrap();
        listener.set_nonblocking(true).unwrap();
        std::thread::sleep(SHORT);
        assert!(listener.accept().is_err(), "a connection passed the cut");
        listener.set_nonblocking(false).unwrap();
        proxy.set(LinkShape::default());
        assert_eq!(receive(&mut listener.accept().unwrap().0, 5), b"hello");
    }

    #[test]
    fn closing_ends_all_connections_and_refuses_new_ones() {
        let (proxy, mut client, mut server) = link();
        client.write_all(b"one").unwrap();
        assert_eq!(receive(&mut server, 3), b"one");

        proxy.set(LinkShape {
            flow: Flow::Closed,
            ..LinkShape::default()
        });
        assert_eq!(server.read(&mut [0]).unwrap(), 0);
        assert_eq!(client.read(&mut [0]).unwrap(), 0);
        let mut newcomer = TcpStream::connect(proxy.local).unwrap();
        newcomer
            .set_read_timeout(Some(Duration::from_secs(20)))
            .unwrap();
        assert!(matches!(newcomer.read(&mut [0]), Ok(0) | Err(_)) && !is_silent(&mut newcomer));
    }

    #[test]
    fn delay_and_bandwidth_take_effect() {
        let (proxy, mut client, mut server) = link();
        let delay = Duration::from_millis(80);
        proxy.set(LinkShape {
            delay,
            jitter: delay / 8,
            ..LinkShape::default()
        });
        let sent = Instant::now();
        client.write_all(b"ping").unwrap();
        receive(&mut server, 4);
        server.write_all(b"pong").unwrap();
        receive(&mut client, 4);
        let took = sent.elapsed();
        assert!(took >= 2 * delay, "the round trip took {took:?}");
        // 4,000 bytes at 80 kbit/s: 0.4 s.
        proxy.set(LinkShape {
            bandwidth_bps: Some(80_000),
            ..LinkShape::default()
        });
        let sent = Instant::now();
        client.write_all(&[7; 4000]).unwrap();
        assert_eq!(receive(&mut server, 4000), [7; 4000]);
        let took = sent.elapsed();
        assert!(took >= Duration::from_millis(390), "it took {took:?}");
    }

    #[test]
    fn megabytes_pass_unchanged_although_buffers_are_bounded() {
        let (_proxy, mut client, mut server) = link();
        let sent: Vec<u8> = (0..9_000_000_u32)
            .map(|i| i.to_le_bytes()[i as usize % 3])
            .collect();
        let copy = sent.clone();
        let sender = std::thread::spawn(move || {
            client.write_all(&copy).unwrap();
            client.shutdown(Shutdown::Write).unwrap();
        });

        std::thread::sleep(SHORT);
        let mut received = Vec::new();
        server.read_to_end(&mut received).unwrap();
        sender.join().unwrap();
        assert!(sent == received, "the bytes received are not those sent");
    }

    #[test]
    fn addresses_are_endpoints() {
        assert!(address("tcp/127.0.0.1:7447").is_ok());
        for bad in [
            "127.0.0.1:7447",
            "tcp/localhost",
            "udp/127.0.0.1:1",
            "http://127.0.0.1:1",
        ] {
            let refused = address(bad).unwrap_err().to_string();
            assert!(refused.contains("not an address such as"), "{refused}");
        }
        for url in ["tcp://127.0.0.1:7447", "tcp://127.0.0.1:7447/"] {
            let refused = address(url).unwrap_err().to_string();
            assert!(refused.contains("write tcp/127.0.0.1:7447"), "{refused}");
        }
    }
}
