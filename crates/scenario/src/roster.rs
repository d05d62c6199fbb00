//! Rosters in the format of the first CARS (`CARSConfig.txt`): one robot class a line. All other settings are those of the
//! paper's experiment.

use config::diagnostic::{FileError, Source};
use protocol::RobotName;

/// Most robots that a roster can place.
const MAX_ROBOTS: usize = 100;

/// The scenario of a roster as text: the hall of the paper's experiment with the first robot in the middle of the field, the
/// others at the food table, and default parameters. Blank lines and lines that begin with `#` are skipped.
///
/// # Errors
/// [`FileError`] at the first line that is not a class name, or if there are too many robots.
pub fn scenario_of(roster: &Source) -> Result<Source, FileError> {
    let mut text =
        String::from("[guests]\ncount = 100\n\n[[obstacle]]\nat = [\"2 ft\", \"2 ft\"]\n");
    let mut offset = 0;
    let mut count = 0;
    for line in roster.text.split_inclusive('\n') {
        let span = Some(offset..offset + line.trim_end().len());
        offset += line.len();
        let class = line.trim();
        if class.is_empty() || class.starts_with('#') {
            continue;
        }

        if count == MAX_ROBOTS {
            let text = "more than 100 robots: write a scenario file";
            return Err(FileError::at(roster, span, text));
        }
        let name = RobotName::new(class)
            .map_err(|error| FileError::at(roster, span, &error.to_string()))?;
        let (x, y) = place(count);
        text += &format!("\n[[robot]]\nname = \"{name}\"\nat = [\"{x} ft\", \"{y} ft\"]\n");
        count += 1;
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
