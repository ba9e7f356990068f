//! Writes modelDescription.xml of FMI 3.0 from the same groups that the calls read: one variable for each group, so that
//! its length does not depend on the number of agents but for start values that differ. Contains no date, so that the
//! same model always gives the same file.

use super::dependencies::{knowns, of_group};
use super::table::{TIME, Table, Type, Variable};
use crate::fmi::guid::Guid;
use crate::fmi::logging::{Category, LOG_ALL};
use crate::fmi::lookup::{Interface, Registry, RegistryError, Value};
use crate::fmi::model::Model;
use crate::fmi::model_description::escaped;
use crate::fmi::registry::{Causality, Group, Range, Unit, Variability};
use crate::fmi::shape::{Array, Size, Values};
use std::fmt::{Display, Result as Written, Write};

/// The model description of a freshly loaded model.
pub fn write<M: Model>(model: &M) -> Result<String, RegistryError> {
    let registry = Registry::new(model, Interface::Structured)?;
    let shape = model.shape();
    let token = Guid::of(&registry, model).token(&shape);
    let table = Table { registry: &registry, shape: &shape };
    let mut xml = String::with_capacity(32_768);
    // Writing into a String cannot fail.
    let _ = write_head::<M>(&mut xml, token);
    let _ = write_units(&mut xml, &table);
    let _ = write_log_categories(&mut xml);
    let (stop, step) = model.default_experiment();
    let _ =
        writeln!(xml, "  <DefaultExperiment startTime=\"0.0\" stopTime=\"{stop:?}\" stepSize=\"{step:?}\"/>");
    let _ = write_variables(&mut xml, &table, model);
    let _ = write_structure(&mut xml, &table, model);
    xml.push_str("</fmiModelDescription>\n");
    Ok(xml)
}

fn write_head<M: Model>(xml: &mut String, token: Guid) -> Written {
    let (identifier, version) = (M::IDENTIFIER, env!("CARGO_PKG_VERSION"));
    let (description, tangents) = (escaped(M::DESCRIPTION), M::HAS_TANGENTS);
    writeln!(xml, r#"<?xml version="1.0" encoding="UTF-8"?>"#)?;
    writeln!(
        xml,
        r#"<fmiModelDescription fmiVersion="3.0" modelName="{identifier}" instantiationToken="{token}""#
    )?;
    writeln!(xml, r#"    description="{description}""#)?;
    writeln!(xml, r#"    version="{version}" generationTool="bess-consensus {version}""#)?;
    writeln!(xml, r#"    variableNamingConvention="structured">"#)?;
    writeln!(xml, r#"  <CoSimulation modelIdentifier="{identifier}" needsExecutionTool="false""#)?;
    for (name, value) in [
        ("canBeInstantiatedOnlyOncePerProcess", false),
        ("canGetAndSetFMUState", true),
        ("canSerializeFMUState", true),
        ("providesDirectionalDerivatives", tangents),
        ("providesAdjointDerivatives", false),
        ("providesPerElementDependencies", true),
        ("canHandleVariableCommunicationStepSize", true),
        ("providesIntermediateUpdate", false),
        ("mightReturnEarlyFromDoStep", false),
        ("canReturnEarlyAfterIntermediateUpdate", false),
        ("hasEventMode", false),
    ] {
        writeln!(xml, r#"      {name}="{value}""#)?;
    }
    writeln!(xml, r#"      maxOutputDerivativeOrder="{}"/>"#, u32::from(tangents))
}

fn write_units<M: Model>(xml: &mut String, table: &Table<'_, M>) -> Written {
    let of_arrays = |unit: &Unit| table.shape.arrays.iter().any(|array| array.unit == Some(*unit));
    let of_groups = |unit: &Unit| table.registry.groups().any(|(_, group)| group.unit == Some(*unit));
    // The time is in seconds.
    let used = |unit: &Unit| *unit == Unit::Second || of_groups(unit) || of_arrays(unit);
    writeln!(xml, "  <UnitDefinitions>")?;
    for unit in Unit::ALL.into_iter().filter(used) {
        write!(xml, r#"    <Unit name="{}"><BaseUnit{}/>"#, unit.name(), unit.base_attributes())?;
        if let Some((name, factor)) = unit.display() {
            write!(xml, r#"<DisplayUnit name="{name}" factor="{factor:?}"/>"#)?;
        }
        writeln!(xml, "</Unit>")?;
    }
    writeln!(xml, "  </UnitDefinitions>")
}

fn write_log_categories(xml: &mut String) -> Written {
    writeln!(xml, "  <LogCategories>")?;
    let all = Category::ALL.iter().map(|category| (category.name(), category.description()));
    for (name, description) in all.chain([(LOG_ALL, "all of these")]) {
        writeln!(xml, r#"    <Category name="{}" description="{description}"/>"#, name.to_string_lossy())?;
    }
    writeln!(xml, "  </LogCategories>")
}

/// The sizes come first, because the arrays refer to them.
fn write_variables<M: Model>(xml: &mut String, table: &Table<'_, M>, model: &M) -> Written {
    writeln!(xml, "  <ModelVariables>")?;
    writeln!(
        xml,
        r#"    <Float64 name="time" valueReference="{TIME}" description="Simulation time" causality="independent" variability="continuous" unit="s"/>"#
    )?;
    let all = || (1..=table.last()).filter_map(|reference| Some((reference, table.get(reference)?)));
    for (reference, variable) in all() {
        if let Variable::Size(_, size) = variable {
            write_size(xml, reference, size)?;
        }
    }
    for (reference, variable) in all() {
        match variable {
            Variable::Group(_, group) => write_group(xml, table, model, reference, group)?,
            Variable::Array(_, array) => write_array(xml, table, reference, array)?,
            Variable::Time | Variable::Size(..) => {}
        }
    }
    writeln!(xml, "  </ModelVariables>")
}

fn write_size(xml: &mut String, reference: u32, size: &Size) -> Written {
    let Size { name, value, min, max, .. } = size;
    let description = escaped(size.description);
    writeln!(
        xml,
        r#"    <UInt64 name="{name}" valueReference="{reference}" description="{description}" causality="structuralParameter" variability="fixed" initial="exact" min="{min}" max="{max}" start="{value}"/>"#
    )
}

fn write_unit(xml: &mut String, unit: Option<Unit>) -> Written {
    let Some(unit) = unit else { return Ok(()) };
    write!(xml, " unit=\"{}\"", unit.name())?;
    match unit.display() {
        Some((name, _)) => write!(xml, " displayUnit=\"{name}\""),
        None => Ok(()),
    }
}

/// Bounds of Reals; `whole` of whole numbers.
fn write_range(xml: &mut String, range: Range, whole: bool) -> Written {
    for (name, bound) in [("min", range.min), ("max", range.max)] {
        match (bound.is_finite(), whole) {
            (false, _) => {}
            (true, true) => write!(xml, " {name}=\"{}\"", bound as i32)?,
            (true, false) => write!(xml, " {name}=\"{bound:?}\"")?,
        }
    }
    Ok(())
}

/// One value where all are the same: it then holds for any length.
fn write_start<T: PartialEq + Display>(xml: &mut String, values: impl Iterator<Item = T> + Clone) -> Written {
    let mut rest = values.clone();
    let Some(first) = rest.next() else { return Ok(()) };
    write!(xml, " start=\"{first}")?;
    if !rest.clone().all(|value| value == first) {
        rest.try_for_each(|value| write!(xml, " {value}"))?;
    }
    write!(xml, "\"")
}

/// A Real with every digit that it needs to come back.
#[derive(PartialEq)]
struct Digits(f64);

impl Display for Digits {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> Written {
        write!(f, "{:?}", self.0)
    }
}

/// One group; causality, variability and initial after the table of FMI 3.0, section 2.4.7.5.
fn write_group<M: Model>(
    xml: &mut String,
    table: &Table<'_, M>,
    model: &M,
    reference: u32,
    group: &Group<M>,
) -> Written {
    let (kind, name, description) = (Type::of(group), group.name, escaped(group.description));
    write!(xml, r#"    <{kind} name="{name}" valueReference="{reference}" description="{description}""#)?;
    xml.push_str(match group.causality {
        Causality::Input => " causality=\"input\"",
        Causality::Output => " causality=\"output\" initial=\"calculated\"",
        Causality::Parameter => " causality=\"parameter\" initial=\"exact\"",
    });
    xml.push_str(match group.variability {
        Variability::Fixed => " variability=\"fixed\"",
        Variability::Tunable => " variability=\"tunable\"",
        Variability::Discrete => " variability=\"discrete\"",
        Variability::Continuous => " variability=\"continuous\"",
    });
    write_unit(xml, group.unit.filter(|_| kind == Type::Float64))?;
    if kind != Type::Boolean {
        write_range(xml, group.range, kind == Type::Int32)?;
    }
    if group.causality != Causality::Output {
        let values = (0..group.len()).map(|index| group.value(model, index, Interface::Structured));
        let (reals, whole) = (
            values
                .clone()
                .filter_map(|value| if let Value::Real(v) = value { Some(Digits(v)) } else { None }),
            values.clone().filter_map(|value| if let Value::Integer(v) = value { Some(v) } else { None }),
        );
        let truths =
            values.clone().filter_map(|value| if let Value::Boolean(v) = value { Some(v) } else { None });
        match kind {
            Type::Float64 => write_start(xml, reals)?,
            Type::Int32 => write_start(xml, whole)?,
            Type::Boolean => write_start(xml, truths)?,
            Type::UInt64 => {}
        }
    }
    match (group.count, group.size.and_then(|size| table.reference(size))) {
        (None, _) => writeln!(xml, "/>"),
        (Some(_), Some(size)) => writeln!(xml, "><Dimension valueReference=\"{size}\"/></{kind}>"),
        (Some(count), None) => writeln!(xml, "><Dimension start=\"{count}\"/></{kind}>"),
    }
}

fn write_array<M: Model>(xml: &mut String, table: &Table<'_, M>, reference: u32, array: &Array) -> Written {
    let (name, description) = (array.name, escaped(array.description));
    let kind = match array.values {
        Values::UInt64(_) => Type::UInt64,
        Values::Float64(_) => Type::Float64,
    };
    write!(
        xml,
        r#"    <{kind} name="{name}" valueReference="{reference}" description="{description}" causality="parameter" initial="exact" variability="fixed""#
    )?;
    write_unit(xml, array.unit)?;
    match &array.values {
        Values::UInt64(values) => write_start(xml, values.iter())?,
        Values::Float64(values) => {
            write_range(xml, array.range, false)?;
            write_start(xml, values.iter().map(|value| Digits(*value)))?;
        }
    }
    let size = table.reference(array.size).unwrap_or_default();
    writeln!(xml, "><Dimension valueReference=\"{size}\"/></{kind}>")
}

fn write_structure<M: Model>(xml: &mut String, table: &Table<'_, M>, model: &M) -> Written {
    writeln!(xml, "  <ModelStructure>")?;
    for element in ["Output", "InitialUnknown"] {
        for reference in 1..=table.last() {
            let Some(Variable::Group(_, group)) = table.get(reference) else { continue };
            if group.causality != Causality::Output {
                continue;
            }
            // A solved start follows every input and parameter.
            let follows_all = element == "InitialUnknown" && M::INITIAL_STATE_FOLLOWS_INPUTS;
            let causes = if follows_all { knowns(table) } else { of_group(table, model, group) };
            let causes: Vec<String> = causes.iter().map(u32::to_string).collect();
            let causes = causes.join(" ");
            writeln!(xml, r#"    <{element} valueReference="{reference}" dependencies="{causes}"/>"#)?;
        }
    }
    writeln!(xml, "  </ModelStructure>")
}
