//! The link of a robot to the simulator: a proxy that cuts it.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use system_tests::programs;

/// A proxy between one robot and the simulator.
pub(super) struct Cable {
    proxy: Child,
    output: BufReader<ChildStdout>,
    /// Where the robot connects.
    pub(super) endpoint: String,
    /// When it is to be whole again.
    heals: Option<Instant>,
}

impl Cable {
    /// A proxy for the simulator at a port of this machine. `scheme` is that of the simulator's endpoint.
    pub(super) fn new(scheme: &str, port: u16) -> Self {
        let to = format!("tcp/127.0.0.1:{port}");
        let mut command = Command::new(programs().join("cars"));
        command.args(["net", "proxy", "--listen", "tcp/127.0.0.1:0", "--to", &to]);
        let mut proxy = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut output = BufReader::new(proxy.stdout.take().unwrap());
        let mut line = String::new();
        output.read_line(&mut line).unwrap();
        let address = line
            .strip_prefix("listening at ")
            .and_then(|rest| rest.split(',').next())
            .unwrap();
        let endpoint = format!("{scheme}/{address}");

        Self {
            proxy,
            output,
            endpoint,
            heals: None,
        }
    }

    /// Cuts the link until [`Self::heal`].
    pub(super) fn cut(&mut self) {
        self.order("cut");
    }

    /// Cuts the link for this long, or for longer if it is cut already.
    pub(super) fn cut_for(&mut self, lasting: Duration) {
        self.order("cut");
        let heals = Instant::now() + lasting;
        self.heals = Some(self.heals.map_or(heals, |before| before.max(heals)));
    }

    /// Makes the link whole if its cut is over.
    pub(super) fn heal_if_due(&mut self) {
        if self.heals.is_some_and(|at| at <= Instant::now()) {
            self.heal();
        }
    }

    /// Makes the link whole.
    pub(super) fn heal(&mut self) {
        self.order("heal");
        self.heals = None;
    }

    /// Whether it is cut until a certain time.
    pub(super) fn is_cut(&self) -> bool {
        self.heals.is_some()
    }

    /// Gives the proxy an order, which it has carried out when it prints the shape of its link.
    fn order(&mut self, order: &str) {
        writeln!(self.proxy.stdin.as_mut().unwrap(), "{order}").unwrap();
        let mut shape = String::new();
        self.output.read_line(&mut shape).unwrap();
        assert!(shape.ends_with('\n'), "{order}: the proxy has ended");
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.proxy.kill().unwrap();
        self.proxy.wait().unwrap();
    }
}
