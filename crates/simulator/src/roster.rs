//! The seed's `CARSConfig.txt`: one robot class a line. Everything else is as in the seed's experiment.

use config::diagnostic::{FileError, Source};
use protocol::RobotName;

/// Most robots a plain roster can place.
const MAX_ROBOTS: usize = 100;

/// The scenario, as text, of a plain roster: the hall of the seed's experiment, the first robot in the middle of the
/// field, the others at the food table, and parameters as shipped. Blank lines and lines that begin with `#` do not
/// count.
///
/// # Errors
/// [`FileError`] names the line that is not a usable class name.
pub fn scenario_of(roster: &Source) -> Result<Source, FileError> {
    let mut text =
        String::from("[guests]\ncount = 100\n\n[[obstacle]]\nat = [\"2 ft\", \"2 ft\"]\n");
    let mut offset = 0;
    let mut count = 0;
    for line in roster.text.split_inclusive('\n') {
        let span = offset..offset + line.trim_end().len();
        offset += line.len();
        let class = line.trim();
        if class.is_empty() || class.starts_with('#') {
            continue;
        }
        let refuse = |reason: &str| FileError::at(roster, Some(span.clone()), reason);
        let name = RobotName::new(class).map_err(|error| refuse(&error.to_string()))?;
        if count == MAX_ROBOTS {
            return Err(refuse("more than 100 robots: write a scenario file"));
        }
        let (x, y) = place(count);
        text += &format!("\n[[robot]]\nname = \"{name}\"\nat = [\"{x} ft\", \"{y} ft\"]\n");
        count += 1;
    }

    Ok(Source {
        name: format!("{} (as a scenario)", roster.name),
        text,
    })
}

/// The waiter in the middle; the others along the edge from the food table on.
fn place(index: usize) -> (f64, f64) {
    match index {
        0 => (25.0, 25.0),
        i => (
            5.0 + 3.0 * ((i - 1) % 15) as f64,
            2.0 + 3.0 * ((i - 1) / 15) as f64,
        ),
    }
}
