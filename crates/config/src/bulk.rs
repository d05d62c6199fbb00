//! Robots and sites in bulk: one table of a scenario file is as many of them, whose names are that of the table and a number:
//! `count = 20` with `name = "S"`, or `name = "S{1..20}"`, are S1 to S20.

use std::ops::RangeInclusive;

use protocol::pattern::{self, split_range};

/// The name of a robot of a table with a count or a range.
#[must_use]
pub fn member(name: &str, number: usize) -> String {
    format!("{name}{number}")
}

/// The name of an element of a list, without the range in it.
pub(crate) fn name(element: &toml::Value) -> Option<&str> {
    let name = element.get("name")?.as_str()?;
    Some(match split_range(name) {
        Ok(Some((base, _))) => base,
        _ => name,
    })
}

/// The numbers of the robots that an element is; `None` for one that is a single robot, and for a count that is not valid.
fn numbers(element: &toml::Value) -> Option<RangeInclusive<usize>> {
    let written = element.get("name").and_then(toml::Value::as_str);
    if let Some(Ok(Some((_, numbers)))) = written.map(split_range) {
        return Some(numbers);
    }
    let count = usize::try_from(element.get("count")?.as_integer()?).ok()?;
    Some(1..=count)
}

/// Writes a range from 1 as a count, for a change of the number of robots.
///
/// # Errors
/// If the robots of a table of this name are not numbered from 1.
pub(crate) fn count_ranges(robots: &mut [toml::Value], pattern: &str) -> Result<(), String> {
    for element in robots {
        let Some(base) = name(element).filter(|base| pattern::matches(pattern, base)) else {
            continue;
        };
        let base = base.to_owned();
        let written = element.get("name").and_then(toml::Value::as_str);
        let Some(Ok(Some((_, numbers)))) = written.map(split_range) else {
            continue;
        };
        if *numbers.start() != 1 {
            return Err(format!(
                "the robots {base}{} to {base}{} are not numbered from 1: change the name of their table",
                numbers.start(),
                numbers.end()
            ));
        }
        if let Some(table) = element.as_table_mut() {
            table.insert("name".to_owned(), base.into());
        }
    }
    Ok(())
}

/// Whether a name or a pattern stands for an element; for one that is several robots, for the first of them.
pub(crate) fn matches(element: &toml::Value, pattern: &str) -> bool {
    let Some(name) = name(element) else {
        return false;
    };
    match numbers(element) {
        None => pattern::matches(pattern, name),
        Some(numbers) if numbers.is_empty() => false,
        Some(numbers) => pattern::matches(pattern, &member(name, *numbers.start())),
    }
}

/// Puts a table for each robot in the place of those in bulk, so that a change names robots and never tables.
pub fn separate_all(robots: &mut Vec<toml::Value>) {
    separate_where(robots, true, |_, _| true);
}

/// Puts a table for each robot in the place of those in bulk of whose robots a name or a pattern stands for some and not for
/// all, so that they can be given different values. What is called as the table itself stands for all. `have_classes`: whether
/// the class is the name of the table where it is not given.
pub(crate) fn separate(robots: &mut Vec<toml::Value>, have_classes: bool, pattern: &str) {
    separate_where(robots, have_classes, |name, numbers| {
        if name == pattern {
            return false;
        }
        let count = numbers.clone().count();
        let named = numbers.filter(|number| pattern::matches(pattern, &member(name, *number)));
        let named = named.count();
        named > 0 && named < count
    });
}

/// Separates the robots of the tables of which `is_chosen`, given their name and their numbers.
fn separate_where(
    robots: &mut Vec<toml::Value>,
    have_classes: bool,
    is_chosen: impl Fn(&str, RangeInclusive<usize>) -> bool,
) {
    let mut separated = Vec::new();
    for element in std::mem::take(robots) {
        match (name(&element), numbers(&element)) {
            (Some(base), Some(numbers))
                if numbers.clone().count() <= MAX_SEPARATED && is_chosen(base, numbers.clone()) =>
            {
                let table = element.as_table().cloned().unwrap_or_default();
                let count = numbers.clone().count();
                separated.extend(numbers.zip(1..).map(|(number, place)| {
                    let name = member(base, number);
                    single(
                        table.clone(),
                        have_classes.then_some(base),
                        &name,
                        (place, count),
                    )
                }));
            }
            _ => separated.push(element),
        }
    }
    *robots = separated;
}

/// Most robots that are separated: a scenario with more is refused.
const MAX_SEPARATED: usize = 10_000;

/// The table of one robot or site with a name, the `place`th of `count`. A robot without a class in the file has the one given.
fn single(
    mut table: toml::Table,
    class: Option<&str>,
    name: &str,
    (place, count): (usize, usize),
) -> toml::Value {
    table.remove("count");
    // Its place in a pattern of places.
    if let Some(at) = table.get_mut("at").and_then(toml::Value::as_table_mut) {
        for (key, value) in [("number", place), ("of", count)] {
            let value = i64::try_from(value).unwrap_or(i64::MAX);
            at.entry(key).or_insert(value.into());
        }
    }
    if let Some(class) = class {
        table
            .entry("class")
            .or_insert_with(|| toml::Value::from(class));
    }
    table.insert("name".to_owned(), name.into());
    table.into()
}

#[cfg(test)]
mod tests {
    use protocol::pattern::split_range;

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
    fn a_range_is_as_many_robots_as_a_count() {
        assert_eq!(split_range("S").unwrap(), None);
        assert_eq!(split_range("S{1..20}").unwrap(), Some(("S", 1..=20)));
        assert_eq!(split_range("S{0..0}").unwrap(), Some(("S", 0..=0)));
        for wrong in [
            "S{",
            "S{1}",
            "S{1..}",
            "S{..2}",
            "S{1..2",
            "S{1..2}x",
            "S{01..2}",
            "S{-1..2}",
            "S{1..=2}",
            "S{1..2}{1..2}",
            "S{1..1000001}",
            "S{1..99999999999999999999}",
        ] {
            assert!(
                split_range(wrong).unwrap_err().contains("such as"),
                "{wrong}"
            );
        }
        assert!(split_range("S{3..2}").unwrap_err().contains("before 3"));

        let apply = |change: &str| {
            let file = FILE.replace("\"S\"\ncount = 3", "\"S{1..3}\"");
            change.parse::<Override>()?.apply(file.parse().unwrap())
        };
        assert_eq!(names(&apply("robot.S*.params.k=1").unwrap()).len(), 2);
        assert_eq!(names(&apply("robot.S.params.k=1").unwrap()).len(), 2);
        let table = apply("robot.S2.params.k=1").unwrap();
        assert_eq!(names(&table), ["Butler", "S1", "S2", "S3"]);
        assert_eq!(table["robot"][1]["class"].as_str(), Some("S"));
        let table = apply("robot.S.count=5").unwrap();
        assert_eq!(table["robot"][1]["name"].as_str(), Some("S"));
        assert_eq!(table["robot"][1]["count"], 5.into());
    }

    #[test]
    fn a_range_that_begins_elsewhere_has_no_count() {
        let file = "[[robot]]\nname = \"S{5..7}\"\n";
        let apply = |change: &str| change.parse::<Override>()?.apply(file.parse().unwrap());
        assert_eq!(
            names(&apply("robot.S6.params.k=1").unwrap()),
            ["S5", "S6", "S7"]
        );
        assert!(apply("robot.S1.params.k=1").is_err());
        assert!(
            apply("robot.S.count=5")
                .unwrap_err()
                .contains("not numbered from 1")
        );
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
