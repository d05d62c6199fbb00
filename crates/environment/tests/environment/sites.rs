//! Sites: what robots sense of them, what they do to them, and in which order.

use std::collections::BTreeMap;

use environment::sites::{SiteOrders, Sites};
use environment::{Event, Simulation};
use lockstep::IncarnationNotice;
use proptest::prelude::*;
use protocol::messages::{
    KnownSite, MAX_SITE_TEXT_BYTES, MAX_SITES_BYTES, Point, Report, SiteAction, SiteRefusal,
    StateVariables, Variable,
};
use protocol::{RobotName, RunName};

use crate::actors::Actors;
use crate::common::{name, scenario};

/// Two robots within 1 m of a task at 2 m, 2 m, one that is not, and a site far away.
const FILE: &str = r#"
duration = "10 s"
[[robot]]
name = "A"
at = ["1.4 m", "2 m"]
[[robot]]
name = "B"
at = ["2.8 m", "2 m"]
[[robot]]
name = "C"
at = ["5 m", "5 m"]
[[site]]
name = "T"
kind = "task"
at = ["2 m", "2 m"]
range = "1 m"
state = { stock = { start = 2, min = 0, max = 3 }, done = false, owner = "" }
[[site]]
name = "U"
at = ["2 m", "2 m"]
range = "1 m"
on_conflict = "refuse"
state = { stock = { start = 2, min = 0 }, done = false }
"#;

/// What a robot does, as it stands within range of T and U.
type Orders = Vec<(RobotName, Vec<SiteAction>)>;

fn carry_out(sites: &mut Sites, orders: &Orders) -> Vec<Event> {
    let mut given = Vec::new();
    for (robot, actions) in orders {
        given.push(SiteOrders {
            robot,
            at: Point::new(2.0, 2.5),
            actions,
        });
    }
    sites.carry_out(&given)
}

/// What became of the actions of one robot, in their order.
fn refusals(actions: &[SiteAction]) -> Vec<Option<SiteRefusal>> {
    let mut sites = Sites::new(&scenario(FILE));
    carry_out(&mut sites, &vec![(name("A"), actions.to_vec())]);
    let results = sites.results(&name("A")).iter();
    results.map(|result| result.refused).collect()
}

#[test]
fn each_action_sees_what_the_one_before_left() {
    let take = SiteAction::add("T", "stock", -1.0);
    let put = SiteAction::add("T", "stock", 2.0);
    // From 2: 1, 0, refused, 2, refused (4 is above 3), 3.
    let one = SiteAction::add("T", "stock", 1.0);
    let actions = [take.clone(), take.clone(), take, put.clone(), put, one];
    let bound = Some(SiteRefusal::Bound);
    assert_eq!(refusals(&actions), [None, None, bound, None, bound, None]);
}

#[test]
fn zero_has_no_sign_in_the_state_of_a_site() {
    for action in [
        SiteAction::set("T", "stock", -0.0),
        SiteAction::set("T", "stock", -0.0).and_add("stock", -0.0),
    ] {
        let mut sites = Sites::new(&scenario(FILE));
        carry_out(&mut sites, &vec![(name("A"), vec![action])]);
        let stock = sites.state("T").unwrap().get("stock").unwrap().as_f64();
        assert!(stock.unwrap().is_sign_positive());
    }
}

#[test]
fn an_action_is_carried_out_wholly_or_refused_with_the_first_reason_that_holds() {
    let long = "x".repeat(MAX_SITE_TEXT_BYTES + 1);
    let limit = "x".repeat(MAX_SITE_TEXT_BYTES);
    for (action, refused) in [
        (SiteAction::set("T", "done", true), None),
        (
            SiteAction::set("X", "done", true),
            Some(SiteRefusal::UnknownSite),
        ),
        (
            SiteAction::set("T", "color", "red"),
            Some(SiteRefusal::UnknownKey),
        ),
        (
            SiteAction::add("T", "color", 1.0),
            Some(SiteRefusal::UnknownKey),
        ),
        (
            SiteAction::set("T", "done", true).only_if("color", "red"),
            Some(SiteRefusal::UnknownKey),
        ),
        (
            SiteAction::set("T", "done", 1.0),
            Some(SiteRefusal::OtherType),
        ),
        (
            SiteAction::add("T", "done", 1.0),
            Some(SiteRefusal::OtherType),
        ),
        (
            SiteAction::set("T", "owner", long),
            Some(SiteRefusal::TooLong),
        ),
        (SiteAction::set("T", "owner", limit), None),
        (
            SiteAction::set("T", "done", true).only_if("owner", "B"),
            Some(SiteRefusal::Condition),
        ),
        (
            SiteAction::set("T", "done", true).only_if("owner", ""),
            None,
        ),
        (SiteAction::set("T", "stock", 3.0), None),
        (SiteAction::set("T", "stock", 3.5), Some(SiteRefusal::Bound)),
        (
            SiteAction::set("T", "stock", -0.5),
            Some(SiteRefusal::Bound),
        ),
        // U has no upper bound, but a sum is a number.
        (SiteAction::add("U", "stock", f64::MAX), None),
        (
            SiteAction::set("U", "stock", f64::MAX).and_add("stock", f64::MAX),
            Some(SiteRefusal::Bound),
        ),
        // What is set is set first.
        (
            SiteAction::set("T", "stock", 3.0).and_add("stock", -3.0),
            None,
        ),
        (
            SiteAction::set("T", "done", true).and_add("stock", 9.0),
            Some(SiteRefusal::Bound),
        ),
    ] {
        let mut sites = Sites::new(&scenario(FILE));
        let before = sites.frames();
        let events = carry_out(&mut sites, &vec![(name("A"), vec![action.clone()])]);
        assert_eq!(sites.results(&name("A"))[0].refused, refused, "{action:?}");
        assert_eq!(sites.frames() == before, refused.is_some(), "{action:?}");
        let is_refusal = matches!(events[..], [Event::SiteRefused { .. }]);
        assert_eq!(is_refusal, refused.is_some(), "{events:?}");
    }
}

#[test]
fn range_is_that_of_the_site_and_includes_its_edge() {
    for (x, is_near) in [(3.0, true), (3.000_001, false)] {
        let mut sites = Sites::new(&scenario(FILE));
        let at = Point::new(x, 2.0);
        assert_eq!(sites.near(at).len(), if is_near { 2 } else { 0 });
        let actions = [SiteAction::set("T", "done", true)];
        let robot = name("A");
        let order = SiteOrders {
            robot: &robot,
            at,
            actions: &actions,
        };
        sites.carry_out(&[order]);
        let refused = sites.results(&robot)[0].refused;
        let expected = (!is_near).then_some(SiteRefusal::OutOfRange);
        assert_eq!(refused, expected);
    }
}

#[test]
fn the_first_by_name_gets_what_two_want_or_neither() {
    let claim = |site: &str| SiteAction::set(site, "done", true).only_if("done", false);
    let orders = |site: &str| {
        vec![
            (name("B"), vec![claim(site)]),
            (name("A"), vec![claim(site)]),
        ]
    };
    let refused = |sites: &Sites, robot: &str| sites.results(&name(robot))[0].refused;

    let mut sites = Sites::new(&scenario(FILE));
    carry_out(&mut sites, &orders("T"));
    assert_eq!(refused(&sites, "A"), None);
    assert_eq!(refused(&sites, "B"), Some(SiteRefusal::Condition));

    carry_out(&mut sites, &orders("U"));
    assert_eq!(refused(&sites, "A"), Some(SiteRefusal::Conflict));
    assert_eq!(refused(&sites, "B"), Some(SiteRefusal::Conflict));
    assert_eq!(sites.state("U").unwrap()["done"], Variable::Flag(false));

    // Other variables of it do not conflict, nor does what is refused anyway.
    let take = SiteAction::add("U", "stock", -1.0);
    let hopeless = claim("U").only_if("stock", 7.0);
    carry_out(
        &mut sites,
        &vec![
            (name("A"), vec![claim("U")]),
            (name("B"), vec![take, hopeless]),
        ],
    );
    assert_eq!(refused(&sites, "A"), None);
    assert_eq!(refused(&sites, "B"), None);
    assert_eq!(
        sites.results(&name("B"))[1].refused,
        Some(SiteRefusal::Condition)
    );
}

#[test]
fn a_robot_senses_sites_in_range_and_learns_what_became_of_its_actions() {
    let mut simulation = Simulation::new(scenario(FILE), 1).unwrap();
    let done = SiteAction::set("T", "done", true);
    let mut actors = Actors::of(&simulation, |report: &mut Report, actions| {
        report.site_actions = actions;
    });
    actors.actions = BTreeMap::from([
        ((1, name("B")), vec![done.clone()]),
        ((1, name("C")), vec![done.clone(), done]),
    ]);
    simulation.init(&mut actors).unwrap();
    let first = simulation.step(&mut actors).unwrap();
    simulation.step(&mut actors).unwrap();
    simulation.step(&mut actors).unwrap();

    let sites: Vec<&str> = actors.news[0][&name("A")]
        .sites
        .iter()
        .map(|site| site.name.as_str())
        .collect();
    assert_eq!(sites, ["T", "U"]);
    assert!(!actors.news[0].contains_key(&name("C")));

    let state = |tick: usize| actors.news[tick][&name("A")].sites[0].state["done"].clone();
    assert_eq!([state(1), state(2)], [false.into(), true.into()]);
    assert_eq!(actors.news[2][&name("B")].site_results[0].refused, None);
    let results = &actors.news[2][&name("C")].site_results;
    let out_of_range = Some(SiteRefusal::OutOfRange);
    assert_eq!(results.len(), 2);
    assert!(results.iter().all(|result| result.refused == out_of_range));
    assert!(
        !actors.news[3].contains_key(&name("C")),
        "results come once"
    );

    let lines: Vec<String> = first.lines().map(|line| line.to_json()).collect();
    assert!(lines.contains(
        &r#"{"tick":1,"event":"site_changed","robot":"B","site":"T","key":"done","from":false,"to":true}"#
            .to_owned()
    ));
    assert!(
        lines.contains(
            &r#"{"tick":1,"event":"site_refused","robot":"C","site":"T","because":"out_of_range"}"#
                .to_owned()
        )
    );
    assert_eq!(
        simulation.site_state("T").unwrap()["done"],
        Variable::Flag(true)
    );
}

fn action() -> impl Strategy<Value = SiteAction> {
    let site = prop::sample::select(vec!["T", "U", "X"]);
    let value = -2..4_i32;
    (site, value, any::<bool>(), any::<bool>()).prop_map(|(site, value, sets, is_free)| {
        let value = f64::from(value);
        let action = if sets {
            SiteAction::set(site, "stock", value)
        } else {
            SiteAction::add(site, "stock", value)
        };
        match is_free {
            true => action.only_if("done", false).and_set("done", value > 2.0),
            false => action,
        }
    })
}

fn orders() -> impl Strategy<Value = Orders> {
    prop::collection::btree_map(
        prop::sample::select(vec!["A", "B", "C"]),
        prop::collection::vec(action(), 0..4),
        0..4,
    )
    .prop_map(|orders| {
        orders
            .into_iter()
            .map(|(robot, actions)| (name(robot), actions))
            .collect()
    })
}

proptest! {
    #[test]
    fn the_order_in_which_reports_arrive_does_not_matter(
        orders in orders(),
        seed in any::<prop::sample::Index>(),
    ) {
        let mut shuffled = orders.clone();
        if !orders.is_empty() {
            shuffled.rotate_left(seed.index(orders.len()));
            shuffled.swap(0, seed.index(orders.len()));
        }
        let mut sites = [Sites::new(&scenario(FILE)), Sites::new(&scenario(FILE))];
        let events = carry_out(&mut sites[0], &orders);
        prop_assert_eq!(events, carry_out(&mut sites[1], &shuffled));
        prop_assert_eq!(sites[0].frames(), sites[1].frames());
    }

    #[test]
    fn bounds_hold_and_events_tell_all_that_changes(ticks in prop::collection::vec(orders(), 1..8)) {
        let mut sites = Sites::new(&scenario(FILE));
        for orders in ticks {
            let mut states: BTreeMap<String, StateVariables> = BTreeMap::new();
            for site in sites.frames() {
                states.insert(site.name, site.state);
            }
            let mut changed_by: BTreeMap<(String, String), RobotName> = BTreeMap::new();
            for event in carry_out(&mut sites, &orders) {
                let Event::SiteChanged { robot, site, key, from, to } = event else { continue };
                let state = states.get_mut(&site).unwrap();
                prop_assert_eq!(state.insert(&key, to), Some(from));
                let first = changed_by.entry((site.clone(), key)).or_insert_with(|| robot.clone());
                // A site that refuses both is changed by one robot at most.
                prop_assert!(site != "U" || *first == robot);
            }
            for site in sites.frames() {
                let stock = site.state["stock"].as_f64().unwrap();
                prop_assert!(stock >= 0.0);
                prop_assert!(site.name != "T" || stock <= 3.0);
                prop_assert_eq!(&states[&site.name], &site.state);
            }
            let count: usize = orders.iter().map(|(_, actions)| actions.len()).sum();
            let told: usize = orders.iter().map(|(robot, _)| sites.results(robot).len()).sum();
            prop_assert_eq!(told, count);
        }
    }
}

#[test]
fn news_hold_as_many_sites_as_fit() {
    let mut text = FILE.to_owned();
    for number in 0..1000 {
        text += &format!(
            "[[site]]\nname = \"W{number:03}\"\nat = [\"2 m\", \"2 m\"]\nrange = \"1 m\"\nstate = {{ "
        );
        for key in 0..4 {
            text += &format!("k{key} = {:e}, ", f64::MAX);
        }
        text += &format!("label = '{}' }}\n", "\t".repeat(16));
    }
    let mut simulation = Simulation::new(scenario(&text), 1).unwrap();
    simulation.begin_init();
    let news = simulation.news(&name("A"), IncarnationNotice::default());
    assert!(
        (100..1000).contains(&news.sites.len()),
        "{}",
        news.sites.len()
    );
    let bytes = protocol::encode(&news).len();
    assert!((20 * 1024..70 * 1024).contains(&bytes), "{bytes}");
}

#[test]
fn texts_that_all_sites_have_no_room_for_are_refused() {
    let text = "[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2.5 m\"]\n[[site]]\nname = \"T\"\ncount = 1000\nat = [\"2 m\", \"2 m\"]\nrange = \"1 m\"\nstate = { label = \"\" }\n";
    let mut sites = Sites::new(&scenario(text));
    let worst = "\u{1}".repeat(MAX_SITE_TEXT_BYTES);
    let mut label = |number: usize, text: &str| {
        let action = SiteAction::set(format!("T{number}"), "label", text);
        carry_out(&mut sites, &vec![(name("A"), vec![action])]);
        let frame = serde_json::to_vec(&sites.frames()).unwrap();
        assert!(frame.len() <= MAX_SITES_BYTES, "{}", frame.len());
        sites.results(&name("A"))[0].refused
    };

    let first_refused = (1..=1000).find(|number| label(*number, &worst).is_some());
    let first_refused = first_refused.unwrap();
    assert!((100..1000).contains(&first_refused), "{first_refused}");
    assert_eq!(label(first_refused, &worst), Some(SiteRefusal::TooLong));
    // What is given back is there for others.
    assert_eq!(label(1, ""), None);
    assert_eq!(label(first_refused, &worst), None);
    assert_eq!(label(1, &worst), Some(SiteRefusal::TooLong));
}

#[test]
fn every_robot_is_told_of_the_sites_that_are_known() {
    let file = FILE.replace("kind = \"task\"", "kind = \"task\"\nknown = true");
    let simulation = Simulation::new(scenario(&file), 1).unwrap();
    let run = RunName::new("r").unwrap();
    for robot in ["A", "C"] {
        let welcome = simulation.welcome(&run, &name(robot), 1, None).unwrap();
        let known = KnownSite {
            name: "T".to_owned(),
            kind: "task".to_owned(),
            location: Point::new(2.0, 2.0),
        };
        assert_eq!(welcome.known_sites, [known], "{robot}");
    }
}
