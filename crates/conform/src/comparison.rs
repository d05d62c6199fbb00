//! Two plays of the same ticks: where they differ first.

use serde_json::Value;

use crate::kit::Kit;
use crate::report::Failure;
use crate::script::Transcript;

/// What is shown of a value that differs, characters.
const SHOWN: usize = 200;

/// The first difference between the reports of two plays, in words: what the first has, and what the second has.
pub(crate) fn difference(one: &Transcript, two: &Transcript) -> Option<(String, String)> {
    for (one, two) in one.iter().zip(two) {
        if one.report == two.report {
            continue;
        }
        let tick = one.clock.tick;
        let (one, two) = (serde_json::json!(one.report), serde_json::json!(two.report));
        let of = |value: &Value, field: &str| value.get(field).cloned().unwrap_or(Value::Null);
        let fields = one
            .as_object()
            .into_iter()
            .chain(two.as_object())
            .flat_map(|fields| fields.keys());
        let field = fields
            .into_iter()
            .find(|field| of(&one, field) != of(&two, field))
            .cloned();
        let field = field.unwrap_or_default();
        let shown = |value: &Value| {
            let text: String = of(value, &field).to_string().chars().take(SHOWN).collect();
            format!("in tick {tick}, {field}: {text}")
        };
        return Some((shown(&one), shown(&two)));
    }
    (one.len() != two.len()).then(|| {
        (
            format!("{} ticks", one.len()),
            format!("{} ticks", two.len()),
        )
    })
}

/// Whether two plays gave the same reports.
pub(crate) fn is_same(one: &Transcript, two: &Transcript) -> bool {
    difference(one, two).is_none()
}

/// Demands that what happened made no difference. A robot that does not even repeat itself is told so by its own rule,
/// and by none else.
pub(crate) fn demand_same(
    kit: &Kit,
    what: &str,
    usual: &Transcript,
    other: &Transcript,
) -> Result<(), Failure> {
    if kit.is_deterministic.get() == Some(&false) {
        return Ok(());
    }
    match difference(usual, other) {
        None => Ok(()),
        Some((usual, other)) => Err(Failure::new(
            format!("{what} makes no difference: {usual}"),
            other,
        )),
    }
}
