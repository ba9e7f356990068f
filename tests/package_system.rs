//! `bess export --portable` and `bess export system`: what is in the archives, and what is refused. That masters
//! run them is shown by `tests/masters`.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::io::{Cursor, Read};
use std::path::Path;
use std::process::{Command, Output};

/// Runs `bess export` in a folder that holds something in the place of the shared libraries.
fn export(folder: &Path, arguments: &[&str]) -> Output {
    let libraries = folder.join("libraries");
    std::fs::create_dir_all(&libraries).unwrap();
    for identifier in ["BessConsensus", "BessGrid"] {
        let name = bess_consensus::package::library_file_name(identifier);
        std::fs::write(libraries.join(name), identifier).unwrap();
    }
    Command::new(env!("CARGO_BIN_EXE_bess"))
        .arg("export")
        .args(arguments)
        .args(["--libraries", "libraries"])
        .current_dir(folder)
        .output()
        .unwrap()
}

fn archive(bytes: Vec<u8>) -> BTreeMap<String, Vec<u8>> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let names: Vec<String> = archive.file_names().map(|name| name.unwrap().into_owned()).collect();
    let mut contents = BTreeMap::new();
    for name in names {
        let mut bytes = Vec::new();
        archive.by_name(&name).unwrap().read_to_end(&mut bytes).unwrap();
        contents.insert(name, bytes);
    }
    contents
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Exports to `file` and gives back what is in it.
fn exported(arguments: &[&str], file: &str) -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let output = export(folder.path(), arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    archive(std::fs::read(folder.path().join(file)).unwrap())
}

/// Refused with this code, all of these words, and no file.
fn refused(arguments: &[&str], code: i32, parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let output = export(folder.path(), arguments);
    let said = text(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(output.status.code(), Some(code), "{said}");
    for part in parts {
        assert!(said.contains(part), "{said} does not say {part}");
    }
    let left = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(left, 1, "something was written beside the libraries");
}

/// The values of an attribute, in order.
fn values<'a>(xml: &'a str, attribute: &'a str) -> impl Iterator<Item = &'a str> {
    xml.split(attribute).skip(1).filter_map(|rest| rest.strip_prefix("=\"")?.split('"').next())
}

#[test]
fn a_portable_fmu_is_flat_and_real_and_has_a_guid_of_its_own() {
    let description = |arguments: &[&str]| {
        text(&exported(&[arguments, &["-o", "x.fmu"]].concat(), "x.fmu")["modelDescription.xml"])
    };
    for part in ["controller", "grid"] {
        let structured = description(&[part, "case1"]);
        let portable = description(&[part, "case1", "--portable"]);
        assert!(structured.contains("variableNamingConvention=\"structured\""));
        assert!(portable.contains("variableNamingConvention=\"flat\""));
        let guid = |xml: &str| values(xml, " guid").next().unwrap().to_owned();
        assert_ne!(guid(&structured), guid(&portable), "the library tells them apart by the GUID");
        assert!(!portable.contains("<Boolean") && !portable.contains("<Integer"));
        let names =
            |xml: &str| values(xml, "<ScalarVariable name").map(str::to_owned).collect::<Vec<_>>().join(" ");
        assert_eq!(names(&portable), names(&structured).replace('[', "_").replace(']', ""));
    }
}

#[test]
fn the_system_is_the_same_to_the_last_byte_and_complete() {
    let folder = tempfile::tempdir().unwrap();
    let read = |file: &str, arguments: &[&str]| {
        assert!(export(folder.path(), arguments).status.success());
        std::fs::read(folder.path().join(file)).unwrap()
    };
    let once = read("BessSystem.ssp", &["system", "case1"]);
    assert_eq!(once, read("again.ssp", &["system", "case1", "-o", "again.ssp"]));
    let entries = archive(once);
    let expected = [
        "SystemStructure.ssd",
        "resources/BessConsensus.fmu",
        "resources/BessGrid.fmu",
        "resources/controller-scenario.ssv",
        "resources/grid-scenario.ssv",
    ];
    assert_eq!(entries.keys().collect::<Vec<_>>(), expected);
    // The FMUs inside are those that are exported alone.
    assert!(export(folder.path(), &["grid", "case1"]).status.success());
    let alone = std::fs::read(folder.path().join("BessGrid.fmu")).unwrap();
    assert_eq!(entries["resources/BessGrid.fmu"], alone);

    let structure = text(&entries["SystemStructure.ssd"]);
    // P, Q, V, omega, E one way and the four setpoints the other, of seven batteries.
    assert_eq!(values(&structure, "<ssd:Connection startElement").filter(|e| *e == "grid").count(), 35);
    assert_eq!(values(&structure, "<ssd:Connection startElement").filter(|e| *e == "controller").count(), 28);
    let controller = text(&entries["resources/controller-scenario.ssv"]);
    assert!(controller.contains("name=\"enable\">\n      <ssv:Boolean value=\"true\"/>"), "{controller}");
    // FMPy would take a listed Boolean for true.
    assert!(!controller.contains("value=\"false\"") && !controller.contains("\"dispatch\""));
}

#[test]
fn a_scenarios_start_and_connections_are_in_the_system() {
    let start = [
        "initial={\"controller.enable\":false,\"grid.dP_load[12]\":-0.5,\"controller.available[5]\":false}",
        "events=[{\"at_s\":0,\"set\":{\"controller.topology\":2}},{\"at_s\":1,\"set\":{\"controller.P_ref\":7}}]",
        "connections=[{\"from\":\"grid.V[2]\",\"to\":\"controller.V[1]\",\"factor\":2,\"offset\":-1}]",
    ];
    let arguments: Vec<&str> =
        ["system", "case1"].into_iter().chain(start.into_iter().flat_map(|s| ["--set", s])).collect();
    let entries = exported(&arguments, "BessSystem.ssp");
    let value = |component: &str, name: &str| {
        let set = text(&entries[&format!("resources/{component}-scenario.ssv")]);
        let rest = set.split(&format!("<ssv:Parameter name=\"{name}\">")).nth(1)?.to_owned();
        values(&rest, " value").next().map(str::to_owned)
    };
    assert_eq!(value("controller", "enable"), None, "off is how the FMU starts anyway");
    assert_eq!(value("controller", "available[5]").as_deref(), Some("false"));
    assert_eq!(value("controller", "topology").as_deref(), Some("2"));
    assert_eq!(
        value("controller", "P_ref").as_deref(),
        Some("0.0"),
        "an event after the start is none of it"
    );
    assert_eq!(value("grid", "dP_load[12]").as_deref(), Some("-0.5"));
    assert_eq!(value("grid", "dP_load[11]").as_deref(), Some("0.0"));

    let structure = text(&entries["SystemStructure.ssd"]);
    let wire = "startConnector=\"V[2]\" endElement=\"controller\" endConnector=\"V[1]\">";
    assert!(structure.contains(wire), "{structure}");
    assert!(structure.contains("<ssc:LinearTransformation factor=\"2.0\" offset=\"-1.0\"/>"));
    // The table takes the place of the equal name.
    assert_eq!(structure.matches("endElement=\"controller\" endConnector=\"V[1]\"").count(), 1);
}

#[test]
fn what_does_not_fit_is_refused_with_its_key_and_nothing_is_written() {
    let set = |value: &'static str| ["system", "case1", "--set", value];
    refused(
        &set("initial={\"grid.dP_lod[12]\":1}"),
        2,
        &["initial.grid.dP_lod[12]", "no variable", "grid.dP_load[12]"],
    );
    refused(&set("initial={\"plant.x\":1}"), 2, &["initial.plant.x", "controller or grid"]);
    refused(
        &set("initial={\"controller.topology\":9}"),
        2,
        &["initial.controller.topology", "topology", "9"],
    );
    refused(&set("initial={\"grid.P[1]\":1}"), 2, &["initial.grid.P[1]", "output"]);
    refused(
        &set("connections=[{\"from\":\"grid.P\",\"to\":\"controller.P[1]\"}]"),
        2,
        &["connections[0].from: \"grid.P\"", "no output"],
    );
    refused(
        &set("connections=[{\"from\":\"grid.P[1]\",\"to\":\"controller.enable\"}]"),
        2,
        &["connections[0]: grid.P[1]", "controller.enable", "Real", "Boolean", "--portable"],
    );
}

#[test]
fn all_clusters_and_the_grid_are_one_system_in_which_messages_cross_once() {
    let entries = exported(&["clusters", "case1"], "BessClusters.ssp");
    let expected = [
        "SystemStructure.ssd",
        "resources/BessCluster1.fmu",
        "resources/BessCluster2.fmu",
        "resources/BessGrid.fmu",
        "resources/cluster1-scenario.ssv",
        "resources/cluster2-scenario.ssv",
        "resources/grid-scenario.ssv",
    ];
    assert_eq!(entries.keys().collect::<Vec<_>>(), expected);
    let structure = text(&entries["SystemStructure.ssd"]);
    let from = |who: &str| values(&structure, "<ssd:Connection startElement").filter(|e| *e == who).count();
    // Five measurements one way and four setpoints the other; ten messages of each battery, who may all lead one day.
    assert_eq!(from("grid"), 35);
    assert_eq!(from("cluster1") + from("cluster2"), 28 + 70);
    let wire = "startElement=\"cluster2\" startConnector=\"local_p[1]\" endElement=\"cluster1\" endConnector=\"remote_p[1]\"";
    assert!(structure.contains(wire), "{structure}");
    for cluster in ["cluster1", "cluster2"] {
        let set = text(&entries[&format!("resources/{cluster}-scenario.ssv")]);
        assert!(set.contains("name=\"enable\">\n      <ssv:Boolean value=\"true\"/>"), "{set}");
    }
    // The FMU inside is the one that is exported alone.
    let alone = exported(&["cluster", "2", "case1"], "BessCluster2.fmu");
    let inside = archive(entries["resources/BessCluster2.fmu"].clone());
    assert_eq!(alone, inside);
    let description = text(&alone["modelDescription.xml"]);
    assert!(description.contains("modelIdentifier=\"BessConsensus\"") && !description.contains("lambda_2"));
    let agents = exported(&["agents", "case1", "--portable"], "BessAgents.ssp");
    assert_eq!(agents.keys().filter(|name| name.starts_with("resources/BessAgent")).count(), 7);
    // What a scenario says of battery 5 is for the part that has it.
    let start = "initial={\"controller.available[5]\":false}";
    let entries = exported(&["agents", "case1", "--set", start], "BessAgents.ssp");
    assert!(text(&entries["resources/agent5-scenario.ssv"]).contains("name=\"available[1]\">"));
    assert!(!text(&entries["resources/agent4-scenario.ssv"]).contains("name=\"available[1]\">"));
}

#[test]
fn a_wire_from_what_no_part_knows_is_refused() {
    for what in ["spread_P", "lambda_2"] {
        let wire = format!("connections=[{{\"from\":\"controller.{what}\",\"to\":\"grid.dP_load[1]\"}}]");
        let said = format!("connections: controller.{what} is the whole fleet's, which no one part");
        refused(&["clusters", "case1", "--set", &wire], 2, &[&said, "expected a variable of one agent"]);
        exported(&["system", "case1", "--set", &wire], "BessSystem.ssp");
    }
}

#[test]
fn a_part_that_is_not_there_is_refused() {
    refused(&["cluster", "3", "case1"], 2, &["NUMBER: found 3", "1 to 2"]);
    refused(&["agent", "0", "case1"], 2, &["NUMBER: found 0", "1 to 7"]);
    refused(&["cluster", "case1"], 2, &["NUMBER: found none", "1 to 2"]);
    refused(&["grid", "2", "case1"], 2, &["NUMBER: found 2", "none here"]);
}
