//! Who may do what: the key contract as rules of access control.
//!
//! What no rule allows is refused. The simulator needs no rule: it holds the door, and what it says itself passes no
//! door. Everything here is about what others may say to it; it passes on only what it let in.

use crate::keys::{Keys, OUTBOX, PARAMETERS, QUERIES, STATE};
use crate::name::{OPERATOR, RobotName};

/// The simulator, as its certificate names it.
pub const SIMULATOR: &str = "simulator";
/// The web console, as its certificate names it. It may do what an operator may: it has the same buttons.
pub const CONSOLE: &str = "console";
/// Names of certificates that no robot may have.
pub const RESERVED: [&str; 3] = [SIMULATOR, OPERATOR, CONSOLE];

/// Something that a participant may do on some keys.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grant {
    /// What it is for, in a few words.
    pub purpose: &'static str,
    /// Kinds of messages, as the middleware calls them.
    pub messages: &'static [&'static str],
    /// Key expressions; a message passes if one of them includes its key.
    pub keys: Vec<String>,
}

fn grant(purpose: &'static str, messages: &'static [&'static str], keys: Vec<String>) -> Grant {
    Grant {
        purpose,
        messages,
        keys,
    }
}

/// The six queries and all of them in one, of one robot or of `*`.
fn state_keys(keys: &Keys, robot: &str) -> Vec<String> {
    QUERIES
        .iter()
        .chain([&STATE])
        .map(|what| keys.robot(robot, what))
        .collect()
}

const PRESENCE: &[&str] = &["declare_liveliness_subscriber", "liveliness_query"];

/// What a robot may do: speak as itself, and learn what robots may learn.
#[must_use]
pub fn of_robot(keys: &Keys, robot: &RobotName) -> Vec<Grant> {
    let name = robot.as_str();
    let says = ["report", "waiting", "panel", STATE, OUTBOX].map(|what| keys.robot(name, what));
    let commands = keys.robot("*", &format!("command/{name}"));

    let mut answers = state_keys(keys, name);
    answers.push(keys.robot(name, PARAMETERS));
    let mut asks = state_keys(keys, "*");
    asks.push(keys.join_as(robot));

    vec![
        grant(
            "says",
            &["put"],
            says.into_iter().chain([commands]).collect(),
        ),
        grant("answers", &["declare_queryable", "reply"], answers),
        grant("asks", &["query"], asks),
        grant(
            "hears",
            &["declare_subscriber"],
            vec![keys.clock(), keys.news(robot), keys.robot("*", STATE)],
        ),
        grant(
            "is there",
            &["liveliness_token"],
            vec![keys.alive_robot(robot)],
        ),
        grant("sees who is there", PRESENCE, vec![keys.alive()]),
    ]
}

/// What an operator may do: control the run, watch it, and command robots.
#[must_use]
pub fn of_operator(keys: &Keys) -> Vec<Grant> {
    let mut asks = state_keys(keys, "*");
    asks.push(keys.control());

    let panels = keys.robot("*", "panel");
    let commands = keys.robot("*", &format!("command/{OPERATOR}"));

    vec![
        grant("commands", &["put"], vec![commands]),
        grant("asks", &["query"], asks),
        grant(
            "hears",
            &["declare_subscriber"],
            vec![
                keys.world(),
                keys.log(),
                keys.clock(),
                keys.faults(),
                panels,
                keys.robot("*", STATE),
            ],
        ),
        grant("is there", &["liveliness_token"], vec![keys.alive_viewer()]),
        grant("sees who is there", PRESENCE, vec![keys.alive()]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys_of<'a>(grants: &'a [Grant], message: &str) -> Vec<&'a str> {
        let of_kind = grants
            .iter()
            .filter(|grant| grant.messages.contains(&message));
        of_kind
            .flat_map(|grant| grant.keys.iter().map(String::as_str))
            .collect()
    }

    #[test]
    fn a_robot_speaks_only_as_itself() {
        let robot = RobotName::new("Butler").unwrap();
        let grants = of_robot(&Keys::of_any_run(), &robot);
        assert_eq!(
            keys_of(&grants, "put"),
            [
                "cars/*/robot/Butler/report",
                "cars/*/robot/Butler/waiting",
                "cars/*/robot/Butler/panel",
                "cars/*/robot/Butler/state",
                "cars/*/robot/Butler/outbox",
                "cars/*/robot/*/command/Butler"
            ]
        );
        for (message, others) in [
            ("reply", 0),
            ("declare_queryable", 0),
            ("liveliness_token", 0),
            ("query", 7),
        ] {
            let foreign = keys_of(&grants, message)
                .iter()
                .filter(|key| !key.contains("/Butler"))
                .count();
            assert_eq!(foreign, others, "{message}");
        }
        assert!(
            keys_of(&grants, "query")
                .iter()
                .all(|key| !key.ends_with("/control"))
        );
        let heard = keys_of(&grants, "declare_subscriber");
        assert!(
            heard.contains(&"cars/*/robot/Butler/news") && heard.contains(&"cars/*/robot/*/state")
        );
        assert!(
            heard
                .iter()
                .all(|key| !key.contains("report") && !key.contains("command"))
        );
    }

    #[test]
    fn an_operator_controls_watches_and_commands() {
        let grants = of_operator(&Keys::of_any_run());
        assert!(keys_of(&grants, "query").contains(&"cars/*/control"));
        assert!(keys_of(&grants, "declare_subscriber").contains(&"cars/*/robot/*/panel"));
        assert_eq!(keys_of(&grants, "put"), ["cars/*/robot/*/command/operator"]);
        assert_eq!(
            keys_of(&grants, "liveliness_token"),
            ["cars/*/alive/viewer"]
        );
        for message in ["delete", "reply", "declare_queryable"] {
            assert!(keys_of(&grants, message).is_empty(), "{message}");
        }
    }
}
