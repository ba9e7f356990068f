//! Writes SystemStructure.ssd (SSP 1.0, chapter 5) in the one form that FMPy, libcosim, Ecos and OMSimulator all
//! open: no connectors of the system itself, a parameter set at each component, and for OMSimulator an annotation
//! of its own with a fixed step.

use super::connections::Connection;
use super::part::{Part, Variable};
use super::ssv::XmlWriter;
use crate::fmi::Causality;
use crate::scenario::Resolved;
use std::io;

const SSC: &str = "http://ssp-standard.org/SSP1/SystemStructureCommon";
const SSD: &str = "http://ssp-standard.org/SSP1/SystemStructureDescription";
const OMS: &str = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd";

/// The bytes of SystemStructure.ssd.
pub fn write(resolved: &Resolved, parts: &[Part], connections: &[Connection]) -> io::Result<Vec<u8>> {
    let scenario = &resolved.scenario;
    let (step, stop) = (format!("{:?}", scenario.step_s), format!("{:?}", scenario.stop_s));
    let tool = concat!("bess-consensus ", env!("CARGO_PKG_VERSION"));
    super::ssv::document(|xml| {
        xml.create_element("ssd:SystemStructureDescription")
            .with_attributes([("xmlns:ssc", SSC), ("xmlns:ssd", SSD), ("version", "1.0")])
            .with_attributes([("name", scenario.name.as_str()), ("generationTool", tool)])
            .write_inner_content(|xml| {
                xml.create_element("ssd:System").with_attribute(("name", "system")).write_inner_content(
                    |xml| {
                        xml.create_element("ssd:Elements").write_inner_content(|xml| {
                            parts.iter().try_for_each(|part| component(xml, part, connections))
                        })?;
                        xml.create_element("ssd:Connections").write_inner_content(|xml| {
                            connections.iter().try_for_each(|c| connection(xml, c))
                        })?;
                        annotations(xml, &step)
                    },
                )?;
                xml.create_element("ssd:DefaultExperiment")
                    .with_attributes([("startTime", "0.0"), ("stopTime", stop.as_str())])
                    .write_empty()?;
                Ok(())
            })?;
        Ok(())
    })
}

fn component(xml: &mut XmlWriter, part: &Part, connections: &[Connection]) -> io::Result<()> {
    xml.create_element("ssd:Component")
        .with_attributes([("name", part.name.as_str()), ("type", "application/x-fmu-sharedlibrary")])
        .with_attributes([("source", part.source.as_str()), ("implementation", "CoSimulation")])
        .write_inner_content(|xml| {
            xml.create_element("ssd:Connectors").write_inner_content(|xml| {
                let shown = part.variables.iter().filter(|v| is_connector(part, v, connections));
                shown.into_iter().try_for_each(|v| connector(xml, v))
            })?;
            xml.create_element("ssd:ParameterBindings").write_inner_content(|xml| {
                xml.create_element("ssd:ParameterBinding")
                    .with_attribute(("source", part.parameter_file().as_str()))
                    .write_empty()?;
                Ok(())
            })?;
            Ok(())
        })?;
    Ok(())
}

/// Outputs and connected inputs. The other inputs have their values in the parameter set: FMPy feeds every input
/// connector that it finds unconnected with 0 at each step, and topology 0 is none.
fn is_connector(part: &Part, variable: &Variable, connections: &[Connection]) -> bool {
    match variable.causality {
        Causality::Output => true,
        Causality::Input => connections.iter().any(|c| c.feeds(part, variable)),
        Causality::Parameter => false,
    }
}

fn connector(xml: &mut XmlWriter, variable: &Variable) -> io::Result<()> {
    let kind = if variable.causality == Causality::Output { "output" } else { "input" };
    xml.create_element("ssd:Connector")
        .with_attributes([("name", variable.name.as_str()), ("kind", kind)])
        .write_inner_content(|xml| {
        xml.create_element(format!("ssc:{}", variable.kind)).write_empty()?;
        Ok(())
    })?;
    Ok(())
}

fn connection(xml: &mut XmlWriter, connection: &Connection) -> io::Result<()> {
    let Connection { from, to, factor, offset } = connection;
    let element = xml
        .create_element("ssd:Connection")
        .with_attributes([("startElement", from.0.name.as_str()), ("startConnector", from.1.name.as_str())])
        .with_attributes([("endElement", to.0.name.as_str()), ("endConnector", to.1.name.as_str())]);
    if (*factor, *offset) == (1.0, 0.0) {
        element.write_empty()?;
        return Ok(());
    }
    let (factor, offset) = (format!("{factor:?}"), format!("{offset:?}"));
    element.write_inner_content(|xml| {
        xml.create_element("ssc:LinearTransformation")
            .with_attributes([("factor", factor.as_str()), ("offset", offset.as_str())])
            .write_empty()?;
        Ok(())
    })?;
    Ok(())
}

/// OMSimulator takes its step size from here.
fn annotations(xml: &mut XmlWriter, step: &str) -> io::Result<()> {
    let master = [
        ("description", "oms-ma"),
        ("stepSize", step),
        ("absoluteTolerance", "0.0001"),
        ("relativeTolerance", "0.0001"),
    ];
    xml.create_element("ssd:Annotations").write_inner_content(|xml| {
        xml.create_element("ssc:Annotation")
            .with_attribute(("type", "org.openmodelica"))
            .write_inner_content(|xml| {
                xml.create_element("oms:Annotations")
                    .with_attribute(("xmlns:oms", OMS))
                    .write_inner_content(|xml| {
                        xml.create_element("oms:SimulationInformation").write_inner_content(|xml| {
                            xml.create_element("oms:FixedStepMaster")
                                .with_attributes(master)
                                .write_empty()?;
                            Ok(())
                        })?;
                        Ok(())
                    })?;
                Ok(())
            })?;
        Ok(())
    })?;
    Ok(())
}
