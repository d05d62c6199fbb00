//! Lists of a fixed length, such as places and sizes.

use std::marker::PhantomData;

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A list of exactly `N` elements. An array of Rust, read from TOML, would ignore the elements after the last one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixedList<T, const N: usize>(pub [T; N]);

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for FixedList<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(ListVisitor(PhantomData))
    }
}

impl<T: Serialize, const N: usize> Serialize for FixedList<T, N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(&self.0)
    }
}

struct ListVisitor<T, const N: usize>(PhantomData<T>);

impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for ListVisitor<T, N> {
    type Value = FixedList<T, N>;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "a list of exactly {N} elements")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut elements = Vec::with_capacity(N);
        while elements.len() < N
            && let Some(element) = list.next_element()?
        {
            elements.push(element);
        }

        // The error of the surplus element has its place.
        let _none = list.next_element::<Surplus<N>>()?;
        let length = elements.len();
        let elements = elements.try_into();
        elements
            .map(FixedList)
            .map_err(|_: Vec<T>| A::Error::invalid_length(length, &self))
    }
}

/// An element after the last one, which is always an error.
struct Surplus<const N: usize>;

impl<'de, const N: usize> Deserialize<'de> for Surplus<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Self)
    }
}

impl<const N: usize> Visitor<'_> for Surplus<N> {
    type Value = Self;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the end of a list of exactly {N} elements")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Length;

    #[derive(Debug, Deserialize)]
    struct File {
        at: FixedList<Length, 2>,
    }

    #[test]
    fn a_list_has_exactly_its_number_of_elements() {
        let file: File = toml::from_str(r#"at = ["1 m", "2 m"]"#).unwrap();
        assert_eq!(file.at, FixedList([Length(1.0), Length(2.0)]));

        for (text, place, reason) in [
            (
                r#"at = ["1 m", "2 m", "3 m"]"#,
                r#""3 m""#,
                "the end of a list",
            ),
            (r#"at = ["1 m", "2 m", 4, "x"]"#, "4", "exactly 2 elements"),
            (r#"at = ["1 m"]"#, r#"["1 m"]"#, "exactly 2 elements"),
            ("at = []", "[]", "invalid length 0"),
        ] {
            let error = toml::from_str::<File>(text).unwrap_err();
            assert!(error.message().contains(reason), "{text}: {error}");
            assert_eq!(&text[error.span().unwrap()], place, "{error}");
        }
    }
}
