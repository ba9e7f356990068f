//! The `bess` command.
fn main() {}
