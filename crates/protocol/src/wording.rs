//! Says what deserialization refuses in words of files instead of words of Rust: "a whole number of 0 or more" instead of "usize".

/// A message of serde in which what was expected is named as a user writes it. A message that ends in another way is unchanged.
#[must_use]
pub fn without_type_names(message: &str) -> String {
    if let Some(before) = message.strip_suffix("wanted string or table") {
        return format!("{before}expected a string or a table");
    }

    // What was found comes before and can be any text, so only the last part counts.
    let Some((found, expected)) = message.rsplit_once(EXPECTED) else {
        return message.to_owned();
    };
    if let Some(number) = found.strip_suffix(" as i128") {
        return format!(
            "{number} is too large or too small: from {} to {}",
            i64::MIN,
            i64::MAX
        );
    }
    let words = match expected {
        "u64" | "usize" => "a whole number of 0 or more",
        "u32" => "a whole number from 0 to 4294967295",
        "u16" => "a whole number from 0 to 65535",
        "u8" => "a whole number from 0 to 255",
        "i64" | "isize" | "i32" | "i16" | "i8" => "a whole number",
        "f64" | "f32" => "a number",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "a map" => "a table",
        "string or map" => "a string or a table",
        other if is_table(other) => "a table",
        other if other.starts_with("a nonzero ") => "a whole number of 1 or more",
        other => other,
    };
    format!("{found}{EXPECTED}{words}")
}

const EXPECTED: &str = ", expected ";

/// Whether it names a type of Rust that is written as a table.
fn is_table(expected: &str) -> bool {
    let name = expected.strip_prefix("struct ").or_else(|| {
        let tagged = expected.strip_prefix("internally tagged enum ");
        tagged.or_else(|| expected.strip_prefix("adjacently tagged enum "))
    });
    name.is_some_and(|name| !name.contains(' '))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::num::NonZeroU64;

    use serde::Deserialize;
    use serde::de::DeserializeOwned;
    use serde_json::json;

    use super::*;

    #[derive(Debug, Deserialize)]
    struct RawTable {}

    #[derive(Debug, Deserialize)]
    #[serde(tag = "kind")]
    enum Tagged {}

    /// What is said of a value that is no `T`.
    fn refused<T: DeserializeOwned + std::fmt::Debug>(value: serde_json::Value) -> String {
        let error = serde_json::from_value::<T>(value).unwrap_err();
        without_type_names(&error.to_string())
    }

    #[test]
    fn numbers_are_named_with_their_range() {
        let wrong = || json!(-1);
        let said = "invalid value: integer `-1`, expected a whole number";
        assert_eq!(refused::<usize>(wrong()), format!("{said} of 0 or more"));
        assert_eq!(refused::<u64>(wrong()), format!("{said} of 0 or more"));
        assert_eq!(
            refused::<u32>(wrong()),
            format!("{said} from 0 to {}", u32::MAX)
        );
        assert_eq!(
            refused::<u16>(wrong()),
            format!("{said} from 0 to {}", u16::MAX)
        );
        assert_eq!(
            refused::<u8>(wrong()),
            format!("{said} from 0 to {}", u8::MAX)
        );
        assert_eq!(
            refused::<NonZeroU64>(wrong()),
            format!("{said} of 1 or more")
        );
    }

    #[test]
    fn no_type_of_rust_is_named() {
        let wrong = || json!("x, expected u8");
        for message in [
            refused::<i8>(wrong()),
            refused::<i16>(wrong()),
            refused::<i32>(wrong()),
            refused::<i64>(wrong()),
            refused::<isize>(wrong()),
        ] {
            assert!(message.ends_with(", expected a whole number"), "{message}");
        }
        let said = "invalid type: string \"x, expected u8\", expected ";
        assert_eq!(refused::<f64>(wrong()), format!("{said}a number"));
        assert_eq!(refused::<f32>(wrong()), format!("{said}a number"));
        assert_eq!(refused::<bool>(wrong()), format!("{said}true or false"));
        assert_eq!(refused::<Vec<u8>>(wrong()), format!("{said}a list"));
        assert_eq!(refused::<RawTable>(wrong()), format!("{said}a table"));
        assert_eq!(refused::<Tagged>(wrong()), format!("{said}a table"));
        let map = refused::<BTreeMap<String, u8>>(wrong());
        assert_eq!(map, format!("{said}a table"));
    }

    #[test]
    fn numbers_without_room_are_too_large() {
        for expected in ["u64", "any valid TOML value"] {
            let message = format!(
                "invalid type: integer `1{:018}` as i128, expected {expected}",
                0
            );
            let said = without_type_names(&message);
            assert!(said.contains("` is too large"), "{said}");
        }
    }

    #[test]
    fn other_messages_stay_as_they_are() {
        for message in [
            "unknown field `usize`, expected one of `u64`, `u8`",
            "invalid type: integer `5`, expected a time such as \"0.5 s\"",
            "invalid type: integer `5`, expected struct of two parts",
            "loss is a probability, from 0 to 1",
            "",
        ] {
            assert_eq!(without_type_names(message), message);
        }
    }
}
