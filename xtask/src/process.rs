//! Starting other programs: their output streams through, their exit code is the result.

use crate::{error::Failure, workspace::Workspace};
use std::{
    ffi::OsStr,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

/// A command that runs in the workspace root and reads no standard input.
pub fn command(workspace: &Workspace, program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(&workspace.root).stdin(Stdio::null());
    command
}

/// The cargo that started this program.
pub fn cargo(workspace: &Workspace) -> Command {
    command(workspace, std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Runs to the end, output streamed.
pub fn run(command: &mut Command) -> Result<(), Failure> {
    let shown = shown(command);
    eprintln!("$ {shown}");
    let status = command.status().map_err(|source| Failure::Start { command: shown.clone(), source })?;
    if status.success() { Ok(()) } else { Err(Failure::Command { command: shown, status }) }
}

/// Runs to the end and gives back standard output; standard error is streamed.
pub fn output(command: &mut Command) -> Result<String, Failure> {
    let shown = shown(command);
    let Output { status, stdout, .. } = command
        .stderr(Stdio::inherit())
        .output()
        .map_err(|source| Failure::Start { command: shown.clone(), source })?;
    if !status.success() {
        return Err(Failure::Command { command: shown, status });
    }
    String::from_utf8(stdout)
        .map_err(|_| Failure::Other(format!("`{shown}` printed something that is not UTF-8")))
}

/// Whether the command runs and succeeds; nothing is shown.
pub fn succeeds(command: &mut Command) -> bool {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Where PATH has this program.
pub fn on_path(program: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|folder| folder.join(program)).find(|file| file.is_file())
}

/// The command line as one would type it from the workspace root.
fn shown(command: &Command) -> String {
    let root = command.get_current_dir().unwrap_or(Path::new(""));
    let program = Path::new(command.get_program());
    // The full path of cargo or python says nothing to a reader; a path in the workspace does.
    let program = match inside(root, command.get_program()) {
        Some(path) => path,
        None => program.file_name().unwrap_or(program.as_os_str()),
    };
    let arguments = command.get_args().map(|argument| inside(root, argument).unwrap_or(argument));
    std::iter::once(program).chain(arguments).map(quoted).collect::<Vec<_>>().join(" ")
}

/// The rest of a path that lies in this folder.
fn inside<'a>(folder: &Path, path: &'a OsStr) -> Option<&'a OsStr> {
    Path::new(path).strip_prefix(folder).ok().map(Path::as_os_str)
}

fn quoted(argument: &OsStr) -> String {
    let text = argument.to_string_lossy();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_=./:+,@".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.into_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_shown_as_typed() {
        let mut command = Command::new("/opt/rust/bin/cargo");
        command.current_dir("/somewhere").args(["test", "it's", "", "a/b.json"]);
        assert_eq!(shown(&command), r"cargo test 'it'\''s' '' a/b.json");
        let mut inside = Command::new("/somewhere/target/release/bess");
        inside.current_dir("/somewhere").args(["-o", "/somewhere/results", "/else/where"]);
        assert_eq!(shown(&inside), "target/release/bess -o results /else/where");
    }

    #[test]
    fn exit_codes_become_results() {
        assert!(run(&mut Command::new("true")).is_ok());
        let failure = run(Command::new("sh").args(["-c", "exit 3"])).expect_err("exit 3 is a failure");
        assert_eq!(failure.to_string(), "`sh -c 'exit 3'` failed (exit status: 3)");
        let missing = run(&mut Command::new("no-such-program-here")).expect_err("cannot start");
        assert!(missing.to_string().starts_with("cannot start `no-such-program-here`"));
    }

    #[test]
    fn output_is_taken_and_a_failure_is_not_an_empty_output() {
        assert_eq!(output(Command::new("printf").arg("a b")).expect("runs"), "a b");
        assert!(output(&mut Command::new("false")).is_err());
    }
}
