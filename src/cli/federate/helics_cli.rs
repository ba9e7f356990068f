//! The federation as a file for `helics run --path=`, for those who start all their federations that way.

use super::{Core, FederateArgs};
use crate::federation::Address;
use serde_json::{Value, json};
use std::path::Path;

/// Name of the file.
pub const FILE: &str = "helics_runner.json";

/// Its contents: the broker and one command for each federate.
pub fn document(args: &FederateArgs, name: &str, federates: &[String], folder: &Path) -> Value {
    let address = Address { port: args.port.unwrap_or(args.core.port()), ..args.address() };
    let port =
        if address.port == args.core.port() { String::new() } else { format!(" --port={}", address.port) };
    let listen = if args.listen == "127.0.0.1" {
        String::new()
    } else {
        format!(" --local_interface={}", args.listen)
    };
    // Federates over shared memory find their broker by its name, which must be that of every run of this file.
    let (broker_name, place) = match (args.core, &args.broker) {
        (Core::Ipc, None) => {
            let fixed = format!("bess_{name}");
            (fixed.clone(), format!(" --name={fixed} --local_interface={fixed}"))
        }
        _ => (args.broker_name(address.port), format!("{port}{listen}")),
    };
    let broker = format!(
        "helics_broker -f{} --coretype={} --dynamic --loglevel=error{place}",
        federates.len() + args.without.len(),
        address.core
    );
    let program =
        std::env::current_exe().map_or_else(|_| "bess".to_owned(), |path| path.display().to_string());
    let entry =
        |name: &str, exec: String| json!({"name": name, "directory": ".", "host": "localhost", "exec": exec});
    // A broker that is named is somebody's already.
    let mut entries = Vec::new();
    if args.broker.is_none() {
        entries.push(entry("broker", broker));
    }
    for federate in federates {
        let mut words = vec![program.clone()];
        words.extend(args.member(federate, &broker_name, folder));
        entries.push(entry(federate, words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")));
    }
    json!({"name": name, "federates": entries})
}

/// A word as a POSIX shell reads it.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_=./:,+@%".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}
