//! Draws the README's picture: the hall in the state of the paper's Figure 6, as found by playing seeds.
//!
//! `cargo run --release -p system-tests --example picture > docs/hall.svg`

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints its result"
)]

use std::fmt::Write;

use system_tests::hall::{Hall, scenario};

/// Pixels per meter.
const SCALE: f64 = 30.0;
const FILE: &str = "configs/hors_doeuvres.toml";

fn main() {
    match (1..=200).find_map(figure_6) {
        Some(hall) => print!("{}", draw(&hall)),
        None => eprintln!("no seed up to 200 reaches the state of Figure 6"),
    }
}

/// Plays a seed until Butler, concerned, has seven treats left and Leguin, concerned, is about half-way to him.
fn figure_6(seed: u64) -> Option<Hall> {
    let mut hall = Hall::new(scenario(FILE, seed, &[]));
    while hall.simulation.tick() < hall.simulation.scenario().ticks {
        hall.step();
        let state = |robot: &str| (hall.emotion(robot), hall.behavior(robot));
        let is_reached = state("Butler") == ("CONCERNED".into(), "SERVE".into())
            && state("Leguin") == ("CONCERNED".into(), "REFILL".into())
            && hall.number("Butler", "treats") == 7.0;
        if is_reached {
            eprintln!("seed {seed}, tick {}", hall.simulation.tick());
            return Some(hall);
        }
    }

    None
}

fn draw(hall: &Hall) -> String {
    let world = hall.simulation.world();
    let (width, height) = (
        world.field().size_m.0 * SCALE,
        world.field().size_m.1 * SCALE,
    );
    let side = world.field().body_m * SCALE;
    let y = |meters: f64| height - meters * SCALE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-10 -10 {} {}\" font-family=\"sans-serif\">\n\
         <rect x=\"-10\" y=\"-10\" width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fafafa\" stroke=\"#888\"/>\n",
        width + 330.0,
        height + 20.0
    );
    let mut put = |line: String| {
        let _ = writeln!(svg, "{line}");
    };
    for at in world.obstacles() {
        let (x, y) = (at.x * SCALE - side / 2.0, y(at.y) - side / 2.0);
        put(format!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{side:.1}\" height=\"{side:.1}\" fill=\"#222\"/>"
        ));
    }

    for at in world.guests() {
        let (x, y, r) = (at.x * SCALE, y(at.y), side / 2.0);
        put(format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\" fill=\"#b9e3bd\" stroke=\"#3d8b46\"/>"
        ));
    }

    for (index, name) in hall.simulation.names().iter().enumerate() {
        let (at, r, name) = (hall.at(name.as_str()), side / 2.0, name.as_str());
        let (x, y) = (at.x * SCALE, y(at.y));
        put(format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\" fill=\"#ffe3e0\" stroke=\"#c62828\" stroke-width=\"2\"/>"
        ));
        put(format!(
            "<text x=\"{x:.1}\" y=\"{:.1}\" font-size=\"10\" text-anchor=\"middle\" fill=\"#c62828\">{}</text>",
            y + 3.5,
            &name[..2]
        ));
        let (left, top) = (width + 30.0, 40.0 + 150.0 * index as f64);
        let line = |row: f64, size: u32, text: &str| {
            format!(
                "<text x=\"{left}\" y=\"{}\" font-size=\"{size}\" fill=\"#333\">{text}</text>",
                top + 24.0 * row
            )
        };
        put(line(0.0, 20, name));
        put(line(1.0, 15, &format!("feels {}", hall.emotion(name))));
        put(line(2.0, 15, &format!("does {}", hall.behavior(name))));
        if name == "Butler" {
            put(line(
                3.0,
                15,
                &format!("{} treats left", hall.number(name, "treats")),
            ));
        }
    }

    svg + "</svg>\n"
}
