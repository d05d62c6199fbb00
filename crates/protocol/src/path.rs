//! The path of the field at which JSON could not be read, found in the text itself: so reading a message needs no second version
//! of its code that keeps track of paths.

/// What encloses a place in JSON.
enum JsonLevel {
    /// An object, and its field that was named last.
    Object {
        field: Option<String>,
        expects_name: bool,
    },
    /// An array, and the index of its element.
    Array(usize),
}

/// The path of the field in `json` at which reading it failed, such as `commands[0].from`; `.` for the whole text.
pub(crate) fn of(error: &serde_json::Error, json: &[u8]) -> String {
    let end = offset(error, json);
    let mut levels = Vec::new();
    let mut at = 0;
    while at < end {
        let mut next = at + 1;
        match json[at] {
            b'"' => {
                next = end_of_text(json, at).min(end);
                name_field(&mut levels, &json[at + 1..next]);
            }
            b'{' => levels.push(JsonLevel::Object {
                field: None,
                expects_name: true,
            }),
            b'[' => levels.push(JsonLevel::Array(0)),
            b'}' | b']' => drop(levels.pop()),
            b':' => expect_value(&mut levels),
            b',' => go_on(&mut levels),
            _ => {}
        }
        at = next;
    }
    // What is wrong right behind the bracket is that there is an array.
    if json[..end].ends_with(b"[") {
        levels.pop();
    }

    written(&levels)
}

/// Bytes before the place where the error is. Columns are bytes, and lines and columns are counted from 1.
fn offset(error: &serde_json::Error, json: &[u8]) -> usize {
    let lines = json.split_inclusive(|byte| *byte == b'\n');
    let before: usize = lines
        .take(error.line().saturating_sub(1))
        .map(<[u8]>::len)
        .sum();

    (before + error.column()).min(json.len())
}

/// The place behind the text whose first quotation mark is at `start`.
fn end_of_text(json: &[u8], start: usize) -> usize {
    let mut at = start + 1;
    while at < json.len() {
        match json[at] {
            b'\\' => at += 2,
            b'"' => return at + 1,
            _ => at += 1,
        }
    }
    json.len()
}

/// A text where an object expects a name is that of its next field.
fn name_field(levels: &mut [JsonLevel], text: &[u8]) {
    if let Some(JsonLevel::Object {
        field,
        expects_name: true,
    }) = levels.last_mut()
    {
        let name = text.strip_suffix(b"\"").unwrap_or(text);
        *field = Some(String::from_utf8_lossy(name).into_owned());
    }
}

fn expect_value(levels: &mut [JsonLevel]) {
    if let Some(JsonLevel::Object { expects_name, .. }) = levels.last_mut() {
        *expects_name = false;
    }
}

fn go_on(levels: &mut [JsonLevel]) {
    match levels.last_mut() {
        Some(JsonLevel::Object {
            field,
            expects_name,
        }) => {
            *field = None;
            *expects_name = true;
        }
        Some(JsonLevel::Array(index)) => *index += 1,
        None => {}
    }
}

fn written(levels: &[JsonLevel]) -> String {
    let mut path = String::new();
    for level in levels {
        match level {
            JsonLevel::Object {
                field: Some(field), ..
            } => {
                if !path.is_empty() {
                    path.push('.');
                }
                path += field;
            }
            JsonLevel::Object { field: None, .. } => {}
            JsonLevel::Array(index) => path += &format!("[{index}]"),
        }
    }

    if path.is_empty() {
        path.push('.');
    }
    path
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[expect(dead_code, reason = "only read")]
    struct Outer {
        inner: Inner,
        list: Vec<Vec<u8>>,
        #[serde(default)]
        map: BTreeMap<String, bool>,
    }

    #[derive(Debug, Deserialize)]
    #[expect(dead_code, reason = "only read")]
    struct Inner {
        number: f64,
        text: String,
    }

    fn check(json: &str, path: &str) {
        let error = serde_json::from_str::<Outer>(json).unwrap_err();
        assert_eq!(of(&error, json.as_bytes()), path, "{json}: {error}");
    }

    #[test]
    fn a_wrong_value_is_named() {
        check(
            r#"{"inner":{"number":"x","text":""},"list":[]}"#,
            "inner.number",
        );
        check(
            r#"{"inner":{"number":{},"text":""},"list":[]}"#,
            "inner.number",
        );
        check(
            r#"{"inner":{"number":1,"text":null},"list":[]}"#,
            "inner.text",
        );
        check(
            r#"{"list":[[1,2],[3,256]],"inner":{"number":1,"text":""}}"#,
            "list[1][1]",
        );
        check(r#"{"map":{"a":true,"b c":1}}"#, "map.b c");
        check(
            "{\n  \"inner\": {\n    \"number\": true\n  }\n}",
            "inner.number",
        );
    }

    #[test]
    fn a_missing_field_is_one_of_the_object() {
        check(r#"{"inner":{"number":1},"list":[]}"#, "inner");
        check(r#"{"list":[]}"#, ".");
    }

    #[test]
    fn names_and_texts_may_have_signs_of_json() {
        check(r#"{"map":{"{[,:\"":true,"}]":7}}"#, "map.}]");
        check(
            r#"{"inner":{"text":"a\",{[:","number":"}"}}"#,
            "inner.number",
        );
    }

    #[test]
    fn what_is_no_json_has_a_path_as_well() {
        check("", ".");
        check("{", ".");
        check("[1", "[0]");
        check("[", ".");
        check(r#"{"inner":{"number":1,"text":["#, "inner.text");
        check(r#"{"inner":{"number":1e"#, "inner.number");
        check(r#"{"inner":{"number":1,"te"#, "inner.te");
        check(r#"{"inner":{"number":1,"text":""},"list":[]} {"#, ".");
        check("\\", ".");
    }
}
