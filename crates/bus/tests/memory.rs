//! The bus inside one process keeps the promises of the real one, and breaks only what it says it breaks.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use bus::{Bus, Declared, Faults, MemoryNetwork};

const PATIENCE: Duration = Duration::from_secs(20);

/// A reliable network in which everything is late.
fn slow(seed: u64) -> MemoryNetwork {
    MemoryNetwork::new(
        seed,
        Faults {
            nap: 0.2,
            longest: Duration::from_millis(1),
            ..Faults::default()
        },
    )
}

fn listen(bus: &Bus, keys: &str) -> (Receiver<String>, Declared) {
    let (sender, messages) = channel();
    let declared = bus.subscribe(keys, move |key, bytes| {
        let _ = sender.send(format!("{key} {}", String::from_utf8_lossy(bytes)));
    });
    (messages, declared.unwrap())
}

fn tokens(bus: &Bus, keys: &str) -> (Receiver<(String, bool)>, Declared) {
    let (sender, seen) = channel();
    let declared = bus.liveliness(keys, move |key, is_there| {
        drop(sender.send((key.to_owned(), is_there)));
    });
    (seen, declared.unwrap())
}

#[test]
fn a_link_keeps_its_order_and_a_token_comes_after_what_was_declared_before() {
    for seed in 0..20 {
        let network = slow(seed);
        let (a, b) = (network.client(), network.client());
        let (seen, _watch) = tokens(&b, "alive/*");
        let (messages, _subscription) = listen(&a, "to/*/a");
        let _token = a.token("alive/a").unwrap();
        assert_eq!(
            seen.recv_timeout(PATIENCE),
            Ok(("alive/a".to_owned(), true))
        );
        for n in 0..20 {
            b.put(&format!("to/{n}/a"), n.to_string().into_bytes())
                .unwrap();
            b.put(&format!("to/{n}/b"), b"not for a".to_vec()).unwrap();
        }
        for n in 0..20 {
            assert_eq!(messages.recv_timeout(PATIENCE), Ok(format!("to/{n}/a {n}")));
        }
    }
}

#[test]
fn the_seed_chooses_the_order_between_links() {
    let order = |seed| {
        let network = MemoryNetwork::new(
            seed,
            Faults {
                pause: Duration::from_millis(2),
                ..Faults::default()
            },
        );
        let (a, b, to) = (network.client(), network.client(), network.router());
        let (messages, _subscription) = listen(&to, "from/*");
        let (seen, _watch) = tokens(&a, "there");
        let _token = to.token("there").unwrap();
        seen.recv_timeout(PATIENCE).unwrap();
        for n in 0..8_u8 {
            a.put("from/a", vec![b'0' + n]).unwrap();
            b.put("from/b", vec![b'0' + n]).unwrap();
        }
        (0..16)
            .map(|_| messages.recv_timeout(PATIENCE).unwrap())
            .collect::<Vec<_>>()
    };
    assert!((1..10).any(|seed| order(seed) != order(0)));
}

#[test]
fn a_question_has_one_answer_or_ends() {
    let network = slow(1);
    let (a, b) = (network.client(), network.client());
    assert!(
        a.get("where/b", "", None).unwrap().is_none(),
        "nobody serves it"
    );
    let served = b.queryable("where/*", |query| match query.parameter("tick") {
        Some("1") => query.reply(query.key(), query.body()),
        Some(_) => query.reply_err("another tick"),
        None => drop(query),
    });
    let (seen, _watch) = tokens(&a, "alive/b");
    let token = b.token("alive/b").unwrap();
    seen.recv_timeout(PATIENCE).unwrap();
    let answer = a
        .get("where/b", "tick=1;epoch=2", Some(b"here".to_vec()))
        .unwrap()
        .unwrap();
    assert_eq!(
        (answer.key.as_str(), answer.result),
        ("where/b", Ok(b"here".to_vec()))
    );
    let answer = a.get("where/b", "epoch=2;tick=2", None).unwrap().unwrap();
    assert_eq!(answer.result, Err("another tick".to_owned()));
    assert!(
        a.get("where/b", "", None).unwrap().is_none(),
        "dropped unanswered"
    );
    drop((served, token));
    assert_eq!(
        seen.recv_timeout(PATIENCE),
        Ok(("alive/b".to_owned(), false))
    );
    assert!(
        a.get("where/b", "tick=1", None).unwrap().is_none(),
        "nobody serves it any more"
    );
}

#[test]
fn a_publisher_knows_whether_it_is_watched() {
    let network = slow(2);
    let (a, b) = (network.client(), network.client());
    let publisher = a.publisher("state").unwrap();
    let (seen, _watch) = tokens(&a, "alive/b");
    let (_messages, subscription) = listen(&b, "state");
    let token = b.token("alive/b").unwrap();
    seen.recv_timeout(PATIENCE).unwrap();
    assert!(publisher.has_subscribers());
    drop((subscription, token));
    seen.recv_timeout(PATIENCE).unwrap();
    assert!(!publisher.has_subscribers());
}

#[test]
fn a_link_that_breaks_takes_its_tokens_and_brings_everything_back() {
    // The links break again and again; what is put until it arrives arrives.
    let faults = Faults {
        cut: 0.05,
        longest: Duration::from_millis(1),
        ..Faults::default()
    };
    let network = MemoryNetwork::new(3, faults);
    let (router, client) = (network.router(), network.client());
    let (messages, _subscription) = listen(&client, "to/client");
    let (seen, _watch) = tokens(&router, "alive/*");
    let _token = client.token("alive/client").unwrap();
    let mut gone = 0;
    for n in 0..200 {
        let expected = format!("to/client {n}");
        let arrives = || {
            router.put("to/client", n.to_string().into_bytes()).unwrap();
            messages
                .recv_timeout(Duration::from_millis(5))
                .is_ok_and(|message| message == expected)
        };
        assert!((0..1000).any(|_| arrives()), "{n} never arrives");
        gone += seen.try_iter().filter(|(_, is_there)| !is_there).count();
    }
    let traffic = network.traffic();
    assert!(
        traffic.cuts > 0 && traffic.lost > 0 && gone > 0,
        "{gone} {traffic:?}"
    );
}

#[test]
fn a_session_that_is_closed_or_killed_says_no_more() {
    let network = slow(4);
    let (a, b, c) = (network.client(), network.client(), network.client());
    let (seen, _watch) = tokens(&c, "alive/*");
    let _tokens = (a.token("alive/a").unwrap(), b.token("alive/b").unwrap());
    let mut there: Vec<_> = (0..2)
        .map(|_| seen.recv_timeout(PATIENCE).unwrap())
        .collect();
    there.sort();
    assert_eq!(
        there,
        [("alive/a".to_owned(), true), ("alive/b".to_owned(), true)]
    );
    a.close();
    network.kill(&b);
    let mut gone: Vec<_> = (0..2)
        .map(|_| seen.recv_timeout(PATIENCE).unwrap())
        .collect();
    gone.sort();
    assert_eq!(
        gone,
        [("alive/a".to_owned(), false), ("alive/b".to_owned(), false)]
    );
    for bus in [a, b] {
        let error = bus.put("x", Vec::new()).unwrap_err().to_string();
        assert!(error.contains("the session is closed"), "{error}");
    }
    assert!(
        c.subscribe("a/**", |_, _| {})
            .unwrap_err()
            .to_string()
            .contains("`*` for a whole one")
    );
}
