//! Writes modelDescription.xml from the same list of variables that the calls read. Contains no date,
//! so that the same model always gives the same file.

use super::guid::Guid;
use super::logging::{Category, LOG_ALL};
use super::lookup::{Interface, Registry, RegistryError, Value};
use super::model::Model;
use super::registry::{Causality, Dependencies, Group, Unit, Variability};
use std::fmt::Write;

/// What the FMU can do, as the `CoSimulation` element says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct Capabilities {
    pub can_handle_variable_communication_step_size: bool,
    pub can_interpolate_inputs: bool,
    pub max_output_derivative_order: u32,
    pub can_be_instantiated_only_once_per_process: bool,
    pub can_not_use_memory_management_functions: bool,
    pub can_get_and_set_fmu_state: bool,
    pub can_serialize_fmu_state: bool,
    pub provides_directional_derivative: bool,
}

impl Capabilities {
    /// What [`super::shell`] does with this model.
    pub fn of<M: Model>() -> Self {
        Self {
            can_handle_variable_communication_step_size: true,
            can_interpolate_inputs: M::HAS_TANGENTS,
            max_output_derivative_order: u32::from(M::HAS_TANGENTS),
            can_be_instantiated_only_once_per_process: false,
            can_not_use_memory_management_functions: true,
            can_get_and_set_fmu_state: true,
            can_serialize_fmu_state: true,
            provides_directional_derivative: M::HAS_TANGENTS,
        }
    }
}

/// The model description of a freshly loaded model.
pub fn write<M: Model>(model: &M, interface: Interface) -> Result<String, RegistryError> {
    write_with(model, interface, &Capabilities::of::<M>())
}

/// The same with other capabilities.
pub fn write_with<M: Model>(
    model: &M,
    interface: Interface,
    capabilities: &Capabilities,
) -> Result<String, RegistryError> {
    let registry = Registry::new(model, interface)?;
    let mut xml = String::with_capacity(4096 + 400 * registry.len());
    // Writing into a String cannot fail.
    let _ = write_head::<M>(&mut xml, Guid::of(&registry, model), interface, capabilities);
    let _ = write_units(&mut xml, &registry);
    let _ = write_log_categories(&mut xml);
    let (stop, step) = model.default_experiment();
    let _ =
        writeln!(xml, "  <DefaultExperiment startTime=\"0.0\" stopTime=\"{stop:?}\" stepSize=\"{step:?}\"/>");
    xml.push_str("  <ModelVariables>\n");
    for (first, group) in registry.groups() {
        for index in 0..group.len() {
            let _ = write_variable(&mut xml, &registry, model, group, first, index);
        }
    }
    xml.push_str("  </ModelVariables>\n");
    write_structure(&mut xml, &registry, model)?;
    xml.push_str("</fmiModelDescription>\n");
    Ok(xml)
}

fn write_head<M: Model>(
    xml: &mut String,
    guid: Guid,
    interface: Interface,
    can: &Capabilities,
) -> std::fmt::Result {
    let naming = match interface {
        Interface::Structured => "structured",
        Interface::Portable => "flat",
    };
    let (identifier, version) = (M::IDENTIFIER, env!("CARGO_PKG_VERSION"));
    let description = escaped(M::DESCRIPTION);
    writeln!(xml, r#"<?xml version="1.0" encoding="UTF-8"?>"#)?;
    writeln!(xml, r#"<fmiModelDescription fmiVersion="2.0" modelName="{identifier}" guid="{guid}""#)?;
    writeln!(xml, r#"    description="{description}""#)?;
    writeln!(xml, r#"    version="{version}" generationTool="bess-consensus {version}""#)?;
    writeln!(xml, r#"    variableNamingConvention="{naming}">"#)?;
    writeln!(xml, r#"  <CoSimulation modelIdentifier="{identifier}" needsExecutionTool="false""#)?;
    let flags = [
        ("canHandleVariableCommunicationStepSize", can.can_handle_variable_communication_step_size),
        ("canInterpolateInputs", can.can_interpolate_inputs),
        ("canRunAsynchronuously", false),
        ("canBeInstantiatedOnlyOncePerProcess", can.can_be_instantiated_only_once_per_process),
        ("canNotUseMemoryManagementFunctions", can.can_not_use_memory_management_functions),
        ("canGetAndSetFMUstate", can.can_get_and_set_fmu_state),
        ("canSerializeFMUstate", can.can_serialize_fmu_state),
        ("providesDirectionalDerivative", can.provides_directional_derivative),
    ];
    for (name, value) in flags {
        writeln!(xml, r#"      {name}="{value}""#)?;
    }
    writeln!(xml, r#"      maxOutputDerivativeOrder="{}"/>"#, can.max_output_derivative_order)
}

fn write_units<M: Model>(xml: &mut String, registry: &Registry<M>) -> std::fmt::Result {
    let used = |unit: &Unit| registry.groups().any(|(_, group)| group.unit == Some(*unit));
    let units: Vec<Unit> = Unit::ALL.into_iter().filter(used).collect();
    if units.is_empty() {
        return Ok(());
    }
    writeln!(xml, "  <UnitDefinitions>")?;
    for unit in units {
        write!(xml, r#"    <Unit name="{}"><BaseUnit{}/>"#, unit.name(), unit.base_attributes())?;
        if let Some((name, factor)) = unit.display() {
            write!(xml, r#"<DisplayUnit name="{name}" factor="{factor:?}"/>"#)?;
        }
        writeln!(xml, "</Unit>")?;
    }
    writeln!(xml, "  </UnitDefinitions>")
}

fn write_log_categories(xml: &mut String) -> std::fmt::Result {
    writeln!(xml, "  <LogCategories>")?;
    let all = Category::ALL.iter().map(|category| (category.name(), category.description()));
    for (name, description) in all.chain([(LOG_ALL, "all of these")]) {
        writeln!(xml, r#"    <Category name="{}" description="{description}"/>"#, name.to_string_lossy())?;
    }
    writeln!(xml, "  </LogCategories>")
}

/// One variable; causality, variability and initial after the table of FMI 2.0.1, section 2.2.7.
fn write_variable<M: Model>(
    xml: &mut String,
    registry: &Registry<M>,
    model: &M,
    group: &Group<M>,
    first: u32,
    index: usize,
) -> std::fmt::Result {
    let reference = first as usize + index;
    xml.push_str("    <ScalarVariable name=\"");
    registry.write_name(xml, group, index);
    write!(xml, "\" valueReference=\"{reference}\" description=\"{}\"", escaped(group.description))?;
    xml.push_str(match group.causality {
        Causality::Input => " causality=\"input\"",
        Causality::Output => " causality=\"output\" initial=\"calculated\"",
        Causality::Parameter => " causality=\"parameter\" initial=\"exact\"",
    });
    xml.push_str(match group.variability {
        Variability::Fixed => " variability=\"fixed\">",
        Variability::Tunable => " variability=\"tunable\">",
        Variability::Discrete => " variability=\"discrete\">",
        Variability::Continuous => " variability=\"continuous\">",
    });
    let value = group.value(model, index, registry.interface);
    match value {
        Value::Real(_) => xml.push_str("<Real"),
        Value::Integer(_) => xml.push_str("<Integer"),
        Value::Boolean(_) => xml.push_str("<Boolean"),
    }
    if let (Value::Real(_), Some(unit)) = (value, group.unit) {
        write!(xml, " unit=\"{}\"", unit.name())?;
        if let Some((name, _)) = unit.display() {
            write!(xml, " displayUnit=\"{name}\"")?;
        }
    }
    let whole = matches!(value, Value::Integer(_));
    for (name, bound) in [("min", group.range.min), ("max", group.range.max)] {
        match (bound.is_finite() && !matches!(value, Value::Boolean(_)), whole) {
            (false, _) => {}
            (true, true) => write!(xml, " {name}=\"{}\"", bound as i32)?,
            (true, false) => write!(xml, " {name}=\"{bound:?}\"")?,
        }
    }
    if group.causality != Causality::Output {
        match value {
            Value::Real(start) => write!(xml, " start=\"{start:?}\"")?,
            Value::Integer(start) => write!(xml, " start=\"{start}\"")?,
            Value::Boolean(start) => write!(xml, " start=\"{start}\"")?,
        }
    }
    xml.push_str("/></ScalarVariable>\n");
    Ok(())
}

/// References in all dependency lists of a solved start together, at most.
const LONGEST_LISTS: usize = 200_000;

/// Positions of all inputs and parameters.
fn knowns<M: Model>(registry: &Registry<M>) -> Vec<u32> {
    let known = |group: &Group<M>| matches!(group.causality, Causality::Input | Causality::Parameter);
    let of = |(first, group): (u32, &Group<M>)| first..first + group.len() as u32;
    registry.groups().filter(|(_, group)| known(group)).flat_map(of).collect()
}

fn write_structure<M: Model>(
    xml: &mut String,
    registry: &Registry<M>,
    model: &M,
) -> Result<(), RegistryError> {
    let outputs: Vec<_> = registry.groups().filter(|(_, g)| g.causality == Causality::Output).collect();
    xml.push_str("  <ModelStructure>\n");
    if outputs.iter().any(|(_, group)| !group.is_empty()) {
        for element in ["Outputs", "InitialUnknowns"] {
            // A solved start follows every input and parameter. The list says so while it is short; left
            // out, it means just that, and does not grow with the square of the model.
            let follows_all = element == "InitialUnknowns" && M::INITIAL_STATE_FOLLOWS_INPUTS;
            let knowns = if follows_all { knowns(registry) } else { Vec::new() };
            let left_out = knowns.len() * outputs.iter().map(|(_, g)| g.len()).sum::<usize>() > LONGEST_LISTS;
            let knowns = reference_list(knowns);
            let _ = writeln!(xml, "    <{element}>");
            for (first, group) in &outputs {
                let common = match &group.dependencies {
                    _ if follows_all => Some(knowns.clone()),
                    Dependencies::All(names) => Some(reference_list(all_of(registry, group, names)?)),
                    _ => None,
                };
                for index in 0..group.len() {
                    let _ = write!(xml, "      <Unknown index=\"{}\"", *first as usize + index);
                    if !left_out {
                        let own = match &common {
                            Some(_) => String::new(),
                            None => reference_list(dependencies(registry, model, group, index)?),
                        };
                        let list = common.as_ref().unwrap_or(&own);
                        let _ = write!(xml, " dependencies=\"{list}\"");
                    }
                    xml.push_str("/>\n");
                }
            }
            let _ = writeln!(xml, "    </{element}>");
        }
    }
    xml.push_str("  </ModelStructure>\n");
    Ok(())
}

/// The inputs that one output follows within a step.
fn dependencies<M: Model>(
    registry: &Registry<M>,
    model: &M,
    group: &Group<M>,
    index: usize,
) -> Result<Vec<u32>, RegistryError> {
    match &group.dependencies {
        Dependencies::None => Ok(Vec::new()),
        Dependencies::All(names) => all_of(registry, group, names),
        Dependencies::SameIndex(names) => {
            names.iter().map(|name| one_of(registry, group, name, index)).collect()
        }
        Dependencies::Of(list) => {
            list(model, index).into_iter().map(|(name, at)| one_of(registry, group, name, at)).collect()
        }
    }
}

fn all_of<M: Model>(
    registry: &Registry<M>,
    group: &Group<M>,
    names: &[&'static str],
) -> Result<Vec<u32>, RegistryError> {
    let mut references = Vec::new();
    for name in names {
        let (first, input) = input(registry, group, name)?;
        references.extend((0..input.len() as u32).map(|index| first + index));
    }
    Ok(references)
}

fn one_of<M: Model>(
    registry: &Registry<M>,
    group: &Group<M>,
    name: &str,
    index: usize,
) -> Result<u32, RegistryError> {
    let (first, input) = input(registry, group, name)?;
    match input.count {
        None => Ok(first),
        Some(count) if index < count => Ok(first + index as u32),
        Some(count) => {
            let problem = format!("depends on {name}[{}]; expected at most {name}[{count}]", index + 1);
            Err(RegistryError { group: group.name, problem })
        }
    }
}

fn input<'a, M: Model>(
    registry: &'a Registry<M>,
    group: &Group<M>,
    name: &str,
) -> Result<(u32, &'a Group<M>), RegistryError> {
    registry.group(name).filter(|(_, found)| found.causality == Causality::Input).ok_or_else(|| {
        RegistryError { group: group.name, problem: format!("depends on {name}, which is no input") }
    })
}

/// Ascending, each once.
fn reference_list(mut references: Vec<u32>) -> String {
    references.sort_unstable();
    references.dedup();
    let mut list = String::with_capacity(8 * references.len());
    for (position, reference) in references.iter().enumerate() {
        let space = if position == 0 { "" } else { " " };
        let _ = write!(list, "{space}{reference}");
    }
    list
}

/// Text as the value of an attribute.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\r' | '\t' => out.push(' '),
            // The other control characters cannot be written in XML 1.0 at all.
            control if control.is_control() => out.push('\u{fffd}'),
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_escaped() {
        assert_eq!(escaped("a<b & \"c\">\n\u{1}ω"), "a&lt;b &amp; &quot;c&quot;&gt; \u{fffd}ω");
    }

    #[test]
    fn reference_lists_ascend_without_doubles() {
        assert_eq!(reference_list(vec![7, 3, 3, 12]), "3 7 12");
        assert_eq!(reference_list(vec![]), "");
    }
}
