//! docs/mistakes.md: the likeliest mistakes of a person, each made anew here, with what `bess` prints. A message that
//! changes makes the page stale: `cargo xtask generate mistakes` writes it.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used)]

#[path = "mistakes/list.rs"]
mod list;

use list::{Content, MISTAKES, Mistake};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/mistakes.md");

const HEAD: &str = "# The likeliest mistakes

You typed something and `bess` refused it, or warned you. Here are the mistakes that are made most, each with the command,
what is printed, and how to mend it. All output below was printed by this version: a test makes every mistake again and
compares. (Quotation marks around `'PATH=VALUE'` are for the shell.) Nothing is written by a run that is refused.

| exit code | means |
|---|---|
| 0 | done; lines that begin with `warning:` want to be read |
| 1 | the run or a file failed |
| 2 | the command line or the scenario is wrong |
| 3 | an FMU crashed or hung in its own process (`--isolate`) |

Looking for something else: `bess schema` prints the JSON Schema for your editor, `bess show case1` a scenario with every key,
`bess check MyGrid.fmu` what is wrong with an FMU.
";

/// An archive with this model description and no more than an empty library for Windows.
fn write_fmu(file: &Path, description: &str) {
    let mut archive = zip::ZipWriter::new(std::fs::File::create(file).unwrap());
    let options = zip::write::SimpleFileOptions::default();
    archive.start_file("modelDescription.xml", options).unwrap();
    archive.write_all(description.as_bytes()).unwrap();
    archive.start_file("binaries/win64/MyGrid.dll", options).unwrap();
    archive.finish().unwrap();
}

/// Makes the mistake in an empty folder and gives what was printed; checks the exit code, and that a refused run has
/// left nothing behind.
fn make(mistake: &Mistake) -> String {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in mistake.files {
        let file = folder.path().join(name);
        match content {
            Content::Text(text) => std::fs::write(&file, text).unwrap(),
            Content::Fmu(description) => write_fmu(&file, description),
        }
    }
    let words = mistake.command.split_whitespace().map(|word| word.trim_matches('\''));
    let mut bess = Command::new(env!("CARGO_BIN_EXE_bess"));
    bess.args(words.skip(1)).current_dir(folder.path());
    bess.env_remove("COLUMNS").env("NO_COLOR", "1").env("LC_ALL", "C.UTF-8");
    let output = bess.output().unwrap();
    let (out, err) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(mistake.code), "{}: {err}", mistake.title);
    if mistake.code == 2 {
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, mistake.files.len(), "{}: a refused run has written something", mistake.title);
    }
    let printed = format!("{err}{out}");
    let lines: Vec<&str> = printed.lines().map(str::trim_end).skip_while(|line| line.is_empty()).collect();
    lines.join("\n").trim_end().to_owned()
}

fn page() -> String {
    let mut page = HEAD.to_owned();
    for (k, mistake) in MISTAKES.iter().enumerate() {
        let _ = write!(page, "\n## {}. {}\n\n", k + 1, mistake.title);
        for (name, content) in mistake.files {
            if let Content::Text(text) = content
                && name.ends_with(".json")
            {
                let _ = write!(page, "`{name}`:\n\n```json\n{text}\n```\n\n");
            }
        }
        let printed = make(mistake);
        let _ = write!(page, "```console\n$ {}\n{printed}\n```\n\n", mistake.command);
        let _ = writeln!(page, "Exit code {}. {}", mistake.code, mistake.mend);
    }
    page
}

#[test]
fn the_page_of_mistakes_says_what_is_printed() {
    let made = page();
    if std::env::var_os("BESS_WRITE_MISTAKES").is_some() {
        std::fs::write(PAGE, &made).unwrap();
    }
    let published = std::fs::read_to_string(PAGE).unwrap_or_default();
    for (made, published) in made.lines().zip(published.lines()) {
        assert_eq!(
            made, published,
            "docs/mistakes.md is stale: write it with `cargo xtask generate mistakes`"
        );
    }
    assert!(made == published, "docs/mistakes.md is stale: write it with `cargo xtask generate mistakes`");
}

#[test]
fn every_mistake_is_told_where_it_was_made() {
    assert!(MISTAKES.len() >= 20, "{}", MISTAKES.len());
    for mistake in MISTAKES {
        let said = make(mistake).split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ");
        for part in mistake.says {
            assert!(said.contains(part), "{}: {said:?} does not say {part:?}", mistake.title);
        }
    }
}
