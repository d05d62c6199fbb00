//! A secured run and intruders: what is refused, what is harmless, and that the record does not change.

use std::fs::Permissions;
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bus::{Bus, Declared, Reply, Role};
use protocol::keys::{Keys, STATE};
use protocol::messages::{Clock, Control, ControlAnswer, Status};
use protocol::{PROTOCOL_VERSION, RobotName, RunName, decode, encode};
use serde_json::json;
use system_tests::processes::Running;
use system_tests::{Lab, PATIENCE, assert_same, eventually, free_port, programs};

/// A message that is not valid JSON.
const RUBBISH: &[u8] = b"rubbish";
const HALL: &str = "launch/hors_doeuvres.toml";

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

/// Certificates for the hall, made by the command that users type.
fn certificates(lab: &Lab, folder: &str) -> PathBuf {
    let folder = lab.out().join(folder);
    let (code, text) = lab.cars_without_out(&[
        "secure",
        "init",
        &folder.display().to_string(),
        "--robots",
        "Butler,Leguin,Vonda",
    ]);

    assert_eq!(code, 0, "{text}");

    folder
}

fn config(folder: &Path, participant: &str) -> PathBuf {
    folder.join(participant).join("zenoh.json5")
}

/// A printed error without its line breaks and its frame.
fn flat(text: &str) -> String {
    text.split_whitespace()
        .filter(|word| *word != "│")
        .collect::<Vec<_>>()
        .join(" ")
}

/// Opens a session that may be refused.
fn open(endpoint: &str, config: Option<&PathBuf>) -> Result<Bus, String> {
    open_within(Duration::from_millis(500), endpoint, config)
}

fn open_within(
    patience: Duration,
    endpoint: &str,
    config: Option<&PathBuf>,
) -> Result<Bus, String> {
    let role = Role::Client {
        connect: endpoint.to_owned(),
        patience,
    };
    Bus::open(&role, config).map_err(|error| error.to_string())
}

/// Sends a query without a body that is answered.
fn get(bus: &Bus, key: &str) -> Reply {
    let reply = bus.get_within(key, "", None, PATIENCE).unwrap();
    reply.unwrap_or_else(|| panic!("{key} is not answered"))
}

/// The hall, launched with certificates and stepped by hand.
struct Castle {
    lab: Lab,
    launch: Running,
    folder: PathBuf,
    endpoint: String,
    run: RunName,
    keys: Keys,
    operator: Bus,
}

impl Castle {
    fn new(run: &str) -> Self {
        let lab = Lab::new();
        let folder = certificates(&lab, "certificates");
        let secure = folder.display().to_string();
        let launch = lab.start(
            run,
            &[
                "launch",
                HALL,
                "--secure",
                &secure,
                "--paused",
                "--no-console",
                "--speed",
                "max",
                "--duration",
                "60 s",
            ],
        );
        let endpoint = eventually("the endpoint", || {
            std::fs::read_to_string(lab.file(run, "endpoint"))
                .ok()
                .map(|text| text.trim().to_owned())
        });

        assert!(endpoint.starts_with("tls/127.0.0.1:"), "{endpoint}");

        let certificate = config(&folder, "operator");
        let operator = open_within(PATIENCE, &endpoint, Some(&certificate)).unwrap();
        let run = RunName::new(run).unwrap();
        let keys = Keys::new(&run);
        let castle = Self {
            lab,
            launch,
            folder,
            endpoint,
            run,
            keys,
            operator,
        };

        eventually("tick 0", || {
            (castle.status().phase == protocol::messages::Phase::Ready).then_some(())
        });

        castle
    }

    /// A further session with a participant's certificate: a stolen key, or a robot that misbehaves.
    fn enter(&self, participant: &str) -> Bus {
        let certificate = config(&self.folder, participant);
        open_within(PATIENCE, &self.endpoint, Some(&certificate)).unwrap()
    }

    fn control(&self, control: &Control) -> Status {
        self.try_control(control).expect("an operator is answered")
    }

    /// The status after a request; `None` without a reply.
    fn try_control(&self, control: &Control) -> Option<Status> {
        let answer = self
            .operator
            .get_within(&self.keys.control(), "", Some(encode(control)), PATIENCE)
            .unwrap();
        let bytes = answer?.result.unwrap();
        match decode("control", "simulator", &bytes).unwrap() {
            ControlAnswer::Done(status) => Some(*status),
            other => panic!("{other:?}"),
        }
    }

    /// There is no reply while a link that a stall of the machine has broken is opened anew.
    fn status(&self) -> Status {
        eventually("the status", || self.try_control(&Control::Status))
    }

    /// Steps from tick 0 to this one, which is complete then.
    fn step(&self, last: u64) {
        let run = self.run.as_str();
        assert_eq!(self.lab.step(run, last), last);
    }

    /// How many messages the simulator has counted and ignored, once they are `expected`.
    fn ignored(&self, reason: &str, expected: u64) -> Status {
        eventually(reason, || {
            let status = self.status();
            let count = status.ignored.get(reason).copied().unwrap_or_default();
            assert!(count <= expected, "{count} messages were ignored: {reason}");
            (count == expected).then_some(status)
        })
    }

    /// Plays the rest, and compares the record with that of an undisturbed run.
    fn finish_unharmed(mut self) {
        self.control(&Control::Start);
        self.launch.finish();
        let undisturbed = self
            .lab
            .ok(&["run", HALL, "--duration", "60 s", "--run", "undisturbed"]);
        assert!(!undisturbed.is_empty());

        let run = self.run.as_str();
        assert_same(
            ("secured", &self.lab.bytes(run)),
            ("undisturbed", &self.lab.bytes("undisturbed")),
        );
    }
}

/// The keys of the messages that subscribers receive, in order.
#[derive(Clone, Default)]
struct Received(Arc<Mutex<Vec<String>>>);

impl Received {
    fn on(&self, bus: &Bus, keys: &str) -> Declared {
        let received = self.0.clone();
        bus.subscribe(keys, move |key, _| {
            received.lock().expect("no panic").push(key.to_owned());
        })
        .unwrap()
    }

    fn keys(&self) -> Vec<String> {
        self.0.lock().expect("no panic").clone()
    }
}

#[test]
fn a_secured_launch_gives_the_same_record_and_its_owner_controls_it() {
    let castle = Castle::new("secure-same");
    let lab = &castle.lab;

    // Its owner names the run only: the address and the certificate are in the run's folder.
    assert_eq!(lab.step("secure-same", 30), 30);
    assert!(
        lab.ok(&["ctl", "status", "--run", "secure-same"])
            .contains("tick 30")
    );
    assert_eq!(
        lab.ok(&[
            "ctl",
            "query",
            "Leguin",
            "behavior_state",
            "--run",
            "secure-same"
        ])
        .trim(),
        "WAIT"
    );

    // The address alone does not suffice, and the error names what is missing.
    let (_, text) = lab.fails(&[
        "ctl",
        "stop",
        "--run",
        "secure-same",
        "--connect",
        &castle.endpoint,
    ]);
    assert!(flat(&text).contains("wants a certificate"), "{text}");

    // A robot's certificate does not permit control.
    let leguin = config(&castle.folder, "Leguin").display().to_string();
    lab.fails(&[
        "ctl",
        "stop",
        "--run",
        "secure-same",
        "--zenoh-config",
        &leguin,
    ]);

    let folder = castle.launch.folder.clone();
    castle.finish_unharmed();

    for file in ["endpoint", "operator_config"] {
        assert!(
            !folder.join(file).exists(),
            "{file} of the run is still there"
        );
    }
}

#[test]
fn no_session_opens_without_a_certificate_of_this_authority() {
    let castle = Castle::new("secure-door");
    let others = certificates(&castle.lab, "others");
    let plain = castle.endpoint.replace("tls/", "tcp/");
    let no_certificate = castle.lab.write(
        "none.json5",
        "{transport: {link: {tls: {verify_name_on_connect: false}}}}",
    );
    let anonymous = castle.lab.write(
        "anonymous.json5",
        // It accepts the simulator's certificate, and has none itself.
        &std::fs::read_to_string(config(&castle.folder, "Butler"))
            .unwrap()
            .replace("enable_mtls: true", "enable_mtls: false"),
    );

    for (endpoint, config) in [
        (&castle.endpoint, None),
        (&castle.endpoint, Some(no_certificate)),
        (&castle.endpoint, Some(anonymous)),
        (&castle.endpoint, Some(config(&others, "Butler"))),
        (&castle.endpoint, Some(config(&others, "operator"))),
        (&plain, None),
    ] {
        let opened = open(endpoint, config.as_ref());
        assert!(
            opened.is_err(),
            "{endpoint} accepted a session with {config:?}"
        );
    }

    castle.finish_unharmed();
}

#[test]
fn no_robot_passes_for_the_simulator() {
    let lab = Lab::new();
    let folder = certificates(&lab, "certificates");

    // Leguin's certificate, where the simulator's should be.
    let own = std::fs::read_to_string(config(&folder, "Leguin")).unwrap();
    let forged = lab.write("forged.json5", &own.replace("connect_", "listen_"));
    let port = free_port();
    let endpoint = format!("tls/127.0.0.1:{port}");
    let role = Role::Router {
        listen: endpoint.clone(),
        trusts_network: false,
    };
    let _router = Bus::open(&role, Some(&forged)).unwrap();

    let opened = open(&endpoint, Some(&config(&folder, "Butler"))).map(|bus| bus.id());
    assert!(
        opened.is_err(),
        "Butler accepts Leguin as the simulator: {opened:?}"
    );
}

#[test]
fn a_participant_puts_nothing_in_anothers_name() {
    let castle = Castle::new("secure-pose");
    let keys = &castle.keys;
    let butler = name("Butler");
    let leguin = name("Leguin");
    let vonda = name("Vonda");
    let thief = castle.enter("Leguin");
    let operator = castle.enter("operator");

    // Witnesses, each with subscribers that its certificate permits.
    let received = Received::default();
    let witness = castle.enter("Butler");
    let _at_butler = received.on(&witness, &keys.news(&butler));
    let at_operator = [
        keys.clock(),
        keys.query(&butler, "panel"),
        keys.query(&leguin, "panel"),
        keys.query(&butler, STATE),
    ]
    .map(|key| received.on(&castle.operator, &key));
    // A reply on the same link follows what was declared before: from here on the subscribers are in effect.
    get(&witness, &keys.query(&leguin, STATE));
    castle.status();

    let clock = Clock {
        epoch: 1,
        tick: 99_999,
        ..Clock::default()
    };
    for (key, message) in [
        (keys.clock(), encode(&clock)),
        (keys.report(&butler), RUBBISH.to_vec()),
        (keys.waiting(&butler), RUBBISH.to_vec()),
        (keys.report(&vonda), RUBBISH.to_vec()),
        (
            "cars/secure-pose/robot/*/report".to_owned(),
            RUBBISH.to_vec(),
        ),
        ("cars/secure-pose/**".to_owned(), RUBBISH.to_vec()),
        (keys.query(&butler, STATE), RUBBISH.to_vec()),
        (keys.panel(&butler), RUBBISH.to_vec()),
        (keys.news(&butler), RUBBISH.to_vec()),
        (keys.news(&leguin), RUBBISH.to_vec()),
        (keys.world(), RUBBISH.to_vec()),
        (keys.log(), RUBBISH.to_vec()),
        (keys.command(&butler, &vonda), RUBBISH.to_vec()),
        (keys.command(&leguin, &butler), RUBBISH.to_vec()),
        (keys.outbox(&butler), RUBBISH.to_vec()),
        (keys.outbox(&vonda), RUBBISH.to_vec()),
        (keys.outbox(&RobotName::operator()), RUBBISH.to_vec()),
    ] {
        for intruder in [&thief, &operator] {
            intruder.put(&key, message.clone()).unwrap();
        }
    }
    for message in [RUBBISH.to_vec(), br#"{"command":"refill"}"#.to_vec()] {
        let as_operator = keys.command(&leguin, &RobotName::operator());
        thief.put(&as_operator, message).unwrap();
    }
    operator
        .put(&keys.command(&butler, &leguin), RUBBISH.to_vec())
        .unwrap();
    let forged_tokens =
        [&butler, &vonda].map(|robot| thief.token(&keys.alive_robot(robot)).unwrap());
    drop(forged_tokens);

    // What they may put arrives, after all that they may not.
    thief.put(&keys.report(&leguin), RUBBISH.to_vec()).unwrap();
    thief.put(&keys.panel(&leguin), RUBBISH.to_vec()).unwrap();
    thief
        .put(&keys.command(&butler, &leguin), RUBBISH.to_vec())
        .unwrap();
    thief.put(&keys.outbox(&leguin), RUBBISH.to_vec()).unwrap();
    operator
        .put(
            &keys.command(&leguin, &RobotName::operator()),
            RUBBISH.to_vec(),
        )
        .unwrap();

    let status = castle.ignored("malformed", 5);
    assert_eq!(status.ignored.len(), 1, "{:?}", status.ignored);
    let expected = keys.query(&leguin, "panel");
    eventually("what is allowed", || {
        received.keys().contains(&expected).then_some(())
    });
    let unexpected: Vec<String> = received
        .keys()
        .into_iter()
        .filter(|key| *key != expected)
        .collect();
    assert!(unexpected.is_empty(), "forged: {unexpected:?}");

    drop(at_operator);
    castle.finish_unharmed();
}

/// A request to join as this robot.
fn request_to_join(run: &str, robot: &str) -> Vec<u8> {
    let request = json!({
        "protocol": PROTOCOL_VERSION,
        "run": run,
        "name": robot,
        "instance": "intruder",
    });

    request.to_string().into_bytes()
}

#[test]
fn a_robot_neither_queries_nor_receives_nor_replies_what_is_not_its_own() {
    let castle = Castle::new("secure-ask");
    let keys = &castle.keys;
    let butler = name("Butler");
    let leguin = name("Leguin");
    let thief = castle.enter("Leguin");

    let as_butler = request_to_join(castle.run.as_str(), "Butler");
    for (key, body) in [
        (keys.control(), encode(&Control::Stop)),
        (keys.join(), as_butler.clone()),
        (keys.join_as(&butler), as_butler.clone()),
        (keys.all(), Vec::new()),
    ] {
        let reply = thief
            .get_within(&key, "", Some(body), Duration::from_millis(300))
            .unwrap();
        assert!(reply.is_none(), "{key}: {reply:?}");
    }

    // Under its own key, in another robot's name: access control lets it pass, and the simulator refuses it.
    let reply = thief.get_within(&keys.join_as(&leguin), "", Some(as_butler), PATIENCE);
    let answer = reply.unwrap().unwrap().result.unwrap();
    assert!(
        String::from_utf8_lossy(&answer).contains("Leguin cannot join as Butler"),
        "{answer:?}"
    );
    get(&thief, &keys.query(&butler, STATE));

    // It subscribes to what is not its own.
    let secrets = Received::default();
    let listening = [
        keys.all(),
        keys.reports(),
        keys.commands(),
        keys.outboxes(),
        keys.outbox(&butler),
        keys.command(&leguin, &butler),
        keys.news(&butler),
        "cars/secure-ask/robot/*/news".to_owned(),
        "**".to_owned(),
        "cars/*/robot/Butler/**".to_owned(),
        keys.world(),
        keys.log(),
    ]
    .map(|key| secrets.on(&thief, &key));
    // What a session receives, all its subscribers receive that match: so this is another session.
    let listener = castle.enter("Leguin");
    let clocks = Received::default();
    let own_news = Received::default();
    let _clock = clocks.on(&listener, &keys.clock());
    let _news = own_news.on(&listener, &keys.news(&leguin));

    // It declares queryables of others.
    let queries = Arc::new(AtomicUsize::new(0));
    let queryables = [keys.query(&butler, STATE), keys.control(), keys.joins()].map(|key| {
        let queries = queries.clone();
        thief
            .queryable(&key, move |_| {
                queries.fetch_add(1, Ordering::Relaxed);
            })
            .unwrap()
    });
    get(&listener, &keys.query(&butler, STATE));

    castle.step(80);
    eventually("clocks", || (clocks.keys().len() >= 80).then_some(()));
    assert!(!own_news.keys().is_empty(), "it gets its own news");
    let state = get(&castle.operator, &keys.query(&butler, STATE));
    let state = state.result.unwrap();
    assert!(String::from_utf8_lossy(&state).contains("\"tick\":80"));
    assert_eq!(secrets.keys(), Vec::<String>::new());
    assert_eq!(queries.load(Ordering::Relaxed), 0);

    drop(listening);
    drop(queryables);
    castle.finish_unharmed();
}

/// Also under the names of other runs, which a certificate admits for its own robot.
#[test]
fn declarations_in_anothers_name_are_refused() {
    const EACH: usize = 300;

    let castle = Castle::new("secure-declare");
    let butler = name("Butler");
    let vonda = name("Vonda");
    let other = |i: usize| Keys::new(&RunName::new(&format!("other-{i}")).unwrap());
    let tokens = Received::default();
    let seen = tokens.0.clone();
    let watching = castle
        .operator
        .liveliness("cars/*/alive/**", move |key, _| {
            seen.lock().expect("no panic").push(key.to_owned());
        });
    let watching = watching.unwrap();
    let forbidden = other(0).command(&butler, &RobotName::operator());
    let forbidden = castle.operator.watched_publisher(&forbidden).unwrap();
    let allowed = other(0).query(&butler, STATE);
    let allowed = castle.operator.watched_publisher(&allowed).unwrap();

    let thief = castle.enter("Vonda");
    let mut declared = Vec::new();
    for i in 0..EACH {
        let keys = other(i);
        let commands = keys.command(&butler, &RobotName::operator());
        declared.push(thief.token(&keys.alive_robot(&butler)).unwrap());
        declared.push(thief.subscribe(&commands, |_, _| {}).unwrap());
        let state = keys.query(&butler, STATE);
        declared.push(
            thief
                .queryable(&state, |query| {
                    query.reply(query.key(), RUBBISH.to_vec());
                })
                .unwrap(),
        );
    }
    // What is handled after all of that.
    let states = "cars/other-0/robot/*/state";
    declared.push(thief.subscribe(states, |_, _| {}).unwrap());
    let own = other(0).alive_robot(&vonda);
    declared.push(thief.token(&own).unwrap());

    eventually("its own token", || {
        tokens.keys().contains(&own).then_some(())
    });
    eventually("its own subscriber", || {
        allowed.has_subscribers().then_some(())
    });
    let mut strange = tokens.keys();
    strange.retain(|key| key.starts_with("cars/other"));
    assert_eq!(strange, [own]);
    assert!(!forbidden.has_subscribers());
    let state = other(0).query(&butler, STATE);
    let reply = castle.operator.get_within(&state, "", None, PATIENCE);
    assert!(reply.unwrap().is_none(), "it replies as Butler");

    castle.step(60);
    drop(declared);
    drop(watching);
    thief.close();
    castle.finish_unharmed();
}

#[test]
fn a_flood_on_a_robots_own_keys_is_counted_and_changes_nothing() {
    const FLOOD: u64 = 100_000;

    let castle = Castle::new("secure-flood");
    let keys = castle.keys.clone();
    let thief = castle.enter("Leguin");
    let begun = Instant::now();
    let flooding = std::thread::spawn(move || {
        let key = keys.report(&name("Leguin"));
        (0..FLOOD).for_each(|_| thief.put(&key, b"{}".to_vec()).unwrap());
        thief.close();
    });
    let stepped = castle.control(&Control::Step { n: 60 });
    assert!(stepped.tick <= 60, "{stepped:?}");

    flooding.join().unwrap();

    // If the simulator does not keep up, the flooding session loses its connection and some of its messages.
    let counted = eventually("the count", || {
        let ignored = castle.status().ignored;
        assert!(
            ignored.keys().all(|reason| reason == "malformed"),
            "{ignored:?}"
        );
        ignored
            .get("malformed")
            .copied()
            .filter(|count| *count >= FLOOD / 10)
    });

    assert!(counted <= FLOOD);

    println!(
        "{counted} of {FLOOD} messages counted after {:.1} s",
        begun.elapsed().as_secs_f64()
    );
    castle.finish_unharmed();
}

#[test]
fn large_queries_do_not_close_the_link_of_the_robot_that_gets_them() {
    let castle = Castle::new("secure-large");
    let keys = castle.keys.clone();
    let intruder = castle.enter("Vonda");
    let sending = std::thread::spawn(move || {
        let key = keys.query(&name("Leguin"), STATE);
        for bytes in [150_000, 300_000, 1_000_000, 1_000_000, 1_000_000] {
            let answer = intruder.get_within(&key, "", Some(vec![b'x'; bytes]), PATIENCE);
            let is_answered = answer.unwrap().is_some();
            assert!(is_answered, "a query of {bytes} bytes is not answered");
        }
    });

    let stepped = castle.control(&Control::Step { n: 60 });

    assert_eq!(stepped.tick, 60);
    sending.join().unwrap();
    castle.finish_unharmed();
}

/// A participant's configuration with a session id of its own choice.
fn config_with_id(castle: &Castle, participant: &str, id: &str) -> PathBuf {
    let text = std::fs::read_to_string(config(&castle.folder, participant)).unwrap();
    let with_id = text.replacen("\n{", &format!("\n{{\n  id: {id:?},"), 1);
    assert_ne!(with_id, text, "the configuration begins otherwise");

    castle
        .lab
        .write(&format!("{participant}-{id}.json5"), &with_id)
}

#[test]
fn a_session_id_belongs_to_the_certificate_that_used_it_first() {
    const ID: &str = "5ca1ab1e5ca1ab1e5ca1ab1e5ca1ab1e";

    let castle = Castle::new("secure-id");
    let own = config_with_id(&castle, "Leguin", ID);
    let stolen = config_with_id(&castle, "Vonda", ID);
    let owner = open_within(PATIENCE, &castle.endpoint, Some(&own)).unwrap();
    assert_eq!(owner.id(), ID);

    // Whether the owner is connected or not: as after a broken link.
    assert!(open(&castle.endpoint, Some(&stolen)).is_err());
    owner.close();
    let entered = open(&castle.endpoint, Some(&stolen));
    assert!(entered.is_err(), "{entered:?}");

    let back = eventually("the owner to be back", || {
        open(&castle.endpoint, Some(&own)).ok()
    });
    assert_eq!(back.id(), ID);
    back.close();
    let other = castle.enter("Vonda");
    other.close();
    castle.step(60);
    castle.finish_unharmed();
}

#[test]
fn certificates_of_another_run_are_refused_before_a_process_starts() {
    let lab = Lab::new();
    let folder = lab.out().join("certificates").display().to_string();
    let robots = ["--robots", "Butler,Leguin,Vonda", "--run", "monday"];
    let (code, text) =
        lab.cars_without_out(&[&["secure", "init", &folder][..], &robots[..]].concat());
    assert_eq!(code, 0, "{text}");

    let launch = |run: &str| {
        let brief = ["--secure", &folder, "--no-console", "--duration", "1 s"];
        lab.cars(&["launch", HALL, "--run", run])
            .args(brief)
            .output()
            .unwrap()
    };
    let refused = launch("tuesday");
    let text = flat(&String::from_utf8_lossy(&refused.stderr));
    assert!(!refused.status.success(), "{text}");
    assert!(
        text.contains("for run monday, and this is run tuesday"),
        "{text}"
    );
    assert!(!lab.file("tuesday", "events.jsonl").exists(), "{text}");
    let admitted = launch("monday");
    assert!(admitted.status.success(), "{admitted:?}");
}

#[test]
fn a_key_that_others_can_read_is_named() {
    let lab = Lab::new();
    let folder = certificates(&lab, "certificates");
    let launch = |run: &str| {
        let mut command = lab.cars(&["launch", HALL, "--no-console", "--duration", "1 s"]);
        command.arg("--secure").arg(&folder).args(["--run", run]);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{output:?}");
        flat(&String::from_utf8_lossy(&output.stderr))
    };
    let warning = "others than its owner can read it (mode 644)";
    let text = launch("closed");
    assert!(!text.contains("others than its owner"), "{text}");

    let key = folder.join("simulator/key.pem");
    std::fs::set_permissions(&key, Permissions::from_mode(0o644)).unwrap();
    let text = launch("open");
    assert!(
        text.contains(warning) && text.contains("chmod 600"),
        "{text}"
    );
    assert!(text.contains("simulator/key.pem"), "{text}");
}

/// The published TLS link corrupts memory when two threads use it: 2 of 8 runs ended so.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn threads_of_the_middleware_are_safe_under_tls() {
    let lab = Lab::new();
    let folder = certificates(&lab, "certificates").display().to_string();
    let args = [
        "launch",
        HALL,
        "--secure",
        &folder,
        "--no-console",
        "--speed",
        "max",
    ];
    let duration = ["--duration", "1000 s"];
    lab.ok(&["run", HALL, "--run", "plain", duration[0], duration[1]]);

    for threads in [
        "(rx:(worker_threads:2),tx:(worker_threads:2))",
        "(app:(worker_threads:4))",
    ] {
        for repetition in 0..4 {
            let run = format!("threads-{}-{repetition}", threads.len());
            let mut command = lab.cars(&args);
            command.args(duration).args(["--run", &run]);
            command.env("ZENOH_RUNTIME", threads);
            let output = command.output().unwrap();
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.success(), "{threads}: {text}");
            assert_same(("plain", &lab.bytes("plain")), (&run, &lab.bytes(&run)));
        }
    }
}

#[test]
fn silent_connections_keep_no_robot_out() {
    const SILENT: usize = 150;

    let lab = Lab::new();
    let folder = certificates(&lab, "certificates");
    let root = system_tests::root();
    let text = format!(
        "scenario = {:?}\nsecure = \"certificates\"\nspeed = \"max\"\n\
         [console]\nenabled = false\n\
         [[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n\
         [[process]]\nname = \"Leguin\"\ncommand = [\"cars-leguin\"]\nextern = true\n",
        root.join("configs/hors_doeuvres.toml")
    );
    let file = lab.write("hall.toml", &text).display().to_string();
    let run = "secure-silent";
    let mut launch = lab.start(run, &["launch", &file, "--duration", "60 s"]);
    let endpoint = eventually("the endpoint", || {
        std::fs::read_to_string(lab.file(run, "endpoint"))
            .ok()
            .map(|text| text.trim().to_owned())
    });
    let address = endpoint.trim_start_matches("tls/");
    let silent: Vec<TcpStream> = (0..SILENT)
        .map(|_| TcpStream::connect(address).unwrap())
        .collect();

    // At the worst moment: now all of them are being given up.
    std::thread::sleep(Duration::from_millis(2050));
    let begun = Instant::now();
    let mut leguin = Command::new(programs().join("cars-leguin"));
    leguin
        .args(["--run", run, "--connect", &endpoint])
        .env("CARS_ZENOH_CONFIG", config(&folder, "Leguin"));
    let mut leguin = Running::start(leguin, run, lab.out().join(run));
    let took = launch
        .prints("Leguin       takes part")
        .duration_since(begun);
    println!(
        "with {SILENT} silent connections Leguin took part after {:.2} s",
        took.as_secs_f64()
    );
    assert!(took < Duration::from_secs(10), "it took {took:?} to join");

    leguin.finish();
    launch.finish();
    drop(silent);
    lab.ok(&["run", HALL, "--duration", "60 s", "--run", "undisturbed"]);
    assert_same(
        ("secured", &lab.bytes(run)),
        ("undisturbed", &lab.bytes("undisturbed")),
    );
}

#[test]
fn nothing_listens_for_strangers_unless_that_is_said() {
    let lab = Lab::new();
    let port = free_port();
    let listen = format!("--listen=tcp/0.0.0.0:{port}");
    let args = [
        "launch",
        HALL,
        "--speed",
        "max",
        "--duration",
        "10 s",
        "--no-console",
        &listen,
        "--run",
        "exposed",
    ];
    let (_, text) = lab.fails(&args);
    for word in ["other machines", "cars secure init", "--insecure"] {
        assert!(flat(&text).contains(word), "{text}");
    }
    assert!(!lab.out().join("exposed").exists());
    let mut simulator = Command::new(programs().join("cars-sim"));
    simulator
        .current_dir(system_tests::root())
        .args(["configs/hors_doeuvres.toml", &listen, "--out"])
        .arg(lab.out());
    let refused = simulator.output().unwrap();
    assert!(!refused.status.success());
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("--insecure"),
        "{refused:?}"
    );
    assert_eq!(std::fs::read_dir(lab.out()).unwrap().count(), 0);

    lab.ok(&[&args[..], &["--insecure"]].concat());
    let folder = certificates(&lab, "certificates").display().to_string();
    let listen = format!("--listen=tls/0.0.0.0:{port}");
    let args = [
        &args[..7],
        &[&listen, "--run", "guarded", "--secure", &folder],
    ]
    .concat();
    lab.ok(&args);
    assert_same(
        ("secured", &lab.bytes("guarded")),
        ("insecure", &lab.bytes("exposed")),
    );
}

#[test]
fn a_launch_that_cannot_be_secured_says_why() {
    let lab = Lab::new();
    let folder = certificates(&lab, "certificates").display().to_string();
    let scenario = system_tests::root().join("configs/hors_doeuvres.toml");
    let together = format!(
        "scenario = {scenario:?}\nsecure = \"certificates\"\n\
         [[process]]\nname = \"both\"\ncommand = [\"cars-butler\"]\nrobots = [\"Butler\", \"Leguin\"]\n"
    );
    let together = lab.write("together.toml", &together).display().to_string();
    let (_, text) = lab.fails(&["launch", &together]);
    assert!(
        flat(&text).contains("several robots in one process")
            && flat(&text).contains("give each one a process"),
        "{text}"
    );

    std::fs::remove_dir_all(Path::new(&folder).join("Leguin")).unwrap();
    let (_, text) = lab.fails(&["launch", HALL, "--secure", &folder]);
    assert!(
        flat(&text).contains("Leguin has no certificate")
            && flat(&text).contains("cars secure init"),
        "{text}"
    );

    let (_, text) = lab.fails(&[
        "launch",
        HALL,
        "--secure",
        &folder.replace("certificates", "nowhere"),
    ]);
    assert!(
        flat(&text).contains("simulator has no certificate"),
        "{text}"
    );
}
