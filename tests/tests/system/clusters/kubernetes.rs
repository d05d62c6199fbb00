//! The manifest of an indexed Job: checked with the schemas of Kubernetes, and its tasks run as pods would run them.

use std::process::Command;

use serde_json::Value;
use system_tests::tools::{has_modules, python};
use system_tests::{programs, root};

use super::{Trial, UNITS, checked};

/// Number of units of a task.
const UNITS_PER_TASK: usize = 7;

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_pods_of_a_job_give_the_results_of_this_machine() {
    let install = "pip install kubernetes-validate";
    if !has_modules("Kubernetes", "kubernetes_validate, yaml", install) {
        return;
    }

    let trial = Trial::new();
    let folder = trial.plan("the volume's");
    let per_task = UNITS_PER_TASK.to_string();
    let args = [
        ["submit", "--engine", "kubernetes"].as_slice(),
        &[
            "--units-per-task",
            &per_task,
            "--limit",
            "2",
            "--processors",
            "2",
        ],
        &[
            "--image",
            "cars:local",
            "--claim",
            "experiments",
            "--path",
            "of a group/trial",
        ],
        &["--time-limit", "1 h"],
    ];
    let manifest = trial.cars(&args.concat(), &folder);
    let job = read(&manifest).unwrap();
    let spec = &job["spec"];
    assert_eq!(spec["completions"], UNITS.div_ceil(UNITS_PER_TASK));
    assert_eq!(spec["completionMode"], "Indexed");
    assert_eq!(spec["parallelism"], 2);
    let pod = &spec["template"]["spec"];
    assert_eq!(pod["activeDeadlineSeconds"], 3600);
    let container = &pod["containers"][0];
    let mount = &container["volumeMounts"][0];
    assert_eq!(mount["mountPath"], folder.to_str().unwrap());
    assert_eq!(mount["subPath"], "of a group/trial");

    // The last one first: pods come in any order.
    let command = texts(&container["command"]);
    for index in (0..UNITS.div_ceil(UNITS_PER_TASK)).rev() {
        let output = Command::new(&command[0])
            .args(&command[1..])
            .env_clear()
            .env("PATH", programs())
            .env("JOB_COMPLETION_INDEX", index.to_string())
            .current_dir("/")
            .output()
            .unwrap();
        checked(&output, &format!("task {index}"));
    }
    trial.cars(&["merge"], &folder);
    trial.assert_results(&folder);

    let wrong = manifest.replacen("  completions:", "  completion:", 1);
    let refusal = read(&wrong).unwrap_err();
    assert!(refusal.contains("completion"), "{refusal}");
}

/// Reads a manifest; refused if the schemas of Kubernetes do.
fn read(manifest: &str) -> Result<Value, String> {
    let output = python(&root().join("tests/clusters/manifest.py"), manifest);
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    Ok(serde_json::from_slice(&output.stdout).unwrap())
}

fn texts(list: &Value) -> Vec<String> {
    let list = list.as_array().unwrap();
    list.iter()
        .map(|text| text.as_str().unwrap().to_owned())
        .collect()
}
