//! Rosters in the format of the first CARS (`CARSConfig.txt`): one robot class a line. A robot that has another name than its class
//! has it behind the class: `Leguin Laila`. All other settings are those of the paper's experiment.

use std::collections::BTreeSet;

use config::diagnostic::{FileError, Source};
use protocol::RobotName;

/// Most robots that a roster can place.
const MAX_ROBOTS: usize = 100;

/// The scenario of a roster as text: the hall of the paper's experiment with the first robot in the middle of the field, the
/// others at the food table, and default parameters. Blank lines and lines that begin with `#` are skipped.
///
/// # Errors
/// [`FileError`] at the first line that is no class, or no class and a name, or has the name of an earlier line, or is one too many.
pub fn scenario_of(roster: &Source) -> Result<Source, FileError> {
    let mut text =
        String::from("[guests]\ncount = 100\n\n[[obstacle]]\nat = [\"2 ft\", \"2 ft\"]\n");
    let mut offset = 0;
    let mut names = BTreeSet::new();
    for line in roster.text.split_inclusive('\n') {
        let span = Some(offset..offset + line.trim_end().len());
        offset += line.len();
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }

        if names.len() == MAX_ROBOTS {
            let text = "more than 100 robots: write a scenario file";
            return Err(FileError::at(roster, span, text));
        }
        let (class, name) = match line.split_once(char::is_whitespace) {
            Some((class, name)) => (class, name.trim_start()),
            None => (line, line),
        };
        let read = |text| {
            RobotName::new(text)
                .map_err(|error| FileError::at(roster, span.clone(), &error.to_string()))
        };
        let (class, name) = (read(class)?, read(name)?);
        let (x, y) = place(names.len());
        text += &format!(
            "\n[[robot]]\nname = \"{name}\"\nclass = \"{class}\"\nat = [\"{x} ft\", \"{y} ft\"]\n"
        );
        if let Some(name) = names.replace(name) {
            let text = format!("a second robot called {name}");
            let help = format!("give it a name of its own, behind its class: {class} NAME");
            return Err(FileError::at(roster, span, &text).with_help(help));
        }
    }

    Ok(Source {
        name: format!("{} (as a scenario)", roster.name),
        text,
    })
}

/// Places, ft: the waiter in the middle, the others in rows of 15 from the food table on.
fn place(index: usize) -> (f64, f64) {
    let Some(behind) = index.checked_sub(1) else {
        return (25.0, 25.0);
    };

    let column = (behind % 15) as f64;
    let row = (behind / 15) as f64;
    (5.0 + 3.0 * column, 2.0 + 3.0 * row)
}
