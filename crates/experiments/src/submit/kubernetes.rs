//! Kubernetes: the manifest of an indexed Job.

use serde_json::Value;

use super::tasks::Tasks;

/// What Kubernetes is asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Kubernetes {
    /// The image with the program.
    pub image: String,
    /// The claim of the volume with the folder of the experiment.
    pub claim: String,
    /// The folder of the experiment in the volume; without it, the volume is the folder.
    pub path: Option<String>,
    /// Longest time of a task, seconds.
    pub limit_s: Option<u64>,
    /// Most tasks at the same time; without it, all.
    pub at_a_time: Option<u64>,
}

impl Kubernetes {
    /// The manifest as YAML. A pod finds its volume in the tasks' folder.
    #[must_use]
    pub fn manifest(&self, tasks: &Tasks) -> String {
        let name = tasks.job_name();
        let completions = tasks.count();
        let parallelism = self.at_a_time.unwrap_or(completions as u64);
        let processors = tasks.processors;
        let image = text(&self.image);
        let claim = text(&self.claim);
        let folder = text(&tasks.folder);
        let limit = self
            .limit_s
            .map(|limit_s| format!("      activeDeadlineSeconds: {limit_s}\n"));
        let limit = limit.unwrap_or_default();
        let path = self.path.as_deref().map(text);
        let path = path.map(|path| format!("              subPath: {path}\n"));
        let path = path.unwrap_or_default();

        let mut script = String::new();
        for line in tasks.script("JOB_COMPLETION_INDEX").lines() {
            script += &format!("              {line}\n");
        }
        format!(
            r#"apiVersion: batch/v1
kind: Job
metadata:
  name: {name}
spec:
  completionMode: Indexed
  completions: {completions}
  parallelism: {parallelism}
  # A task that fails is tried once more, for the sake of its node. The others go on.
  backoffLimitPerIndex: 1
  template:
    spec:
      restartPolicy: Never
{limit}      containers:
        - name: cars
          image: {image}
          command:
            - /bin/sh
            - -euc
            - |
{script}          resources:
            requests:
              cpu: {processors}
          volumeMounts:
            - name: experiment
              mountPath: {folder}
{path}      volumes:
        - name: experiment
          persistentVolumeClaim:
            claimName: {claim}
"#
        )
    }
}

/// A text in YAML, which reads those of JSON.
fn text(text: &str) -> String {
    Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_stay_texts() {
        let kubernetes = Kubernetes {
            image: "registry.example:5000/cars:1".to_owned(),
            claim: "on".to_owned(),
            path: Some("it's \"here\": #1".to_owned()),
            limit_s: Some(600),
            at_a_time: None,
        };
        let manifest = kubernetes.manifest(&Tasks::example());
        for line in [
            "  completions: 3",
            "  parallelism: 3",
            "      activeDeadlineSeconds: 600",
            "          image: \"registry.example:5000/cars:1\"",
            "              first=$((JOB_COMPLETION_INDEX * 4))",
            "              mountPath: \"/shared/two arms\"",
            r#"              subPath: "it's \"here\": #1""#,
            "            claimName: \"on\"",
        ] {
            assert!(
                manifest.lines().any(|found| found == line),
                "{line}:\n{manifest}"
            );
        }
    }
}
