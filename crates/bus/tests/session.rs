//! What everything above the bus relies on, over a router and clients in this process.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Reply, Role};

const PATIENCE: Duration = Duration::from_secs(20);

/// A router and the socket at which it listens.
struct Star {
    router: Bus,
    endpoint: String,
    folder: PathBuf,
}

impl Star {
    fn new(test: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("cars-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let endpoint = format!("unixsock-stream/{}", folder.join("router.sock").display());
        let role = Role::Router {
            listen: endpoint.clone(),
            trusts_network: false,
        };

        Self {
            router: Bus::open(&role, None).unwrap(),
            endpoint,
            folder,
        }
    }

    fn client(&self) -> Bus {
        let role = Role::Client {
            connect: self.endpoint.clone(),
            patience: PATIENCE,
        };

        Bus::open(&role, None).unwrap()
    }
}

impl Drop for Star {
    fn drop(&mut self) {
        let _is_gone = std::fs::remove_dir_all(&self.folder);
    }
}

/// What a subscriber receives: the key, a space, and the message.
fn subscribe(bus: &Bus, keys: &str) -> (Receiver<String>, Declared) {
    let (sender, received) = channel();
    let subscriber = bus.subscribe(keys, move |key, bytes| {
        let _is_over = sender.send(format!("{key} {}", String::from_utf8_lossy(bytes)));
    });

    (received, subscriber.unwrap())
}

/// What a liveliness subscriber receives: a plus or a minus, and the key of the token.
fn tokens(bus: &Bus, keys: &str) -> (Receiver<String>, Declared) {
    let (sender, received) = channel();
    let subscriber = bus.liveliness(keys, move |key, is_declared| {
        let sign = if is_declared { '+' } else { '-' };
        let _is_over = sender.send(format!("{sign}{key}"));
    });

    (received, subscriber.unwrap())
}

fn next(received: &Receiver<String>) -> String {
    received.recv_timeout(PATIENCE).unwrap()
}

#[test]
fn messages_keep_their_order_and_a_token_follows_what_was_declared_before() {
    let star = Star::new("order");
    let a = star.client();
    let b = star.client();
    let (seen, _tokens) = tokens(&b, "alive/*");
    let (received, _subscriber) = subscribe(&a, "to/*/a");
    let _token = a.token("alive/a").unwrap();
    assert_eq!(next(&seen), "+alive/a");

    for n in 0..200 {
        let message = n.to_string().into_bytes();
        b.put(&format!("to/{n}/a"), message).unwrap();
        b.put(&format!("to/{n}/b"), b"not for a".to_vec()).unwrap();
    }
    for n in 0..200 {
        assert_eq!(next(&received), format!("to/{n}/a {n}"));
    }
}

#[test]
fn a_query_has_a_reply_or_ends_without_one() {
    let star = Star::new("query");
    let a = star.client();
    let b = star.client();
    let none = a.get("where/b", "", None).unwrap();
    assert!(none.is_none(), "there is no queryable");

    let queryable = b.queryable("where/*", |query| match query.parameter("tick") {
        Some("1") => query.reply(query.key(), query.body()),
        Some(_) => query.reply_err("another tick"),
        None => drop(query),
    });
    let (seen, _tokens) = tokens(&a, "alive/b");
    let token = b.token("alive/b").unwrap();
    assert_eq!(next(&seen), "+alive/b");

    let here = b"here".to_vec();
    let reply = a.get("where/b", "tick=1;epoch=2", Some(here.clone()));
    let reply = reply.unwrap().unwrap();
    assert_eq!(reply.key, "where/b");
    assert_eq!(reply.result, Ok(here));
    let reply = a.get("where/b", "epoch=2;tick=2", None).unwrap().unwrap();
    assert_eq!(reply.result, Err("another tick".to_owned()));
    let none = a.get("where/b", "", None).unwrap();
    assert!(none.is_none(), "it was dropped without a reply");

    drop(queryable);
    drop(token);
    assert_eq!(next(&seen), "-alive/b");
    let none = a.get("where/b", "tick=1", None).unwrap();
    assert!(none.is_none(), "the queryable is undeclared");
}

/// A simulator puts news and clock again behind a welcome: they have the priority and the congestion control of a usual get, whose
/// reply has both from it.
#[test]
fn what_is_put_after_a_reply_arrives_behind_it() {
    const ROUNDS: usize = 200;
    let star = Star::new("behind");
    let client = star.client();
    let (sender, received) = channel();
    let mut subscribers = Vec::new();
    for key in ["news", "clock"] {
        let sender = sender.clone();
        let subscriber = client.subscribe(key, move |key, _| {
            let _is_over = sender.send(key.to_owned());
        });
        subscribers.push(subscriber.unwrap());
    }
    let (seen, _tokens) = tokens(&star.router, "alive/*");
    let _token = client.token("alive/a").unwrap();
    assert_eq!(next(&seen), "+alive/a");
    let (asked, queries) = channel();
    let _queryable = star.router.queryable("join", move |query| {
        let _is_over = asked.send(query);
    });
    let news = star.router.publisher("news").unwrap();
    let clock = star.router.publisher("clock").unwrap();

    for _ in 0..ROUNDS {
        let sender = sender.clone();
        let then = move |reply: Option<Reply>| {
            let _is_over = sender.send(reply.map_or_else(String::new, |reply| reply.key));
        };
        client.get_then("join", "", then).unwrap();
        let query = queries.recv_timeout(PATIENCE).unwrap();
        query.reply("join", vec![b'w'; 2_000]);
        drop(query);
        news.put(b"news".to_vec()).unwrap();
        clock.put(b"clock".to_vec()).unwrap();

        let arrived = ["join", "news", "clock"].map(|_| next(&received));
        assert_eq!(arrived, ["join", "news", "clock"]);
    }
}

#[test]
fn a_query_with_a_wildcard_is_answered_on_the_key_of_each_queryable() {
    let star = Star::new("wildcard");
    let a = star.client();
    let b = star.client();
    let _queryables = ["where/a", "where/b"].map(|key| {
        b.queryable(key, |query| query.reply(query.key(), Vec::new()))
            .unwrap()
    });
    let (seen, _tokens) = tokens(&a, "alive/b");
    let _token = b.token("alive/b").unwrap();
    assert_eq!(next(&seen), "+alive/b");

    for asked in ["where/*", "*/*", "where/**"] {
        let replies = a.get_all(asked, "", PATIENCE).unwrap();
        let mut keys: Vec<String> = replies.into_iter().map(|reply| reply.key).collect();
        keys.sort();
        assert_eq!(keys, ["where/a", "where/b"], "{asked}");
    }
}

#[test]
fn a_publisher_knows_whether_it_has_subscribers() {
    let star = Star::new("matching");
    let a = star.client();
    let b = star.client();
    let publisher = a.watched_publisher("state").unwrap();
    let (_received, subscriber) = subscribe(&b, "state");

    let begun = Instant::now();
    while !publisher.has_subscribers() {
        assert!(begun.elapsed() < PATIENCE, "the subscriber is not seen");
        std::thread::yield_now();
    }
    drop(subscriber);
    while publisher.has_subscribers() {
        assert!(begun.elapsed() < PATIENCE, "the subscriber is still seen");
        std::thread::yield_now();
    }
}

#[test]
fn a_closed_session_withdraws_its_token_and_puts_no_more() {
    let star = Star::new("closed");
    let a = star.client();
    let b = star.client();
    let (seen, _tokens) = tokens(&b, "alive/*");
    let _token = a.token("alive/a").unwrap();
    assert_eq!(next(&seen), "+alive/a");

    a.close();
    assert_eq!(next(&seen), "-alive/a");
    let error = a.put("x", Vec::new()).unwrap_err();
    assert!(matches!(error, BusError::Use { .. }), "{error}");
}

#[test]
fn an_illegal_key_is_an_error() {
    let star = Star::new("key");
    let error = star.client().subscribe("a//b", |_, _| {}).unwrap_err();
    assert!(error.to_string().contains("a//b"), "{error}");
}
