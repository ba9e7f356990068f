//! Reads `modelDescription.xml` (FMI 2.0.1, chapter 2.2). Refuses DOCTYPE and entities of its own
//! making: they serve only attacks here. Unknown elements and attributes are passed over, as other
//! importers do.

use super::description::{
    Capabilities, Causality, DefaultExperiment, DescriptionError, Initial, ModelDescription, Variability,
    Variable,
};
use super::value::{Kind, Value};
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::str::FromStr;

/// Bytes of one tag at most, attributes included. The longest seen in the field are descriptions of a page.
const LARGEST_TAG: usize = 1 << 20;
/// Elements inside each other at most; FMI itself needs six.
const DEEPEST: usize = 64;

/// The description in these bytes; `path` is for messages.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<ModelDescription, DescriptionError> {
    let text = decode(bytes).map_err(|found| DescriptionError {
        path: path.to_path_buf(),
        line: 1,
        found,
        expected: "an XML file in UTF-8 or ISO-8859-1".into(),
    })?;
    let mut reader = Reader::from_str(&text);
    let mut walk = Walk { path, text: &text, position: 0, elements: Vec::new(), draft: Draft::default() };
    loop {
        walk.position = reader.buffer_position() as usize;
        match reader.read_event() {
            Err(error) => {
                walk.position = reader.error_position() as usize;
                return Err(walk.error(format!("malformed XML ({error})"), "well-formed XML"));
            }
            Ok(Event::DocType(_)) => {
                return Err(walk.error("a DOCTYPE", "none: FMI needs no DTD or entities"));
            }
            Ok(Event::GeneralRef(entity)) if !entity.is_char_ref() => {
                if !matches!(entity.borrow().into_inner().as_ref(), "lt" | "gt" | "amp" | "apos" | "quot") {
                    return Err(walk.error("an entity of the file's own", "only the five that XML defines"));
                }
            }
            Ok(Event::Start(element) | Event::Empty(element)) if element.len() > LARGEST_TAG => {
                let found = format!("a tag of {} bytes", element.len());
                return Err(walk.error(found, "at most 1048576 bytes"));
            }
            Ok(Event::Start(_)) if walk.elements.len() >= DEEPEST => {
                let found = format!("an element inside {DEEPEST} others");
                return Err(walk.error(found, "fewer levels"));
            }
            Ok(Event::Start(element)) => {
                walk.open(&element)?;
                walk.elements.push(element.name().as_ref().to_owned());
            }
            Ok(Event::Empty(element)) => {
                walk.open(&element)?;
                walk.close(element.name().as_ref())?;
            }
            Ok(Event::End(element)) => {
                walk.elements.pop();
                walk.close(element.name().as_ref())?;
            }
            Ok(Event::Eof) => break,
            Ok(_) => {}
        }
    }
    if let Some(open) = walk.elements.last() {
        return Err(walk.error("the end of the file", &format!("</{open}>")));
    }
    walk.finish()
}

/// UTF-8 without its mark, or Latin-1 where the XML declaration says so.
fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let head = String::from_utf8_lossy(bytes.get(..bytes.len().min(200)).unwrap_or_default()).to_lowercase();
    let declaration = head.split("?>").next().filter(|head| head.starts_with("<?xml")).unwrap_or_default();
    if declaration.contains("iso-8859-1") || declaration.contains("windows-1252") {
        return Ok(bytes.iter().map(|byte| char::from(*byte)).collect::<String>().into());
    }
    std::str::from_utf8(bytes)
        .map(Cow::Borrowed)
        .map_err(|error| format!("bytes that are not UTF-8 ({error})"))
}

/// What has been read so far.
#[derive(Default)]
struct Draft {
    root: Option<[Option<String>; 5]>,
    model_identifier: Option<String>,
    model_exchange: bool,
    capabilities: Capabilities,
    default_experiment: DefaultExperiment,
    log_categories: Vec<String>,
    units_of_types: BTreeMap<String, String>,
    open_type: Option<String>,
    open_variable: Option<OpenVariable>,
    variables: Vec<Variable>,
    names: BTreeSet<String>,
}

/// A ScalarVariable whose type element has not come yet, or has.
struct OpenVariable {
    variable: Variable,
    variability: Option<Variability>,
    typed: bool,
}

struct Walk<'a> {
    path: &'a Path,
    text: &'a str,
    position: usize,
    elements: Vec<String>,
    draft: Draft,
}

impl Walk<'_> {
    fn error(&self, found: impl Into<String>, expected: &str) -> DescriptionError {
        let before = self.text.as_bytes().get(..self.position).unwrap_or(self.text.as_bytes());
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        DescriptionError {
            path: self.path.to_path_buf(),
            line,
            found: found.into(),
            expected: expected.into(),
        }
    }

    fn open(&mut self, element: &BytesStart<'_>) -> Result<(), DescriptionError> {
        let parents: Vec<&str> = self.elements.iter().map(String::as_str).collect();
        let name = element.name();
        match (parents.as_slice(), name.as_ref()) {
            ([], "fmiModelDescription") => self.root(element),
            ([], other) => Err(self.error(format!("<{other}>"), "<fmiModelDescription>")),
            ([_], "CoSimulation") => self.co_simulation(element),
            ([_], "ModelExchange") => {
                self.draft.model_exchange = true;
                Ok(())
            }
            ([_], "DefaultExperiment") => {
                self.draft.default_experiment = DefaultExperiment {
                    start_s: self.number(element, "startTime")?,
                    stop_s: self.number(element, "stopTime")?,
                    tolerance: self.number(element, "tolerance")?,
                    step_s: self.number(element, "stepSize")?,
                };
                Ok(())
            }
            ([_, "LogCategories"], "Category") => {
                let category = self.required(element, "name")?;
                self.draft.log_categories.push(category);
                Ok(())
            }
            ([_, "TypeDefinitions"], "SimpleType") => {
                self.draft.open_type = Some(self.required(element, "name")?);
                Ok(())
            }
            ([_, "TypeDefinitions", "SimpleType"], "Real") => {
                let unit = self.attribute(element, "unit")?;
                if let (Some(name), Some(unit)) = (self.draft.open_type.take(), unit) {
                    self.draft.units_of_types.insert(name, unit);
                }
                Ok(())
            }
            ([_, "ModelVariables"], "ScalarVariable") => self.scalar_variable(element),
            ([_, "ModelVariables", "ScalarVariable"], kind) => {
                let kind = match kind {
                    "Real" => Kind::Real,
                    "Integer" | "Enumeration" => Kind::Integer,
                    "Boolean" => Kind::Boolean,
                    "String" => Kind::String,
                    _ => return Ok(()),
                };
                self.variable_type(element, kind)
            }
            _ => Ok(()),
        }
    }

    fn close(&mut self, name: &str) -> Result<(), DescriptionError> {
        if name != "ScalarVariable" || self.elements.len() != 2 {
            return Ok(());
        }
        let Some(open) = self.draft.open_variable.take() else { return Ok(()) };
        if !open.typed {
            let found = format!("ScalarVariable \"{}\" without a type", open.variable.name);
            return Err(self.error(found, "<Real>, <Integer>, <Boolean>, <String> or <Enumeration> in it"));
        }
        self.draft.variables.push(open.variable);
        Ok(())
    }

    fn root(&mut self, element: &BytesStart<'_>) -> Result<(), DescriptionError> {
        let version = self.required(element, "fmiVersion")?;
        if version != "2.0" {
            let expected = if version.starts_with("3.") {
                "fmiVersion=\"2.0\", which `bess` couples; export the FMU as FMI 2.0 (in `bess export` leave `--fmi 3` \
                 out), or couple it in FMPy, see docs/masters.md"
            } else {
                "fmiVersion=\"2.0\""
            };
            return Err(self.error(format!("fmiVersion=\"{version}\""), expected));
        }
        let name = self.required(element, "modelName")?;
        let guid = self.required(element, "guid")?;
        let description = self.attribute(element, "description")?;
        let tool = self.attribute(element, "generationTool")?;
        self.draft.root = Some([Some(version), Some(name), Some(guid), description, tool]);
        Ok(())
    }

    fn co_simulation(&mut self, element: &BytesStart<'_>) -> Result<(), DescriptionError> {
        let identifier = self.required(element, "modelIdentifier")?;
        let plain = identifier.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if identifier.is_empty() || !plain {
            return Err(self.error(format!("modelIdentifier=\"{identifier}\""), "a C identifier"));
        }
        self.draft.model_identifier = Some(identifier);
        self.draft.capabilities = Capabilities {
            needs_execution_tool: self.flag(element, "needsExecutionTool")?,
            can_handle_variable_step: self.flag(element, "canHandleVariableCommunicationStepSize")?,
            can_interpolate_inputs: self.flag(element, "canInterpolateInputs")?,
            max_output_derivative_order: self.number(element, "maxOutputDerivativeOrder")?.unwrap_or(0),
            can_run_asynchronously: self.flag(element, "canRunAsynchronuously")?,
            can_be_instantiated_only_once: self.flag(element, "canBeInstantiatedOnlyOncePerProcess")?,
            can_not_use_memory_management: self.flag(element, "canNotUseMemoryManagementFunctions")?,
            can_get_and_set_state: self.flag(element, "canGetAndSetFMUstate")?,
            can_serialise_state: self.flag(element, "canSerializeFMUstate")?,
            provides_directional_derivative: self.flag(element, "providesDirectionalDerivative")?,
        };
        Ok(())
    }

    fn scalar_variable(&mut self, element: &BytesStart<'_>) -> Result<(), DescriptionError> {
        let name = self.required(element, "name")?;
        if !self.draft.names.insert(name.clone()) {
            return Err(self.error(format!("a second variable \"{name}\""), "unique names"));
        }
        let reference = self.required(element, "valueReference")?;
        let reference = reference.parse().map_err(|_| {
            self.error(
                format!("valueReference=\"{reference}\" of \"{name}\""),
                "an integer from 0 to 4294967295",
            )
        })?;
        let causality = self.word(element, "causality", Causality::from_word, Causality::WORDS)?;
        let variability = self.word(element, "variability", Variability::from_word, Variability::WORDS)?;
        let initial = self.word(element, "initial", Initial::from_word, Initial::WORDS)?;
        let description = self.attribute(element, "description")?;
        let variable = Variable {
            name,
            reference,
            kind: Kind::Real,
            causality: causality.unwrap_or(Causality::Local),
            variability: variability.unwrap_or(Variability::Continuous),
            initial,
            start: None,
            unit: None,
            description,
        };
        self.draft.open_variable = Some(OpenVariable { variable, variability, typed: false });
        Ok(())
    }

    fn variable_type(&mut self, element: &BytesStart<'_>, kind: Kind) -> Result<(), DescriptionError> {
        let start = match kind {
            Kind::Real => self.number(element, "start")?.map(Value::Real),
            Kind::Integer => self.number(element, "start")?.map(Value::Integer),
            Kind::Boolean => self.boolean(element, "start")?.map(Value::Boolean),
            Kind::String => None,
        };
        let declared = self.attribute(element, "declaredType")?;
        let unit = self
            .attribute(element, "unit")?
            .or_else(|| declared.and_then(|declared| self.draft.units_of_types.get(&declared).cloned()));
        if let Some(open) = &mut self.draft.open_variable {
            open.typed = true;
            open.variable.kind = kind;
            open.variable.start = start;
            open.variable.unit = unit;
            if open.variability.is_none() && kind != Kind::Real {
                open.variable.variability = Variability::Discrete;
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Result<ModelDescription, DescriptionError> {
        let Some([Some(fmi_version), Some(model_name), Some(guid), description, generation_tool]) =
            self.draft.root.take()
        else {
            return Err(self.error("no root element", "<fmiModelDescription>"));
        };
        let Some(model_identifier) = self.draft.model_identifier.take() else {
            let found = if self.draft.model_exchange { "only <ModelExchange>" } else { "no <CoSimulation>" };
            return Err(self.error(found, "<CoSimulation>: this importer runs co-simulation FMUs"));
        };
        Ok(ModelDescription {
            fmi_version,
            model_name,
            guid,
            model_identifier,
            description,
            generation_tool,
            capabilities: self.draft.capabilities,
            default_experiment: self.draft.default_experiment,
            log_categories: self.draft.log_categories,
            variables: self.draft.variables,
        })
    }

    fn attribute(&self, element: &BytesStart<'_>, name: &str) -> Result<Option<String>, DescriptionError> {
        let malformed = |error: &dyn std::fmt::Display| {
            self.error(
                format!("malformed attributes of <{}> ({error})", element.name().as_ref()),
                "name=\"value\" pairs, each name once, with XML's own five entities only",
            )
        };
        let attribute = element.try_get_attribute(name).map_err(|error| malformed(&error))?;
        let Some(attribute) = attribute else { return Ok(None) };
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| malformed(&error))?;
        Ok(Some(value.into_owned()))
    }

    fn required(&self, element: &BytesStart<'_>, name: &str) -> Result<String, DescriptionError> {
        let missing = || {
            self.error(
                format!("<{}> without {name}", element.name().as_ref()),
                &format!("an attribute {name}"),
            )
        };
        self.attribute(element, name)?.ok_or_else(missing)
    }

    fn number<T: FromStr>(
        &self,
        element: &BytesStart<'_>,
        name: &str,
    ) -> Result<Option<T>, DescriptionError> {
        let Some(text) = self.attribute(element, name)? else { return Ok(None) };
        let parsed = text.trim().parse().map_err(|_| self.error(format!("{name}=\"{text}\""), "a number"));
        parsed.map(Some)
    }

    fn boolean(&self, element: &BytesStart<'_>, name: &str) -> Result<Option<bool>, DescriptionError> {
        match self.attribute(element, name)?.as_deref().map(str::trim) {
            None => Ok(None),
            Some("true" | "1") => Ok(Some(true)),
            Some("false" | "0") => Ok(Some(false)),
            Some(other) => Err(self.error(format!("{name}=\"{other}\""), "true, false, 1 or 0")),
        }
    }

    fn flag(&self, element: &BytesStart<'_>, name: &str) -> Result<bool, DescriptionError> {
        Ok(self.boolean(element, name)?.unwrap_or(false))
    }

    fn word<T>(
        &self,
        element: &BytesStart<'_>,
        name: &str,
        read: fn(&str) -> Option<T>,
        words: &[&str],
    ) -> Result<Option<T>, DescriptionError> {
        let Some(text) = self.attribute(element, name)? else { return Ok(None) };
        match read(&text) {
            Some(word) => Ok(Some(word)),
            None => Err(self.error(format!("{name}=\"{text}\""), &format!("one of {}", words.join(", ")))),
        }
    }
}
