//! Writes the parameter set of one component (SSP 1.0, chapter 6): its parameters, and the inputs that nobody
//! feeds. And the frame that all documents of the archive share.

use super::PARAMETER_SET;
use super::connections::Connection;
use super::part::{Part, Variable};
use crate::fmi::Causality;
use crate::fmi::lookup::Value;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};
use std::io;

/// Where the documents are written.
pub type XmlWriter = Writer<Vec<u8>>;

const SSC: &str = "http://ssp-standard.org/SSP1/SystemStructureCommon";
const SSV: &str = "http://ssp-standard.org/SSP1/SystemStructureParameterValues";

/// The bytes of a document: declaration, content, a line break.
pub fn document(content: impl FnOnce(&mut XmlWriter) -> io::Result<()>) -> io::Result<Vec<u8>> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    content(&mut xml)?;
    let mut bytes = xml.into_inner();
    bytes.push(b'\n');
    Ok(bytes)
}

/// The bytes of a component's parameter set.
pub fn write(part: &Part, connections: &[Connection]) -> io::Result<Vec<u8>> {
    let listed = |v: &&Variable| match v.causality {
        Causality::Output => false,
        Causality::Parameter => true,
        Causality::Input => !connections.iter().any(|c| c.feeds(part, v)),
    };
    // FMPy takes every Boolean of a parameter set as true, so those stay out that the FMU starts with anyway.
    let needed = |v: &&Variable| !(v.unchanged && matches!(v.value, Value::Boolean(_)));
    document(|xml| {
        xml.create_element("ssv:ParameterSet")
            .with_attributes([("xmlns:ssc", SSC), ("xmlns:ssv", SSV)])
            .with_attributes([("version", "1.0"), ("name", PARAMETER_SET)])
            .write_inner_content(|xml| {
                xml.create_element("ssv:Parameters").write_inner_content(|xml| {
                    part.variables.iter().filter(listed).filter(needed).try_for_each(|v| parameter(xml, v))
                })?;
                Ok(())
            })?;
        Ok(())
    })
}

fn parameter(xml: &mut XmlWriter, variable: &Variable) -> io::Result<()> {
    let value = match variable.value {
        Value::Real(value) => format!("{value:?}"),
        Value::Integer(value) => value.to_string(),
        Value::Boolean(value) => value.to_string(),
    };
    xml.create_element("ssv:Parameter")
        .with_attribute(("name", variable.name.as_str()))
        .write_inner_content(|xml| {
            xml.create_element(format!("ssv:{}", variable.kind))
                .with_attribute(("value", value.as_str()))
                .write_empty()?;
            Ok(())
        })?;
    Ok(())
}
