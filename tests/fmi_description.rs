//! The model description against what the standard and its readers expect.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

mod fmi_mock;

use bess_consensus::fmi::{
    Access, Causality, Dependencies, Group, Instance, Interface, Log, Logger, Model, ModelError, Phase,
    Range, Registry, Row, Step, Variability, model_description,
};
use fmi_mock::Mock;
use std::path::Path;

/// An element: depth, name, attributes.
type Element = (usize, String, Vec<(String, String)>);

/// Reads the XML subset that the writer may use, and refuses everything else.
fn elements(xml: &str) -> Vec<Element> {
    let body = xml.strip_prefix("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n").expect("the declaration");
    let (mut found, mut open): (Vec<Element>, Vec<String>) = (Vec::new(), Vec::new());
    for piece in body.split('<').skip(1) {
        let (tag, text) = piece.split_once('>').expect("every tag ends");
        assert!(text.trim().is_empty() && !text.contains('&'), "text between tags: {text}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name));
            continue;
        }
        let (tag, empty) = tag.strip_suffix('/').map_or((tag, false), |tag| (tag, true));
        let (name, mut rest) = tag.split_once(char::is_whitespace).unwrap_or((tag, ""));
        let mut attributes = Vec::new();
        while let Some((key, after)) = rest.trim_start().split_once("=\"") {
            let (value, after) = after.split_once('"').expect("a quote closes");
            let plain = value.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"");
            assert!(
                !plain.replace("&amp;", "").contains('&') && !value.contains(['\n', '<', '>']),
                "{value}"
            );
            attributes.push((key.to_owned(), plain.replace("&amp;", "&")));
            rest = after;
        }
        assert!(rest.trim().is_empty(), "{rest}");
        found.push((open.len(), name.to_owned(), attributes));
        if !empty {
            open.push(name.to_owned());
        }
    }
    assert!(open.is_empty());
    found
}

fn attribute<'a>(element: &'a Element, key: &str) -> Option<&'a str> {
    element.2.iter().find(|(k, _)| k == key).map(|(_, value)| value.as_str())
}

fn written(n: usize, interface: Interface) -> Vec<Element> {
    elements(&model_description::write(&Mock::with(n), interface).unwrap())
}

#[test]
fn elements_come_in_the_order_of_the_schema() {
    let all = written(2, Interface::Structured);
    let children: Vec<&str> = all.iter().filter(|e| e.0 == 1).map(|e| e.1.as_str()).collect();
    let expected = [
        "CoSimulation",
        "UnitDefinitions",
        "LogCategories",
        "DefaultExperiment",
        "ModelVariables",
        "ModelStructure",
    ];
    assert_eq!(children, expected);
    let structure: Vec<&str> = all
        .iter()
        .skip_while(|e| e.1 != "ModelStructure")
        .filter(|e| e.0 == 2)
        .map(|e| e.1.as_str())
        .collect();
    assert_eq!(structure, ["Outputs", "InitialUnknowns"]);
}

#[test]
fn the_head_carries_the_guid_of_the_instance_and_the_flags() {
    for (interface, naming) in [(Interface::Structured, "structured"), (Interface::Portable, "flat")] {
        let all = written(2, interface);
        let guid = Instance::from_model("", Mock::with(2), interface, Logger::silent()).unwrap().guid();
        let (head, simulation) = (&all[0], &all[1]);
        assert_eq!(head.1, "fmiModelDescription");
        assert_eq!(attribute(head, "fmiVersion"), Some("2.0"));
        assert_eq!(attribute(head, "guid"), Some(guid.to_string().as_str()));
        assert_eq!(attribute(head, "modelName"), Some("Mock"));
        assert_eq!(attribute(head, "description"), Some(Mock::DESCRIPTION));
        assert_eq!(attribute(head, "variableNamingConvention"), Some(naming));
        assert_eq!(attribute(head, "generationDateAndTime"), None);
        for (flag, value) in [
            ("modelIdentifier", "Mock"),
            ("needsExecutionTool", "false"),
            ("canHandleVariableCommunicationStepSize", "true"),
            ("canInterpolateInputs", "true"),
            ("maxOutputDerivativeOrder", "1"),
            ("canRunAsynchronuously", "false"),
            ("canBeInstantiatedOnlyOncePerProcess", "false"),
            ("canNotUseMemoryManagementFunctions", "true"),
            ("canGetAndSetFMUstate", "true"),
            ("canSerializeFMUstate", "true"),
            ("providesDirectionalDerivative", "true"),
        ] {
            assert_eq!(attribute(simulation, flag), Some(value), "{flag}");
        }
    }
}

#[test]
fn variables_have_what_their_causality_demands() {
    let all = written(2, Interface::Structured);
    let at: Vec<usize> = (0..all.len()).filter(|i| all[*i].1 == "ScalarVariable").collect();
    let rows: Vec<String> = at
        .iter()
        .enumerate()
        .map(|(position, i)| {
            let (variable, kind) = (&all[*i], &all[*i + 1]);
            assert_eq!(attribute(variable, "valueReference"), Some((position + 1).to_string().as_str()));
            let of = |e: &Element, keys: &[&str]| {
                keys.iter().map(|k| attribute(e, k).unwrap_or("-").to_owned()).collect::<Vec<_>>().join(" ")
            };
            let words = of(variable, &["name", "causality", "variability", "initial"]);
            format!("{words} {} {}", kind.1, of(kind, &["unit", "min", "max", "start"]))
        })
        .collect();
    let expected = [
        "u[1] input continuous - Real pu - - 1.0",
        "u[2] input continuous - Real pu - - 2.0",
        "x[1] output continuous calculated Real pu - - -",
        "x[2] output continuous calculated Real pu - - -",
        "y[1] output continuous calculated Real pu - - -",
        "y[2] output continuous calculated Real pu - - -",
        "total output continuous calculated Real pu - - -",
        "gain parameter tunable exact Real - 0.0 - 2.0",
        "tau parameter fixed exact Real s 0.0 - 0.5",
        "x_start[1] parameter fixed exact Real pu.h - - 0.25",
        "x_start[2] parameter fixed exact Real pu.h - - 0.25",
        "mode input discrete - Integer - 1 3 1",
        "fault input discrete - Integer - - - 0",
        "enable input discrete - Boolean - - - true",
        "steps output discrete calculated Integer - - - -",
        "settled output discrete calculated Boolean - - - -",
    ];
    assert_eq!(rows, expected);

    let portable = written(2, Interface::Portable);
    let kinds = portable.iter().filter(|e| e.0 == 3).skip_while(|e| e.1 != "Real");
    let kinds: Vec<&str> = kinds.take(16).map(|e| e.1.as_str()).collect();
    assert_eq!(kinds, ["Real"; 16]);
    let name = |e: &&Element| attribute(e, "name").unwrap().to_owned();
    let names: Vec<String> = portable.iter().filter(|e| e.1 == "ScalarVariable").map(|e| name(&e)).collect();
    assert_eq!(names[..3].join(" "), "u_1 u_2 x_1");
}

#[test]
fn outputs_and_initial_unknowns_list_every_output_with_its_dependencies() {
    let all = written(2, Interface::Structured);
    let unknowns: Vec<String> = all
        .iter()
        .filter(|e| e.1 == "Unknown")
        .map(|e| format!("{}:{}", attribute(e, "index").unwrap(), attribute(e, "dependencies").unwrap()))
        .collect();
    let outputs = ["3:", "4:", "5:1", "6:2", "7:1 2", "15:", "16:"];
    assert_eq!(unknowns, [outputs, outputs].concat());
}

#[test]
fn units_reduce_to_si() {
    let all = written(1, Interface::Structured);
    let units: Vec<String> = all
        .iter()
        .zip(&all[1..])
        .filter(|(e, _)| e.1 == "Unit")
        .map(|(unit, base)| {
            assert_eq!(base.1, "BaseUnit");
            format!("{} {:?}", attribute(unit, "name").unwrap(), base.2)
        })
        .collect();
    let expected = ["pu []", r#"pu.h [("s", "1"), ("factor", "3600.0")]"#, r#"s [("s", "1")]"#];
    assert_eq!(units, expected, "only the units in use");
}

type List = fn() -> Vec<Group<Wrong>>;

/// A model whose list of variables can be made wrong.
#[derive(Clone)]
struct Wrong(List);

impl Model for Wrong {
    const IDENTIFIER: &'static str = "Wrong";
    const DESCRIPTION: &'static str = "";
    const INITIAL_STATE_FOLLOWS_INPUTS: bool = true;
    type State = ();
    fn load(_: &Path) -> Result<Self, ModelError> {
        Ok(Wrong(Vec::new))
    }
    fn variables(&self) -> Vec<Group<Self>> {
        self.0()
    }
    fn state(&self) -> &() {
        &()
    }
    fn set_state(&mut self, _: &()) -> Result<(), ModelError> {
        Ok(())
    }
    fn refresh(&mut self, _: Phase, _: &mut dyn Log) -> Result<(), ModelError> {
        Ok(())
    }
    fn step(&mut self, _: Step, _: &mut dyn Log) -> Result<(), ModelError> {
        Ok(())
    }
}

fn output(name: &'static str, count: Option<usize>, dependencies: Dependencies<Wrong>) -> Group<Wrong> {
    Group {
        name,
        description: "",
        unit: None,
        count,
        size: None,
        causality: Causality::Output,
        variability: Variability::Continuous,
        access: Access::Real(|_, _| 0.0, None),
        range: Range::ANY,
        dependencies,
        row: Row::NONE,
    }
}

fn input(name: &'static str, count: Option<usize>) -> Group<Wrong> {
    Group {
        causality: Causality::Input,
        access: Access::Real(|_, _| 0.0, Some(|_, _, _| {})),
        ..output(name, count, Dependencies::None)
    }
}

#[test]
fn lists_that_no_fmu_could_have_are_refused_with_the_group() {
    let cases: [(List, &str); 10] = [
        (|| vec![output("a b", None, Dependencies::None)], "a b: is no C identifier"),
        (|| vec![output("", None, Dependencies::None)], "no C identifier"),
        (|| vec![input("a", None), output("a", Some(2), Dependencies::None)], "a: appears twice"),
        (|| vec![input("a", Some(3)), input("a_3", None)], "a_3: is also the portable name of a[3]"),
        (|| vec![Group { causality: Causality::Output, ..input("a", None) }], "set function"),
        (
            || vec![Group { causality: Causality::Input, ..output("a", None, Dependencies::None) }],
            "set function",
        ),
        (|| vec![Group { variability: Variability::Fixed, ..input("a", None) }], "(Input, Fixed)"),
        (|| vec![Group { causality: Causality::Parameter, ..input("a", None) }], "(Parameter, Continuous)"),
        (|| vec![Group { range: Range::POSITIVE, ..input("a", Some(2)) }], "start value 0.0 at [1]"),
        (
            || {
                vec![Group {
                    access: Access::Integer(|_, _| 0, None),
                    ..output("a", None, Dependencies::None)
                }]
            },
            "(Output, Continuous)",
        ),
    ];
    for (list, words) in cases {
        let error = Registry::new(&Wrong(list), Interface::Structured).err().expect(words).to_string();
        assert!(error.contains(words), "{error} lacks {words}");
    }
    let cases: [(List, &str); 3] = [
        (|| vec![output("a", None, Dependencies::All(&["b"]))], "a: depends on b, which is no input"),
        (|| vec![output("a", None, Dependencies::SameIndex(&["a"]))], "depends on a, which is no input"),
        (
            || vec![input("b", Some(2)), output("a", Some(3), Dependencies::Of(|_, i| vec![("b", i)]))],
            "a: depends on b[3]; expected at most b[2]",
        ),
    ];
    for (list, words) in cases {
        let error =
            model_description::write(&Wrong(list), Interface::Structured).expect_err(words).to_string();
        assert!(error.contains(words), "{error} lacks {words}");
    }
}

#[test]
fn the_start_of_a_model_that_starts_from_a_steady_state_follows_everything() {
    let list =
        || vec![input("b", Some(2)), output("a", Some(2), Dependencies::Of(|_, i| vec![("b", 1 - i)]))];
    let all = elements(&model_description::write(&Wrong(list), Interface::Structured).unwrap());
    let unknowns: Vec<_> =
        all.iter().filter(|e| e.1 == "Unknown").map(|e| attribute(e, "dependencies")).collect();
    assert_eq!(unknowns, [Some("2"), Some("1"), Some("1 2"), Some("1 2")]);
}

#[test]
fn a_model_without_outputs_or_units_is_still_legal() {
    let xml = model_description::write(&Wrong(Vec::new), Interface::Structured).unwrap();
    let names: Vec<String> = elements(&xml).into_iter().filter(|e| e.0 == 1).map(|e| e.1).collect();
    assert_eq!(
        names,
        ["CoSimulation", "LogCategories", "DefaultExperiment", "ModelVariables", "ModelStructure"]
    );
    assert!(!xml.contains("Unknown"));
}

#[test]
fn a_quarter_of_a_million_variables_are_written_and_looked_up() {
    let model = Mock::with(60_000);
    let registry = Registry::new(&model, Interface::Structured).unwrap();
    assert_eq!(registry.len(), 240_008);
    for reference in (1..=registry.len() as u32).step_by(997) {
        let name = registry.name(reference).unwrap();
        assert_eq!(registry.reference(&name), Some(reference), "{name}");
    }
    let all = written(60_000, Interface::Structured);
    assert_eq!(all.iter().filter(|e| e.1 == "ScalarVariable").count(), 240_008);
}
