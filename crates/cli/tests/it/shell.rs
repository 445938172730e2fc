//! Installation, completions and manual pages.

use std::path::Path;
use std::process::Command;

const BINARY: &str = env!("CARGO_BIN_EXE_lumiris");

/// The standard output of a command that succeeds.
fn output(program: &str, args: &[&str]) -> String {
    let output = Command::new(program).args(args).output().unwrap_or_else(|e| panic!("{program}: {e}"));
    let (out, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{program} {args:?}: {out}{errors}");
    out.into_owned()
}

/// `make install` of the program under test, into a folder.
fn install(prefix: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    // Already built by the test runner
    let (binary, prefix) = (format!("BINARY={BINARY}"), format!("PREFIX={}", prefix.display()));
    output("make", &["-C", &root.display().to_string(), "install", "CARGO=true", &binary, &prefix]);
}

#[test]
fn make_install_puts_program_completions_and_manual_where_shells_look() {
    let folder = tempfile::tempdir().unwrap();
    install(folder.path());
    let program = folder.path().join("bin/lumiris").display().to_string();
    assert!(output(&program, &["--version"]).starts_with("lumiris "));
    let share = folder.path().join("share");

    let bash = share.join("bash-completion/completions/lumiris").display().to_string();
    let script = format!(
        "source {bash}; compopt() {{ :; }}; COMP_WORDS=(lumiris render --estimator o); COMP_CWORD=3; \
         _lumiris lumiris o --estimator; echo \"${{COMPREPLY[@]}}\""
    );
    assert_eq!(output("bash", &["-c", &script]).trim(), "ocv optimal-mis");

    let fish = share.join("fish/vendor_completions.d/lumiris.fish").display().to_string();
    let offered = output("fish", &["--no-config", "-c", &format!("source {fish}; complete -C 'lumiris cr'")]);
    assert!(offered.starts_with("crosscheck\t"), "{offered}");
    let offered =
        output("fish", &["--no-config", "-c", &format!("source {fish}; complete -C 'lumiris render --packet-'")]);
    assert!(offered.starts_with("--packet-width\t"), "{offered}");

    let zsh = share.join("zsh/site-functions").display().to_string();
    let script = format!("fpath=({zsh}); autoload -Uz _lumiris; autoload +X _lumiris; whence -w _lumiris");
    assert_eq!(output("zsh", &["-f", "-c", &script]).trim(), "_lumiris: function");
    output("zsh", &["-f", "-n", &format!("{zsh}/_lumiris")]);

    let page = |name: &str| std::fs::read_to_string(share.join("man/man1").join(name)).unwrap();
    assert!(page("lumiris.1").contains("lumiris\\-render(1)"), "{}", page("lumiris.1"));
    let help = output(BINARY, &["--help"]);
    let commands = help.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    // The rest of a description may follow on a separate line, further to the right
    let names = commands.filter_map(|l| l.strip_prefix("  ")?.split(' ').next().filter(|name| !name.is_empty()));
    let names: Vec<&str> = names.collect();
    assert!(names.contains(&"render") && names.len() >= 10, "{help}");
    for name in names.iter().filter(|name| **name != "help") {
        let page = page(&format!("lumiris-{name}.1"));
        assert!(page.contains(".TH") && page.contains(&format!("lumiris\\-{name}")), "{page}");
    }
    assert!(page("lumiris-render.1").contains("\\-\\-estimator"));
}

/// Number of help lines that begin with an option.
fn options(help: &str) -> usize {
    let begins = |line: &&str| {
        let rest = line.trim_start();
        // Continuation lines can begin with the name of another option, but are indented more
        (1..=6).contains(&(line.len() - rest.len())) && rest.starts_with('-') && rest.contains("--")
    };
    help.lines().filter(begins).count()
}

#[test]
fn help_of_render_is_short_enough_to_be_read() {
    let [long, short] = ["--help", "-h"].map(|flag| output(BINARY, &["render", flag]));
    assert!((60..=80).contains(&options(&long)), "{}: {long}", options(&long));
    assert_eq!(options(&short), 24, "{short}");
    assert!(long.contains("\nResearch:\n") && !short.contains("Research"), "{short}");
    assert_eq!(long.matches("the file's, or").count(), 1, "{long}");
}

#[test]
fn an_unknown_shell_is_a_usage_error_and_a_file_in_place_of_a_folder_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    let code = |args: &[&str]| Command::new(BINARY).args(args).output().unwrap().status.code();
    assert_eq!(code(&["completions", "command.com"]), Some(2));
    let taken = folder.path().join("taken");
    std::fs::write(&taken, "").unwrap();
    assert_eq!(code(&["man", "-o", &taken.display().to_string()]), Some(3));
}
