//! Robots and sites in bulk: one table of a scenario file with a `count` is as many of them, whose names are that of the table and a
//! number from 1.

use protocol::pattern::overlap;

/// The name of a robot of a table with a count; the first one has the number 1.
#[must_use]
pub fn member(name: &str, number: usize) -> String {
    format!("{name}{number}")
}

/// The name of an element of a list.
pub(crate) fn name(element: &toml::Value) -> Option<&str> {
    element.get("name")?.as_str()
}

/// How many robots an element is; `None` for one that has no count, and for a count that is not one.
fn count(element: &toml::Value) -> Option<usize> {
    usize::try_from(element.get("count")?.as_integer()?).ok()
}

/// Whether a name or a pattern stands for an element; for one with a count, for the first of its robots.
pub(crate) fn matches(element: &toml::Value, pattern: &str) -> bool {
    let Some(name) = name(element) else {
        return false;
    };
    match count(element) {
        None => overlap(pattern, name),
        Some(0) => false,
        Some(_) => overlap(pattern, &member(name, 1)),
    }
}

/// Puts a table for each robot in the place of those with a count, so that a change names robots and never tables.
pub fn separate_all(robots: &mut Vec<toml::Value>) {
    separate_where(robots, true, |_, _| true);
}

/// Puts a table for each robot in the place of those with a count of whose robots a name or a pattern stands for some and not for
/// all, so that they can be given different values. What is called as the table itself stands for all. `have_classes`: see [`single`].
pub(crate) fn separate(robots: &mut Vec<toml::Value>, have_classes: bool, pattern: &str) {
    separate_where(robots, have_classes, |name, count| {
        if name == pattern {
            return false;
        }
        let named = (1..=count).filter(|number| overlap(pattern, &member(name, *number)));
        let named = named.count();
        named > 0 && named < count
    });
}

/// Separates the robots of the tables of which `is_chosen`, given their name and their count.
fn separate_where(
    robots: &mut Vec<toml::Value>,
    have_classes: bool,
    is_chosen: impl Fn(&str, usize) -> bool,
) {
    let mut separated = Vec::new();
    for element in std::mem::take(robots) {
        match (name(&element), count(&element)) {
            (Some(name), Some(count)) if count <= MAX_SEPARATED && is_chosen(name, count) => {
                let table = element.as_table().cloned().unwrap_or_default();
                separated.extend(
                    (1..=count)
                        .map(|number| single(table.clone(), have_classes, name, (number, count))),
                );
            }
            _ => separated.push(element),
        }
    }
    *robots = separated;
}

/// Most robots that are separated: a scenario with more is refused.
const MAX_SEPARATED: usize = 10_000;

/// The table of one robot or site, the `number`th of `count`. Robots have a class: without one in the file it is the name of the
/// table.
fn single(
    mut table: toml::Table,
    have_classes: bool,
    name: &str,
    (number, count): (usize, usize),
) -> toml::Value {
    table.remove("count");
    // Its place in a pattern of places.
    if let Some(at) = table.get_mut("at").and_then(toml::Value::as_table_mut) {
        for (key, value) in [("number", number), ("of", count)] {
            let value = i64::try_from(value).unwrap_or(i64::MAX);
            at.entry(key).or_insert(value.into());
        }
    }
    if have_classes {
        table
            .entry("class")
            .or_insert_with(|| toml::Value::from(name));
    }
    table.insert("name".to_owned(), member(name, number).into());
    table.into()
}

#[cfg(test)]
mod tests {
    use crate::Override;

    const FILE: &str = "[[robot]]\nname = \"Butler\"\n[[robot]]\nname = \"S\"\ncount = 3\n";

    fn changed(changes: &[&str]) -> Result<toml::Table, String> {
        let mut table: toml::Table = toml::from_str(FILE).map_err(|error| error.to_string())?;
        for change in changes {
            table = change.parse::<Override>()?.apply(table)?;
        }
        Ok(table)
    }

    fn names(table: &toml::Table) -> Vec<&str> {
        let robots = table["robot"].as_array().into_iter().flatten();
        robots.filter_map(super::name).collect()
    }

    #[test]
    fn a_change_of_all_robots_of_a_table_is_one_of_the_table() {
        for path in ["S", "S*", "*", "S*.params"] {
            let change = match path {
                "S*.params" => "robot.S*.params={k=1}".to_owned(),
                _ => format!("robot.{path}.params.k=1"),
            };
            let table = changed(&[&change]).unwrap();
            assert_eq!(names(&table), ["Butler", "S"], "{change}");
            assert_eq!(table["robot"][1]["params"]["k"], 1.into());
            let is_butler_changed = table["robot"][0].get("params").is_some();
            assert_eq!(is_butler_changed, path == "*");
        }
    }

    #[test]
    fn a_change_of_some_robots_of_a_table_separates_them() {
        let table = changed(&["robot.S.params.j=7", "robot.S2.params.k=1"]).unwrap();
        assert_eq!(names(&table), ["Butler", "S1", "S2", "S3"]);
        let params = |index: usize| table["robot"][index]["params"].as_table().unwrap().len();
        assert_eq!([params(1), params(2), params(3)], [1, 2, 1]);
        assert_eq!(table["robot"][3]["class"].as_str(), Some("S"));
        assert!(table["robot"][3].get("count").is_none());

        let table = changed(&["robot.*2.params.k=1"]).unwrap();
        assert_eq!(names(&table).len(), 4);
    }

    #[test]
    fn a_change_of_robots_that_are_not_there_is_refused() {
        for change in ["robot.S4.params.k=1", "robot.S0.params.k=1"] {
            assert!(changed(&[change]).unwrap_err().contains("none of the 2"));
        }
        let none = changed(&["robot.S.count=0", "robot.S*.params.k=1"]);
        assert!(none.unwrap_err().contains("matches \"S*\""));
    }
}
