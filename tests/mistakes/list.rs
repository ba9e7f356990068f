//! The mistakes, and how to mend them. Each is made as a person makes it: by a command and the files beside it.

/// What is in a file.
pub enum Content {
    Text(&'static str),
    /// An FMU for Windows alone, with this model description.
    Fmu(&'static str),
}

/// One mistake.
pub struct Mistake {
    pub title: &'static str,
    pub files: &'static [(&'static str, Content)],
    pub command: &'static str,
    pub code: i32,
    /// What the message must name: where, what was found, what is expected.
    pub says: &'static [&'static str],
    pub mend: &'static str,
}

const FMI2: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="MyGrid" guid="1">
  <CoSimulation modelIdentifier="MyGrid"/>
  <ModelVariables/>
  <ModelStructure/>
</fmiModelDescription>"#;

const FMI3: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="MyGrid" instantiationToken="1">
  <CoSimulation modelIdentifier="MyGrid"/>
  <ModelVariables/>
  <ModelStructure/>
</fmiModelDescription>"#;

pub const MISTAKES: &[Mistake] = &[
    Mistake {
        title: "A key is misspelt",
        files: &[(
            "mine.json",
            Content::Text(
                r#"{
  "extends": "case1",
  "name": "mine",
  "control": { "etta": 0.3 }
}"#,
            ),
        )],
        command: "bess run mine.json",
        code: 2,
        says: &["mine.json", "control", "etta", "`eta`", "line 4"],
        mend: "Write the key as in the list. With `\"$schema\"` set to schema/scenario.schema.json your editor \
               completes keys.",
    },
    Mistake {
        title: "The file is no JSON",
        files: &[(
            "mine.json",
            Content::Text(
                r#"{
  "extends": "case1",
  "name": "mine",
  "control": { "eta": 0.3, }
}"#,
            ),
        )],
        command: "bess run mine.json",
        code: 2,
        says: &["mine.json", "line 4"],
        mend: "Line and column say where reading stopped: here a comma before a closing brace. JSON knows no comments either.",
    },
    Mistake {
        title: "A number is written as text",
        files: &[(
            "mine.json",
            Content::Text(
                r#"{
  "extends": "case1",
  "name": "mine",
  "control": { "eta": "0.3" }
}"#,
            ),
        )],
        command: "bess run mine.json",
        code: 2,
        says: &["control.eta", "\"0.3\"", "number"],
        mend: "Take the quotation marks away.",
    },
    Mistake {
        title: "The scenario does not exist",
        files: &[],
        command: "bess run case5",
        code: 2,
        says: &["case5", "no such scenario", "case4"],
        mend: "Give a built-in name of the list, or the path of your file.",
    },
    Mistake {
        title: "A bus that the case does not have",
        files: &[],
        command: "bess run case1 --set 'bess[2].bus=58'",
        code: 2,
        says: &["bess[2].bus", "58"],
        mend: "Buses go by the numbers of the case (first column of `mpc.bus`), not by their positions.",
    },
    Mistake {
        title: "Two batteries at one bus",
        files: &[],
        command: "bess run case1 --set 'bess[1].bus=1'",
        code: 2,
        says: &["bess[1].bus", "1"],
        mend: "Give each battery a bus of its own; two at one bus are one with both their capacities.",
    },
    Mistake {
        title: "Counting from 1 in a path",
        files: &[],
        command: "bess run case1 --set 'bess[7].K_P=0.004'",
        code: 2,
        says: &["bess[7]", "0 to 6"],
        mend: "Places in a JSON list count from 0: the seventh battery is `bess[6]`. Variables count from 1: its power is \
               `grid.P[7]`.",
    },
    Mistake {
        title: "The state of charge in percent",
        files: &[],
        command: "bess run case1 --set 'bess[0].soc_start=70'",
        code: 2,
        says: &["bess[0].soc_start", "70", "0 to 1"],
        mend: "Write 0.7.",
    },
    Mistake {
        title: "A gain with the wrong sign",
        files: &[],
        command: "bess run case1 --set control.gains.P=-1",
        code: 2,
        says: &["control.gains.P", "-1", ">= 0"],
        mend: "Gains are magnitudes; the laws bring their own minus.",
    },
    Mistake {
        title: "The exponent out of its range",
        files: &[],
        command: "bess run case1 --set control.eta=-0.5",
        code: 2,
        says: &["control.eta", "-0.5", "0 < eta <= 1"],
        mend: "The paper also prints the homogeneity degree, eta - 1, as eta: add 1 to it.",
    },
    Mistake {
        title: "A graph in two parts",
        files: &[(
            "mine.json",
            Content::Text(
                r#"{
  "extends": "case1",
  "name": "mine",
  "communication": { "graphs": [ {
    "name": "mine",
    "edges": [
      { "a": 1, "b": 2, "weight": 1 }, { "a": 2, "b": 3, "weight": 1 },
      { "a": 4, "b": 5, "weight": 1 }, { "a": 5, "b": 6, "weight": 1 }, { "a": 6, "b": 7, "weight": 1 }
    ],
    "pins": [ { "agent": 1 } ]
  } ] }
}"#,
            ),
        )],
        command: "bess run mine.json",
        code: 2,
        says: &["communication.graphs[0]", "connected"],
        mend: "Add an edge between the parts. (That a graph falls apart when an agent leaves is no mistake: the part without \
               a leader then holds its setpoints.)",
    },
    Mistake {
        title: "A list for another number of batteries",
        files: &[],
        command: "bess run case1 --set 'communication.distance={\"given\":[[0,1],[1,0]]}'",
        code: 2,
        says: &["communication.distance.given", "2", "7"],
        mend: "A distance matrix has a row and a column for each battery, in their order.",
    },
    Mistake {
        title: "A unit that nobody knows",
        files: &[],
        command: "bess run case1 --set 'connections=[{\"from\":\"grid.P[{i}]\",\"to\":\"controller.P[{i}]\",\"from_unit\":\"Megawatt\"}]'",
        code: 2,
        says: &["connections[0].from_unit", "Megawatt", "MW"],
        mend: "Write one of the list; what is missing there can be said by `factor`.",
    },
    Mistake {
        title: "A connection to a variable that is not there",
        files: &[],
        command: "bess run case1 --set 'connections=[{\"from\":\"grid.p[1]\",\"to\":\"controller.P[1]\"}]'",
        code: 2,
        says: &["grid.p[1]", "p[1]", "P[1]"],
        mend: "Upper and lower case count. `bess check MyGrid.fmu` lists the variables of an FMU.",
    },
    Mistake {
        title: "An event on a variable that is not there",
        files: &[],
        command: "bess run case1 --set 'events=[{\"at_s\":50,\"set\":{\"grid.dP_lod[12]\":-0.5}}]'",
        code: 2,
        says: &["50", "dP_lod[12]", "dP_load[12]"],
        mend: "Take the name that is offered.",
    },
    Mistake {
        title: "An event after the end",
        files: &[(
            "mine.json",
            Content::Text(
                r#"{
  "extends": "case1",
  "name": "mine",
  "events": [
    { "at_s": 20, "label": "on", "set": { "controller.enable": true } },
    { "at_s": 50000, "label": "load", "set": { "grid.dP_load[12]": -0.5 } }
  ],
  "compare": null
}"#,
            ),
        )],
        command: "bess run mine.json --quiet --no-report",
        code: 0,
        says: &["warning", "events[1]", "50000", "120"],
        mend: "Make `stop_s` larger, or move the event: times are seconds. (A run that is cut short with `--set stop_s=30` is \
               not warned about.)",
    },
    Mistake {
        title: "The controller is never enabled",
        files: &[],
        command: "bess run case1 --quiet --no-report --set stop_s=10 --set 'events=[]'",
        code: 0,
        says: &["warning", "controller.enable", "initial"],
        mend: "Add `\"initial\": { \"controller.enable\": true }`, or an event that sets it.",
    },
    Mistake {
        title: "Milliseconds instead of seconds",
        files: &[],
        command: "bess run case1 --quiet --no-report --set step_s=10",
        code: 0,
        says: &["warning", "step_s", "10"],
        mend: "Write `step_s` in seconds: 0.01.",
    },
    Mistake {
        title: "An FMU that is not there",
        files: &[],
        command: "bess run case1 --grid MyGrid.fmu",
        code: 2,
        says: &["MyGrid.fmu"],
        mend: "The path counts from the folder where you type; one in a scenario (`grid.fmu`) from that file.",
    },
    Mistake {
        title: "An FMU that is none",
        files: &[("MyGrid.fmu", Content::Text("not an archive"))],
        command: "bess run case1 --grid MyGrid.fmu",
        code: 2,
        says: &["MyGrid.fmu", "zip"],
        mend: "An FMU is a zip archive. Often it is a web page that was saved instead of the file, or a Git LFS pointer.",
    },
    Mistake {
        title: "An FMU for another system",
        files: &[("MyGrid.fmu", Content::Fmu(FMI2))],
        command: "bess run case1 --grid MyGrid.fmu",
        code: 2,
        says: &["MyGrid", "linux64", "win64"],
        mend: "Export it again with a library for this system, or run `bess` where the FMU runs.",
    },
    Mistake {
        title: "An FMU of FMI 3.0",
        files: &[("MyGrid.fmu", Content::Fmu(FMI3))],
        command: "bess run case1 --grid MyGrid.fmu",
        code: 2,
        says: &["MyGrid.fmu", "3.0", "2.0"],
        mend: "Export it as FMI 2.0 for co-simulation; most tools ask.",
    },
    Mistake {
        title: "A file where the results should go",
        files: &[("out", Content::Text("a file"))],
        command: "bess run case1 -o out",
        code: 1,
        says: &["out"],
        mend: "Choose another folder with `-o`.",
    },
    Mistake {
        title: "Results where one may not write",
        files: &[],
        command: "bess run case1 -o /proc/results",
        code: 1,
        says: &["/proc/results"],
        mend: "Choose another folder with `-o`.",
    },
    Mistake {
        title: "A fault without its number",
        files: &[],
        command: "bess run case1 --set 'faults=[{\"kind\":\"drift\",\"signal\":\"P[3]\",\"from_s\":30}]'",
        code: 2,
        says: &["faults[0].rate_per_s", "drift"],
        mend: "Each kind has its own keys: [faults.md](faults.md).",
    },
];
