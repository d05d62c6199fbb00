//! Programs that write to a pipe and do not flush it: what to tell the people who wrote them.
//!
//! A robot that `cars exec` runs answers on its standard output. Most languages keep output to a pipe back until a buffer is
//! full, so that a program that is right on a terminal never answers as a robot.

use std::ffi::{OsStr, OsString};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::Command;

/// How a language is told to flush. Each is known by a part of the interpreter's name, or by the ending of the file.
struct Hint {
    interpreters: &'static [&'static str],
    endings: &'static [&'static str],
    hint: &'static str,
}

const HINTS: [Hint; 8] = [
    Hint {
        interpreters: &["python"],
        endings: &["py"],
        hint: "in Python with print(…, flush=True), or sys.stdout.flush() after each line",
    },
    Hint {
        interpreters: &["perl"],
        endings: &["pl"],
        hint: "in Perl with $| = 1; at its beginning",
    },
    Hint {
        interpreters: &["ruby"],
        endings: &["rb"],
        hint: "in Ruby with $stdout.sync = true at its beginning",
    },
    Hint {
        interpreters: &["lua"],
        endings: &["lua"],
        hint: "in Lua with io.stdout:setvbuf(\"line\") at its beginning",
    },
    Hint {
        interpreters: &["awk"],
        endings: &["awk"],
        hint: "in awk with fflush() after each print",
    },
    Hint {
        interpreters: &["java"],
        endings: &["jar", "java"],
        hint: "in Java with System.out.flush() after each line",
    },
    Hint {
        interpreters: &["julia"],
        endings: &["jl"],
        hint: "in Julia with flush(stdout) after each line",
    },
    Hint {
        interpreters: &["bash", "sh", "dash", "zsh"],
        endings: &["sh"],
        hint: "in a shell with unbuffered commands in its pipelines: sed -u, grep --line-buffered, stdbuf -oL",
    },
];

/// What compiled programs do.
const COMPILED: &str = "in C with fflush(stdout) after each line, or setvbuf(stdout, NULL, _IOLBF, 0) at its beginning; in C++ \
                        with std::flush; in Rust with std::io::stdout().flush()";
/// Longest first line of a script that is looked at, bytes.
const MAX_FIRST_LINE: u64 = 256;

/// Why nothing arrives from a program, as far as can be known from outside, with the hint of its language. `command` is
/// the program with its arguments.
#[must_use]
pub fn unflushed(command: &[OsString]) -> String {
    let hint = hint(command).unwrap_or(
        "flush it after each line (C: fflush(stdout); Python: print(…, flush=True); Perl: $| = 1)",
    );
    format!(
        "its program has not flushed its standard output, or has written no whole line to it: what it writes to a pipe is \
         kept back until a buffer is full, unless it is flushed after each line, {hint}"
    )
}

/// The program that `cars exec` runs, with its arguments, if a robot's command is `cars exec … -- PROGRAM …`.
#[must_use]
pub fn program_of(command: &Command) -> Option<Vec<OsString>> {
    let mut arguments = command.get_args();
    arguments.find(|argument| *argument == "exec")?;
    arguments.find(|argument| *argument == "--")?;

    Some(arguments.map(OsStr::to_owned).collect())
}

fn hint(command: &[OsString]) -> Option<&'static str> {
    let program = PathBuf::from(command.first()?);
    let first_line = first_line(&program).unwrap_or_default();
    if first_line.starts_with(b"\x7fELF") {
        let named = by_interpreter(&program.file_name()?.to_string_lossy());
        return named.or(Some(COMPILED));
    }

    let interpreter = String::from_utf8_lossy(&first_line).into_owned();
    let script = interpreter.strip_prefix("#!").and_then(by_interpreter);
    script.or_else(|| by_ending(program.extension()?.to_str()?))
}

/// The hint of an interpreter, from its path or from the first line of a script.
fn by_interpreter(line: &str) -> Option<&'static str> {
    let words = line.split(['/', ' ', '\n']);
    let names: Vec<&str> = words
        .map(|word| word.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.'))
        .collect();

    let found = HINTS.iter().find(|hint| {
        hint.interpreters
            .iter()
            .any(|interpreter| names.contains(interpreter))
    });
    found.map(|hint| hint.hint)
}

fn by_ending(ending: &str) -> Option<&'static str> {
    let found = HINTS.iter().find(|hint| hint.endings.contains(&ending));
    found.map(|hint| hint.hint)
}

/// The first line of a program, which is looked for as the system does.
fn first_line(program: &Path) -> Option<Vec<u8>> {
    let mut places = vec![program.to_owned()];
    if program.components().count() == 1 {
        let path = std::env::var_os("PATH")?;
        places.extend(std::env::split_paths(&path).map(|folder| folder.join(program)));
    }

    let file = places
        .iter()
        .filter(|place| place.is_file())
        .find_map(|place| std::fs::File::open(place).ok())?;
    let mut line = Vec::new();
    BufReader::new(file)
        .take(MAX_FIRST_LINE)
        .read_until(b'\n', &mut line)
        .ok()?;
    Some(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(command: &[&str]) -> Vec<OsString> {
        command.iter().map(OsString::from).collect()
    }

    #[test]
    fn the_remedy_is_that_of_the_language() {
        let folder = tempfile::tempdir().unwrap();
        for (name, first_line, hint) in [
            ("robot", "#!/usr/bin/env python3", "flush=True"),
            ("robot.py", "import sys", "flush=True"),
            ("robot.pl", "use strict;", "$| = 1"),
            ("robot.x", "#!/usr/bin/perl -w", "$| = 1"),
            ("robot.mjs", "import fs from 'fs'", "fflush(stdout); Python"),
            ("robot.sh", "#!/bin/bash", "stdbuf -oL"),
            ("robot.bin", "\u{7f}ELF", "setvbuf(stdout"),
        ] {
            let file = folder.path().join(name);
            std::fs::write(&file, format!("{first_line}\n")).unwrap();
            let text = unflushed(&words(&[file.to_str().unwrap()]));
            assert!(text.contains(hint), "{name}: {text}");
        }

        let text = unflushed(&words(&["no-such-program"]));
        assert!(text.contains("flush it after each line"), "{text}");
    }

    #[test]
    fn the_program_of_exec_is_found() {
        let mut command = Command::new("cars");
        command.args(["exec", "--name", "A", "--", "./a", "-x"]);
        assert_eq!(program_of(&command), Some(words(&["./a", "-x"])));
        assert_eq!(program_of(Command::new("./a").arg("--")), None);
    }
}
