//! Where something starts, as written in the file: `["4 ft", "4 ft"]`, `"random"`, or a table with a pattern for many.

use config::FixedList;
use config::units::Length;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use world::{Point, Region};

/// The word for a place that follows from the seed.
const RANDOM: &str = "random";

/// A place as a list of two lengths.
pub(super) type Lengths = FixedList<Length, 2>;

/// Where a robot or a thing starts.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum StartPlace {
    /// A given place.
    Given {
        at: Lengths,
        /// Where it was drawn, if it follows from the seed, which a file does not say.
        drawn: Option<Region>,
    },
    /// Any free one, by the seed.
    Random,
    /// One of a pattern.
    Pattern(Box<PlacePattern>),
}

/// A pattern of places. Exactly one of the first six keys is given.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlacePattern {
    #[serde(skip_serializing_if = "Option::is_none")]
    place: Option<Lengths>,
    #[serde(skip_serializing_if = "Option::is_none")]
    grid: Option<GridPlaces>,
    #[serde(skip_serializing_if = "Option::is_none")]
    line: Option<LinePlaces>,
    #[serde(skip_serializing_if = "Option::is_none")]
    circle: Option<Circle>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cluster: Option<Circle>,
    #[serde(skip_serializing_if = "Option::is_none")]
    random: Option<LinePlaces>,
    /// How far along x and along y a place is moved at most, by the seed.
    #[serde(skip_serializing_if = "Option::is_none")]
    jitter: Option<Length>,
    /// Which one of the pattern it is, from 1, of how many. Tables in bulk give each of theirs its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    number: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    of: Option<usize>,
}

/// Rows of places, from one corner along x, row by row along y.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct GridPlaces {
    from: Lengths,
    step: Spacing,
    columns: usize,
}

/// From the first to the last one; or the corners of a rectangle.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct LinePlaces {
    from: Lengths,
    to: Lengths,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Circle {
    center: Lengths,
    radius: Length,
}

/// A length along both axes, or one along each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spacing(pub(super) [Length; 2]);

impl StartPlace {
    /// A place, written out.
    pub(super) fn of(at: Point, drawn: Option<Region>) -> Self {
        Self::Given {
            at: lengths(at),
            drawn,
        }
    }

    /// Makes a place that follows from the seed the region again that it was drawn from.
    pub(super) fn forget(&mut self) {
        if let Self::Given {
            drawn: Some(region),
            ..
        } = *self
        {
            *self = Self::anew(region);
        }
    }

    /// Any place of a region, by the seed.
    pub(super) fn anew(region: Region) -> Self {
        match region {
            Region::Field => Self::Random,
            Region::Rectangle(from, to) => Self::pattern(PlacePattern {
                random: Some(LinePlaces {
                    from: lengths(from),
                    to: lengths(to),
                }),
                ..PlacePattern::none()
            }),
            Region::Disc { center, radius_m } => Self::pattern(PlacePattern {
                cluster: Some(Circle {
                    center: lengths(center),
                    radius: Length(radius_m),
                }),
                ..PlacePattern::none()
            }),
        }
    }

    fn pattern(pattern: PlacePattern) -> Self {
        Self::Pattern(Box::new(pattern))
    }

    /// The place of one of a table in bulk, from 1, of so many.
    pub(super) fn member(&self, number: usize, of: usize) -> Self {
        let Self::Pattern(pattern) = self else {
            return self.clone();
        };
        let mut pattern = pattern.clone();
        pattern.number.get_or_insert(number);
        pattern.of.get_or_insert(of);
        Self::Pattern(pattern)
    }

    /// The place, or where it is drawn: the corner of the field while it is not known.
    pub(super) fn resolve(&self) -> (Point, Option<Region>) {
        match self {
            Self::Given { at, drawn } => (point(*at), *drawn),
            Self::Random => (Point::default(), Some(Region::Field)),
            Self::Pattern(pattern) => pattern.resolve(),
        }
    }
}

impl PlacePattern {
    fn none() -> Self {
        Self {
            place: None,
            grid: None,
            line: None,
            circle: None,
            cluster: None,
            random: None,
            jitter: None,
            number: None,
            of: None,
        }
    }

    /// Checks what the types do not say.
    fn check(&self) -> Result<(), String> {
        let places = [
            self.place.is_some(),
            self.grid.is_some(),
            self.line.is_some(),
            self.circle.is_some(),
        ];
        let regions = [self.cluster.is_some(), self.random.is_some()];
        let count = |given: &[bool]| given.iter().filter(|is_given| **is_given).count();
        if count(&places) + count(&regions) != 1 {
            return Err(
                "give exactly one of place, grid, line, circle, cluster and random".to_owned(),
            );
        }

        if self.jitter.is_some() && count(&regions) == 1 {
            return Err(
                "places of a cluster or at random are drawn anyway: leave jitter out".to_owned(),
            );
        }
        if self.jitter.is_some_and(|jitter| jitter.0 < 0.0) {
            return Err("jitter must not be less than zero".to_owned());
        }
        if self.grid.is_some_and(|grid| grid.columns == 0) {
            return Err("a grid has at least one column".to_owned());
        }
        let circles = self.circle.iter().chain(&self.cluster);
        if circles.into_iter().any(|circle| circle.radius.0 < 0.0) {
            return Err("the radius must not be less than zero".to_owned());
        }
        match (self.number, self.of) {
            (None, None) => Ok(()),
            (Some(number), Some(of)) if 1 <= number && number <= of => Ok(()),
            _ => Err("number is at least 1 and at most of: give both".to_owned()),
        }
    }

    fn resolve(&self) -> (Point, Option<Region>) {
        if let Some(Circle { center, radius }) = self.cluster {
            let region = Region::Disc {
                center: point(center),
                radius_m: radius.0,
            };
            return (Point::default(), Some(region));
        }
        if let Some(LinePlaces { from, to }) = self.random {
            let region = Region::Rectangle(point(from), point(to));
            return (Point::default(), Some(region));
        }

        let at = self.place();
        let drawn = self.jitter.map(|Length(jitter_m)| {
            let jitter = Point::new(jitter_m, jitter_m);
            Region::Rectangle(at - jitter, at + jitter)
        });
        (at, drawn)
    }

    /// The place before any jitter.
    fn place(&self) -> Point {
        let index = self.number.unwrap_or(1) - 1;
        let count = self.of.unwrap_or(1);

        if let Some(GridPlaces {
            from,
            step: Spacing([x, y]),
            columns,
        }) = self.grid
        {
            let column = (index % columns) as f64;
            let row = (index / columns) as f64;
            return point(from) + Point::new(x.0 * column, y.0 * row);
        }
        if let Some(LinePlaces { from, to }) = self.line {
            let share = match count {
                1 => 0.0,
                _ => index as f64 / (count - 1) as f64,
            };
            return point(from) + (point(to) - point(from)) * share;
        }
        if let Some(Circle { center, radius }) = self.circle {
            let angle_rad = std::f64::consts::TAU * index as f64 / count as f64;
            let (sin, cos) = libm::sincos(angle_rad);
            return point(center) + Point::new(cos, sin) * radius.0;
        }
        self.place.map_or_else(Point::default, point)
    }
}

/// A place in meters.
pub(super) fn point(FixedList([x, y]): Lengths) -> Point {
    Point::new(x.0, y.0)
}

/// A place as it is written.
pub(super) fn lengths(at: Point) -> Lengths {
    FixedList([Length(at.x), Length(at.y)])
}

impl<'de> Deserialize<'de> for StartPlace {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(StartPlaceVisitor)
    }
}

impl Serialize for StartPlace {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Given { at, .. } => at.serialize(serializer),
            Self::Random => serializer.serialize_str(RANDOM),
            Self::Pattern(pattern) => pattern.serialize(serializer),
        }
    }
}

struct StartPlaceVisitor;

impl<'de> Visitor<'de> for StartPlaceVisitor {
    type Value = StartPlace;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "a place such as [\"4 ft\", \"4 ft\"], a list of exactly 2 elements, a table such as \
             {{ circle = {{ center = [\"5 m\", \"5 m\"], radius = \"2 m\" }} }}, or \"{RANDOM}\""
        )
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<StartPlace, E> {
        if text == RANDOM {
            return Ok(StartPlace::Random);
        }
        Err(E::invalid_value(serde::de::Unexpected::Str(text), &self))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<StartPlace, A::Error> {
        let at = FixedList::deserialize(SeqAccessDeserializer::new(list))?;
        Ok(StartPlace::Given { at, drawn: None })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<StartPlace, A::Error> {
        let pattern = PlacePattern::deserialize(MapAccessDeserializer::new(map))?;
        pattern.check().map_err(A::Error::custom)?;
        Ok(StartPlace::pattern(pattern))
    }
}

impl<'de> Deserialize<'de> for Spacing {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(StepVisitor)
    }
}

impl Serialize for Spacing {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0)
    }
}

struct StepVisitor;

impl<'de> Visitor<'de> for StepVisitor {
    type Value = Spacing;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a length such as \"2 m\", or a list of two, such as [\"2 m\", \"1 m\"]")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Spacing, E> {
        let length: Length = text.parse().map_err(E::custom)?;
        Ok(Spacing([length; 2]))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Spacing, A::Error> {
        let FixedList(lengths) = FixedList::deserialize(SeqAccessDeserializer::new(list))?;
        Ok(Spacing(lengths))
    }
}
