//! The scripts of a farm: assignments of values, followed by a text that is the same for all renderings.

/// Names and texts of the scripts.
const SCRIPTS: [(&str, &str); 3] = [
    ("part.sh", include_str!("farm/part.sh")),
    ("merge.sh", include_str!("farm/merge.sh")),
    ("submit.sh", include_str!("farm/submit.sh")),
];

/// Replaces `# FRAME` in scripts that work on one frame.
const FRAME: &str = include_str!("farm/frame.sh");

/// Values for the scripts.
#[derive(Clone, Debug, Default)]
pub(super) struct Job {
    /// Path of the program.
    pub(super) lumiris: String,
    /// Working folder, to which paths are relative.
    pub(super) from: String,
    /// The folder of scripts, parts and logs.
    pub(super) folder: String,
    pub(super) scene: String,
    /// Frame numbers; empty for a single image.
    pub(super) frames: Vec<u32>,
    /// Number of parts per image.
    pub(super) parts: u32,
    /// Time between checkpoints (s).
    pub(super) seconds: f64,
    /// True if the number of threads is given.
    pub(super) has_threads: bool,
    /// Options of `lumiris render`, `lumiris merge` and `sbatch`.
    pub(super) options: [Vec<String>; 3],
}

impl Job {
    /// Names and texts of the scripts.
    pub(super) fn scripts(&self) -> Vec<(&'static str, String)> {
        // Assignments
        let flag = |is: bool| if is { "yes" } else { "" };
        let words =
            [("lumiris", &self.lumiris), ("from", &self.from), ("folder", &self.folder), ("scene", &self.scene)];
        let words: String = words.iter().map(|(name, value)| format!("{name}={}\n", quoted(value))).collect();
        let frames: Vec<String> = self.frames.iter().map(u32::to_string).collect();
        let numbers = format!(
            "frames=({})\nparts={}\nseconds={}\nhas_threads={}\n",
            frames.join(" "),
            self.parts,
            self.seconds,
            flag(self.has_threads)
        );

        // Scripts
        let script = |((name, body), options): (&(&'static str, &str), &Vec<String>)| {
            let options: Vec<String> = options.iter().map(|word| quoted(word)).collect();
            let options = options.join(" ");
            let body = body.replace("# FRAME\n", FRAME);
            (*name, format!("#!/bin/bash\n{words}{numbers}options=({options})\n\n{body}"))
        };
        SCRIPTS.iter().zip(&self.options).map(script).collect()
    }
}

/// Quotes a word for the shell.
pub(super) fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-=,:@%+".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn a_shell_reads_the_words_that_were_quoted() {
        let words = ["", "a b", "it's", "\"$HOME\" `ls` \\", "new\nline", "*", "~", "#", "!x", "-o", "ä;&|<>(){}"];
        let text: Vec<String> = words.iter().map(|word| quoted(word)).collect();
        let out = Command::new("bash").args(["-c", &format!("printf '%s\\0' {}", text.join(" "))]).output().unwrap();
        let read: Vec<&str> = std::str::from_utf8(&out.stdout).unwrap().split_terminator('\0').collect();
        assert_eq!(read, words);
    }

    #[test]
    fn scripts_are_those_of_a_shell() {
        let job = Job { folder: "it's here".to_owned(), ..Job::default() };
        for (name, text) in job.scripts() {
            let out = Command::new("bash").args(["-n", "-c", &text]).output().unwrap();
            assert!(out.status.success(), "{name}: {}", String::from_utf8_lossy(&out.stderr));
        }
    }
}
