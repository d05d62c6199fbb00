//! The answer to the question of an experiment: what the comparisons show, and what they do not.

use std::collections::BTreeMap;

use observe::Measure;
use pictures::Text;
use statistics::{Estimate, Interval};

use super::study::{Study, is_shown, label};
use experiments::{ArmDifference, Contrast, SHOWN_P, least_p_holm};

/// Most comparisons that a sentence names.
const MAX_NAMED: usize = 8;

/// The answer in one sentence: what the comparisons in a measure show, the first one of those that have comparisons.
pub(super) fn answer(study: &Study<'_>, measure: &Measure) -> Text {
    let mut contrasts = study.contrasts_of(measure);
    contrasts.retain(|contrast| contrast.p_holm.is_some());
    let Some(first) = contrasts.first() else {
        return "No arms are compared.".into();
    };
    let (label, baseline) = (label(measure), &first.baseline);

    // Arms that differ under the same conditions and in the same direction are named together.
    let mut shown: Vec<(bool, Vec<&str>, Vec<&str>)> = Vec::new();
    let mut others = Vec::new();
    for arm in study.arms {
        let of_arm = contrasts.iter().filter(|contrast| contrast.arm == arm.name);
        if of_arm.clone().next().is_none() {
            continue;
        }
        let mut is_shown_at_all = false;
        for is_more in [false, true] {
            let same = of_arm.clone().filter(|contrast| is_shown(contrast));
            let same = same.filter(|contrast| is_higher(contrast) == is_more);
            let conditions: Vec<&str> = same.map(|contrast| contrast.condition.as_str()).collect();
            if conditions.is_empty() {
                continue;
            }
            is_shown_at_all = true;
            let found = shown
                .iter_mut()
                .find(|(direction, under, _)| *direction == is_more && *under == conditions);
            match found {
                Some((_, _, arms)) => arms.push(&arm.name),
                None => shown.push((is_more, conditions, vec![&arm.name])),
            }
        }
        if !is_shown_at_all {
            others.push(arm.name.as_str());
        }
    }

    let pairs = contrasts.iter().map(|contrast| contrast.n);
    let n = match (pairs.clone().min(), pairs.max()) {
        (Some(least), Some(most)) if least < most => format!("n = {least} to {most} pairs"),
        (_, most) => format!("n = {} pairs each", most.unwrap_or(0)),
    };
    if shown.is_empty() {
        let text = Text::from(format!("No difference in {label} to "));
        let text = text.strong(baseline).text(" is shown for ");
        let text = listed(text, &others, "or");
        let too_few = match least_p_holm(&contrasts) >= SHOWN_P {
            true => ", which are too few to show one",
            false => "",
        };
        return text.text(format!(" ({n}{too_few})."));
    }

    let mut text = Text::default();
    for (index, (is_more, conditions, arms)) in shown.iter().enumerate() {
        text = listed(
            text.text(if index == 0 { "With " } else { "; with " }),
            arms,
            "and",
        );
        let under = under(study, conditions);
        text = text.text(format!(", {label} {}", how(study, measure, *is_more)));
        text = text.text(" ").strong(baseline).text(under);
    }
    if !others.is_empty() {
        text = listed(text.text("; no difference is shown for "), &others, "and");
    }
    text.text(format!(" ({n})."))
}

/// Names, of which the last one follows a word.
fn listed(mut text: Text, names: &[&str], word: &str) -> Text {
    for (index, name) in names.iter().enumerate() {
        if index > 0 {
            let is_last = index + 1 == names.len();
            text = text.text(if is_last {
                format!(" {word} ")
            } else {
                ", ".to_owned()
            });
        }
        text = text.strong(*name);
    }
    text
}

/// Under which conditions, as the end of a clause.
fn under(study: &Study<'_>, conditions: &[&str]) -> String {
    const MAX_CONDITIONS: usize = 3;
    let all = study.conditions.len();
    if all == 1 {
        return String::new();
    }
    if conditions.len() == all {
        return " under every condition".to_owned();
    }
    if conditions.len() > MAX_CONDITIONS {
        return format!(" under {} of {all} conditions", conditions.len());
    }
    let headings = conditions.iter().map(|name| study.heading_of(name));
    let headings: Vec<String> = headings.map(|heading| unbroken(&heading)).collect();
    format!(" under {}", headings.join(" and "))
}

/// Whether the numbers of an arm are larger, or its event comes later or in fewer runs.
fn is_higher(contrast: &Contrast) -> bool {
    mean(contrast).is_some_and(|mean| mean.value > 0.0)
}

/// What a difference is, before the name of the baseline.
fn how(study: &Study<'_>, measure: &Measure, is_more: bool) -> &'static str {
    match (measure.is_time(), is_more) {
        (false, true) => "is higher than with",
        (false, false) => "is lower than with",
        (true, true) if study.is_always_reached(measure) => "comes later than with",
        (true, false) if study.is_always_reached(measure) => "comes earlier than with",
        (true, true) => "comes later or in fewer runs than with",
        (true, false) => "comes earlier or in more runs than with",
    }
}

/// What all comparisons show, in one or two sentences.
pub(super) fn counts(study: &Study<'_>) -> Text {
    let tested = study.contrasts.iter().filter(|one| one.p_holm.is_some());
    let all = tested.count();
    let Some(first) = study.contrasts.first() else {
        return "No arms are compared: the experiment has no baseline, or no measure with `contrast = true`, or no seed was played in both arms. Its estimates are below.".into();
    };

    let count_shown = |contrasts: &[&Contrast]| {
        let shown = contrasts.iter().filter(|contrast| is_shown(contrast));
        shown.count()
    };
    let contrasts: Vec<&Contrast> = study.contrasts.iter().collect();
    let shown = count_shown(&contrasts);
    let mut counts = Vec::new();
    for measure in study.measures() {
        let contrasts = study.contrasts_of(measure);
        if let Some(first) = contrasts.first() {
            let (shown, of) = (count_shown(&contrasts), first.comparisons);
            counts.push(format!("{shown} of {of} in {}", label(measure)));
        }
    }
    let counts = counts.join(", ");
    let text = Text::from(format!("Of {all} comparisons with the arm "));
    let text = text.strong(&first.baseline).text(format!(
        ", {shown} show a difference after Holm's correction over the comparisons of each measure: {counts}."
    ));
    let others = study.contrasts.len() - all;
    if others == 0 {
        return text;
    }
    text.text(format!(
        " {others} more cannot be made: there are too few pairs of runs with a number, or their differences are not finite."
    ))
}

/// What the comparisons in a measure show: a sentence for each arm and direction, and what is not shown.
pub(super) fn sentences(study: &Study<'_>, measure: &Measure) -> Vec<Text> {
    let mut contrasts = study.contrasts_of(measure);
    contrasts.retain(|contrast| contrast.p_holm.is_some());
    let mut shown: BTreeMap<(usize, bool), Vec<&Contrast>> = BTreeMap::new();
    let mut others = 0;
    for contrast in &contrasts {
        if !is_shown(contrast) {
            others += 1;
            continue;
        }
        let arm = study.arms.iter().position(|arm| arm.name == contrast.arm);
        let Some(arm) = arm else {
            continue;
        };
        shown
            .entry((arm, is_higher(contrast)))
            .or_default()
            .push(contrast);
    }

    let mut sentences = Vec::new();
    for ((_, is_more), contrasts) in &shown {
        sentences.push(sentence(study, measure, contrasts, *is_more));
    }
    if others > 0 {
        sentences.push(not_shown(measure, &contrasts, others));
    }
    sentences
}

/// The mean difference of a contrast: that of its numbers, or of its times.
fn mean(contrast: &Contrast) -> Option<&Estimate> {
    match &contrast.difference {
        ArmDifference::Number { mean, .. } => Some(mean),
        ArmDifference::Time {
            restricted_mean_s, ..
        } => Some(restricted_mean_s),
        ArmDifference::NoPair | ArmDifference::NotFinite => None,
    }
}

fn sentence(study: &Study<'_>, measure: &Measure, contrasts: &[&Contrast], is_more: bool) -> Text {
    let Some(first) = contrasts.first() else {
        return Text::default();
    };

    let with_arm = Text::from("With ").strong(&first.arm);
    let compared = with_arm.text(format!(
        ", {} {} ",
        label(measure),
        how(study, measure, is_more)
    ));

    let mut named = Vec::new();
    for contrast in contrasts.iter().take(MAX_NAMED) {
        let heading = study.heading_of(&contrast.condition);
        let under = if heading.is_empty() {
            String::new()
        } else {
            format!("{} ", unbroken(&heading))
        };
        named.push(format!("{under}({})", numbers(study, measure, contrast)));
    }

    let mut text = format!(": {}", named.join("; "));
    if contrasts.len() > MAX_NAMED {
        let others = contrasts.len() - MAX_NAMED;
        text += &format!("; and {others} more, which are in the table");
    }
    compared.strong(&first.baseline).text(text + ".")
}

/// The name of a condition, whose lines break between its factors only.
fn unbroken(heading: &str) -> String {
    heading.replace(' ', "\u{a0}").replace(",\u{a0}", ", ")
}

/// The difference with its interval, n and p.
fn numbers(study: &Study<'_>, measure: &Measure, contrast: &Contrast) -> String {
    let unit = measure.unit.as_ref();
    let unit = unit.map_or_else(String::new, |unit| format!("\u{a0}{unit}"));
    let difference = match &contrast.difference {
        ArmDifference::Number { mean, .. } => with_interval(mean, &unit),
        ArmDifference::Time {
            restricted_mean_s, ..
        } if study.is_always_reached(measure) => with_interval(restricted_mean_s, "\u{a0}s"),
        ArmDifference::Time {
            share,
            restricted_mean_s,
            ..
        } => format!(
            "{}, {}",
            with_interval(&share.scaled(100.0), " points"),
            with_interval(restricted_mean_s, "\u{a0}s")
        ),
        ArmDifference::NoPair | ArmDifference::NotFinite => String::new(),
    };
    let p = contrast.p_holm.map_or_else(String::new, p_value);
    format!("{difference}, n = {}, {p}", contrast.n)
}

/// A difference with its sign and its interval.
fn with_interval(difference: &Estimate, unit: &str) -> String {
    let decimals = difference.decimals();
    let number = |value| statistics::signed(value, decimals).replace('-', "\u{2212}");
    let value = number(difference.value);
    match difference.interval {
        Interval::Ends { low, high } => {
            format!("{value}{unit} [{},\u{a0}{}]", number(low), number(high))
        }
        _ => format!("{value}{unit} in every pair"),
    }
}

/// A p value as it is printed.
pub(super) fn p_value(p: f64) -> String {
    if p < 0.001 {
        return "p < 0.001".to_owned();
    }
    format!("p = {p:.3}")
}

fn not_shown(measure: &Measure, contrasts: &[&Contrast], others: usize) -> Text {
    let all = contrasts.len();
    let what = if others == all {
        format!("In none of the {all} comparisons do the data")
    } else {
        format!("In the other {others} of {all} comparisons the data do not")
    };
    let mut text = format!(
        "{what} show a difference in {}: p is not below {SHOWN_P} after the correction{}. This is no evidence that there is none; the intervals show how \
         large one could be.",
        label(measure),
        with_zero(contrasts)
    );

    let least_p = least_p_holm(contrasts);
    if least_p >= SHOWN_P {
        text += &format!(
            " With so few pairs no difference can be shown in any of {all} comparisons: the least that p can be is {least_p:.3}. Play \
             more seeds."
        );
    }
    text.into()
}

/// How many of the differences that are not shown have an interval with zero in it.
fn with_zero(contrasts: &[&Contrast]) -> String {
    let mut count = 0;
    let mut all = 0;
    for contrast in contrasts.iter().filter(|contrast| !is_shown(contrast)) {
        let Some((low, high)) = mean(contrast).and_then(Estimate::bounds) else {
            continue;
        };
        all += 1;
        count += usize::from(low <= 0.0 && high >= 0.0);
    }

    if all == 0 {
        String::new()
    } else if count == all {
        ", and every interval includes zero".to_owned()
    } else {
        format!(", and {count} of {all} intervals include zero")
    }
}
