//! States of measures that are no numbers, and words that are misspelled.

use system_tests::{Lab, root};

use super::{HALL, cars, in_one_line, json, ok, rows};

/// An experiment of two arms about the hall with these measures.
fn experiment(lab: &Lab, measures: &str) -> String {
    let scenario = root().join(HALL);
    let text = format!(
        "question = '?'\nscenario = {scenario:?}\nduration = '60 s'\nseeds = 3\nbaseline = 'plain'\n\
         [[arm]]\nname = 'plain'\n[[arm]]\nname = 'lossy'\nset = ['network.commands.loss=1.0']\n{measures}"
    );
    let file = lab.write("experiment.toml", &text);
    file.to_str().unwrap().to_owned()
}

#[test]
fn what_is_not_a_number_has_a_state() {
    let lab = Lab::new();
    let file = experiment(
        &lab,
        "[[measure]]\nname = 't'\n[measure.time]\nafter = { event = 'command_dropped' }\n\
         to = { event = 'behavior', robot = 'Butler', to = 'FLY' }\n\
         [[measure]]\nname = 'mean'\n[measure.between]\nbegin = { event = 'command_dropped' }\n\
         end = { event = 'behavior', robot = 'Butler', to = 'FLY' }\nas = 'mean'\n\
         [[measure]]\nname = 'count'\n[measure.between]\nbegin = { event = 'command_dropped' }\n\
         end = { event = 'behavior', robot = 'Butler', to = 'FLY' }\nas = 'count'\n\
         [[measure]]\nname = 'gone'\nsummary = 'robots.Butler.state_variables.nothing'\n\
         [[measure]]\nname = 'never sent'\nsummary = 'robots.Butler.sent.fly'\n",
    );
    let out = lab.out().join("states");
    let printed = ok(&["run", &file, "-o", out.to_str().unwrap()]);
    assert!(
        printed.contains("the measure \"gone\": the summary of the run has no number `robots.Butler.state_variables.nothing`, in any run"),
        "{printed}"
    );
    let all = json(&["run", &file, "-o", out.to_str().unwrap()]);
    for run in all["runs"].as_array().unwrap() {
        let state = |measure: &str| run["measures"][measure]["state"].as_str().unwrap();
        let (time, mean) = match run["arm"].as_str().unwrap() {
            "plain" => ("not_at_risk", "no_pair"),
            _ => ("not_reached", "unfinished"),
        };
        assert_eq!((state("t"), state("mean")), (time, mean), "{run}");
        assert_eq!(run["measures"]["count"]["value"], 0.0);
        assert_eq!(state("gone"), "missing");
        assert_eq!(run["measures"]["never sent"]["value"], 0.0);
    }
    assert_eq!(rows(&out).len(), 6);
}

#[test]
fn a_word_that_never_occurs_is_named() {
    let lab = Lab::new();
    let file = experiment(
        &lab,
        "[[measure]]\nname = 'calm'\nshare = { robot = 'Butler', emotion = ['HAPY', 'HAPPY'] }\n\
         [[measure]]\nname = 'rage'\nsummary = 'robots.Butler.emotions_s.FRUSTRATD'\n\
         [[measure]]\nname = 'calls'\ncount = { event = 'command_sent', command = 'reffil' }\n\
         [[measure]]\nname = 'serves'\ncount = { event = 'behavior', robot = 'Butler', to = 'SERVE' }\n",
    );
    let out = lab.out().join("words");
    let printed = ok(&["run", &file, "-o", out.to_str().unwrap()]);
    for sentence in [
        "the emotion \"HAPY\" of Butler never occurred in any run; did you mean HAPPY?",
        "the command \"reffil\" never occurred in any run; did you mean refill?",
    ] {
        assert!(printed.contains(sentence), "{printed}");
    }
    assert!(!printed.contains("SERVE"), "{printed}");
    let results = std::fs::read_to_string(out.join("results.json")).unwrap();
    assert!(results.contains("never occurred in any run"), "{results}");
}

#[test]
fn a_variable_that_no_arm_has_is_refused_before_the_runs() {
    let lab = Lab::new();
    let file = experiment(
        &lab,
        "[[measure]]\nname = 'served'\nvariable = { robot = 'Butler', name = 'servd', as = 'end' }\n",
    );
    let out = lab.out().join("variables");
    let out = out.to_str().unwrap();
    let (code, printed) = cars(&["run", &file, "-o", out]);
    assert_eq!(code, 1);
    assert!(
        printed.contains("Butler has no state variable `servd`; it has "),
        "{printed}"
    );
    assert!(printed.contains(" served"), "{printed}");

    // Of processes it is known after a run of each arm.
    let (code, printed) = cars(&["run", &file, "-o", out, "--processes", "--seeds", "20"]);
    assert_eq!(code, 1);
    assert!(
        printed.contains("in no arm; 2 of 40 units have been played"),
        "{printed}"
    );
}

#[test]
fn arms_that_are_the_same_are_named() {
    let lab = Lab::new();
    let file = experiment(
        &lab,
        "[[arm]]\nname = 'again'\n[[measure]]\nname = 'ticks'\nsummary = 'ticks'\n",
    );
    let out = lab.out().join("same");
    let said = "the arms \"plain\" and \"again\" play the same runs under every condition";
    let printed = ok(&["run", &file, "-o", out.to_str().unwrap()]);
    assert!(printed.contains(said), "{printed}");
    let (code, printed) = lab.cars_without_out(&["check", &file]);
    assert_eq!(code, 0, "{printed}");
    assert!(in_one_line(&printed).contains(said), "{printed}");
}

#[test]
fn an_empty_file_is_refused_with_a_reason() {
    let lab = Lab::new();
    for text in ["", "\n\n", "# nothing\n"] {
        let file = lab.write("empty.toml", text);
        let file = file.to_str().unwrap();
        let (code, printed) = cars(&["run", file]);
        assert_eq!(code, 1);
        assert!(
            printed.contains("is empty: it is not an experiment"),
            "{printed}"
        );
        let (code, printed) = lab.cars_without_out(&["check", file]);
        assert_eq!(code, 1, "{printed}");
        let printed = in_one_line(&printed);
        assert!(
            printed.contains("is empty: it is neither a scenario"),
            "{printed}"
        );
    }
}
