//! Configuration files of the middleware for a secured run: certificates, access control, and the settings that a run
//! has without them. Each file is complete, so that a robot in any language has all that it needs in one.

use std::collections::BTreeMap;
use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::DEFAULT_ENDPOINT;
use crate::endpoint::TLS;
use crate::settings::{CLIENT_MODE, MiddlewareSetting, ROUTER_MODE, SETTINGS};
use protocol::access::{CONSOLE, Grant, of_operator, of_robot};
use protocol::keys::Keys;
use protocol::name::{OPERATOR, RobotName};

/// How a participant shows who it is, as PEM texts.
#[derive(Debug, Clone, Copy)]
pub struct Credentials<'a> {
    /// The certificate of those who issue certificates: what the others show is checked with it.
    pub ca: &'a str,
    /// Its certificate.
    pub certificate: &'a str,
    /// The private key of its certificate.
    pub key: &'a str,
    /// Until when the certificate is valid, in words.
    pub validity: &'a str,
}

/// The file of a robot, an operator or the console, named `name` by its certificate.
#[must_use]
pub fn client_config(name: &str, credentials: &Credentials) -> String {
    let mut text = format!(
        "// The way of {name} into secured runs, for the network library zenoh in any language.\n\
         //\n\
         // It holds a private key: who reads this file can pose as {name}. It needs no other file and may be moved to\n\
         // the machine where it is used. The certificate is valid until {}.\n\
         //\n\
         // Programs of CARS take it by --zenoh-config or CARS_ZENOH_CONFIG, with --connect tls/HOST:PORT.\n\
         // Elsewhere: let zenoh open this file, and replace the endpoint. A robot asks to join on the key\n\
         // cars/RUN/join/{name}.\n",
        credentials.validity
    );

    let mut tree = Tree::of([CLIENT_MODE].iter().chain(&SETTINGS));
    let endpoints = format!("[{:?}]", tls_endpoint());
    tree.add(
        "connect/endpoints",
        "Where the simulator listens.",
        &endpoints,
    );
    tree.add(
        "connect/timeout_ms",
        "How long to go on trying to reach it, milliseconds.",
        "20000",
    );
    tree.add_tls("connect", credentials);

    tree.write(&mut text);
    text
}

/// The file of the simulator for these robots, in the runs whose keys are `keys`.
#[must_use]
pub fn simulator_config(keys: &Keys, robots: &[RobotName], credentials: &Credentials) -> String {
    let mut text = format!(
        "// The simulator of secured runs: who may connect, and who may say what.\n\
         //\n\
         // It holds a private key: who reads this file can pose as the simulator. The certificate is valid until\n\
         // {}. `cars-sim --zenoh-config FILE --listen tls/127.0.0.1:7447` uses it.\n",
        credentials.validity
    );

    let mut tree = Tree::of([ROUTER_MODE].iter().chain(&SETTINGS));
    let endpoints = format!("[{:?}]", tls_endpoint());
    tree.add("listen/endpoints", "Where it listens.", &endpoints);
    tree.add_tls("listen", credentials);

    let mut grants: Vec<(&str, Vec<Grant>)> = robots
        .iter()
        .map(|robot| (robot.as_str(), of_robot(keys, robot)))
        .collect();
    grants.extend([OPERATOR, CONSOLE].map(|name| (name, of_operator(keys))));

    tree.add("access_control/enabled", "", "true");
    tree.add(
        "access_control/default_permission",
        "What no rule allows is refused.",
        "\"deny\"",
    );
    tree.add(
        "access_control/rules",
        "What may be said, and on which keys.",
        &rules(keys, &grants),
    );

    let subjects = grants
        .iter()
        .map(|(name, _)| format!("{{ id: {name:?}, cert_common_names: [{name:?}] }}"));
    tree.add(
        "access_control/subjects",
        "The certificate states the name of its owner.",
        &list(subjects),
    );

    let policies = grants.iter().map(|(name, grants)| policy(name, grants));
    tree.add(
        "access_control/policies",
        "Who may do what.",
        &list(policies),
    );

    tree.write(&mut text);
    text
}

fn tls_endpoint() -> String {
    DEFAULT_ENDPOINT.replacen("tcp", TLS, 1)
}

/// What the simulator says to those who may connect at all: they get what they could subscribe to or ask for.
const ANSWERS: &str = "the simulator passes on";

fn rules(keys: &Keys, grants: &[(&str, Vec<Grant>)]) -> String {
    let all = "\"put\", \"delete\", \"declare_subscriber\", \"query\", \"reply\", \"declare_queryable\", \
               \"liveliness_token\", \"liveliness_query\", \"declare_liveliness_subscriber\"";
    let outward = format!(
        "{{ id: {ANSWERS:?}, permission: \"allow\", flows: [\"egress\"], messages: [{all}],\n  key_exprs: [{:?}] }}",
        keys.all()
    );
    let inward = grants
        .iter()
        .flat_map(|(name, grants)| grants.iter().map(move |grant| rule(name, grant)));
    list([outward].into_iter().chain(inward))
}

fn rule(name: &str, grant: &Grant) -> String {
    let keys = grant.keys.iter().map(|key| format!("\n    {key:?},"));
    format!(
        "{{ id: {:?}, permission: \"allow\", flows: [\"ingress\"], messages: {:?},\n  key_exprs: [{}\n  ] }}",
        rule_id(name, grant),
        grant.messages,
        keys.collect::<String>()
    )
}

fn rule_id(name: &str, grant: &Grant) -> String {
    format!("{name} {}", grant.purpose)
}

fn policy(name: &str, grants: &[Grant]) -> String {
    let rules = [ANSWERS.to_owned()]
        .into_iter()
        .chain(grants.iter().map(|grant| rule_id(name, grant)));
    format!(
        "{{ subjects: [{name:?}], rules: {:?} }}",
        rules.collect::<Vec<_>>()
    )
}

fn list(items: impl Iterator<Item = String>) -> String {
    let items: String = items.map(|item| format!("\n{item},")).collect();
    format!("[{}\n]", items.replace('\n', "\n  "))
}

/// A configuration, by the paths of its settings. It is written as people would write it: nested, with comments.
#[derive(Default)]
struct Tree {
    branches: BTreeMap<String, Tree>,
    value: Option<String>,
    why: String,
}

impl Tree {
    fn of<'a>(settings: impl Iterator<Item = &'a MiddlewareSetting>) -> Self {
        let mut tree = Self::default();
        settings.for_each(|setting| tree.add(setting.key, setting.why, setting.value));
        tree
    }

    fn add(&mut self, path: &str, why: &str, value: &str) {
        let leaf = path.split('/').fold(self, |tree, step| {
            tree.branches.entry(step.to_owned()).or_default()
        });
        (leaf.value, leaf.why) = (Some(value.to_owned()), why.to_owned());
    }

    /// `side` is `listen` or `connect`.
    fn add_tls(&mut self, side: &str, credentials: &Credentials) {
        let mut add = |key: &str, why: &str, value: &str| {
            self.add(&format!("transport/link/tls/{key}"), why, value);
        };

        add("enable_mtls", "Both sides show a certificate.", "true");
        add(
            "verify_name_on_connect",
            "The simulator's names the host it is reached by.",
            "true",
        );

        for (key, why, pem) in [
            (
                "root_ca_certificate_base64".to_owned(),
                "ca.pem",
                credentials.ca,
            ),
            (
                format!("{side}_certificate_base64"),
                "cert.pem",
                credentials.certificate,
            ),
            (
                format!("{side}_private_key_base64"),
                "key.pem, which is secret",
                credentials.key,
            ),
        ] {
            add(&key, why, &format!("{:?}", STANDARD.encode(pem)));
        }
    }

    fn write(&self, text: &mut String) {
        self.write_at(text, 0);
        text.push('\n');
    }

    fn write_at(&self, text: &mut String, depth: usize) {
        let indent = "  ".repeat(depth);
        if let Some(value) = &self.value {
            *text += &value.replace('\n', &format!("\n{indent}"));
            return;
        }

        text.push_str("{\n");
        for (name, branch) in &self.branches {
            if !branch.why.is_empty() {
                // Writing to a text cannot fail.
                let _infallible = writeln!(text, "{indent}  // {}", branch.why);
            }
            let _infallible = write!(text, "{indent}  {name}: ");
            branch.write_at(text, depth + 1);
            text.push_str(",\n");
        }
        *text += &format!("{indent}}}");
    }
}
