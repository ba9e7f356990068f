//! `modelDescription.xml` as it stands, line by line: lenient where the importer of `harness` is strict, so that
//! one mistake does not hide the next.

use super::finding::{Finding, Place};
use super::rules;
use roxmltree::{Document as Tree, Node};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// UTF-8 without its mark, or Latin-1 where the XML declaration says so.
pub fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, Box<Finding>> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let head = String::from_utf8_lossy(bytes.get(..bytes.len().min(200)).unwrap_or_default()).to_lowercase();
    let declaration = head.split("?>").next().filter(|head| head.starts_with("<?xml")).unwrap_or_default();
    if declaration.contains("iso-8859-1") || declaration.contains("windows-1252") {
        return Ok(bytes.iter().map(|byte| char::from(*byte)).collect::<String>().into());
    }
    std::str::from_utf8(bytes).map(Cow::Borrowed).map_err(|error| {
        let before = bytes.get(..error.valid_up_to()).unwrap_or_default();
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count() as u32;
        let mend = "write the file in UTF-8, and say so in its first line";
        Box::new(Finding::new(
            &rules::MALFORMED,
            Place::line(line),
            "bytes that are not UTF-8",
            "text in UTF-8",
            mend,
        ))
    })
}

/// The tree; a DOCTYPE is refused.
pub fn parse(text: &str) -> Result<Tree<'_>, Box<Finding>> {
    Tree::parse(text).map_err(|error| {
        let line = error.pos().row;
        let found = format!("malformed XML: {error}");
        Box::new(Finding::new(
            &rules::MALFORMED,
            Place::line(line),
            found,
            "well-formed XML without a DTD",
            "mend the XML at that line",
        ))
    })
}

/// The parts of the description that the rules ask for.
pub struct Document<'a> {
    /// `fmiModelDescription`, or whatever the root is.
    pub root: Node<'a, 'a>,
    /// `ModelExchange` and `CoSimulation`, as far as they are there.
    pub implementations: Vec<Node<'a, 'a>>,
    /// All variables, in order.
    pub variables: Vec<Variable<'a>>,
    /// Declared types by name: the element within `SimpleType`.
    pub types: BTreeMap<&'a str, Node<'a, 'a>>,
}

/// One ScalarVariable, defaults filled in.
pub struct Variable<'a> {
    /// Its element.
    pub node: Node<'a, 'a>,
    /// The element with its type, where there is one.
    pub typed: Option<Node<'a, 'a>>,
    /// Name; empty where missing.
    pub name: &'a str,
    /// Value reference, where it is a number.
    pub reference: Option<u32>,
    /// `local` where missing.
    pub causality: &'a str,
    /// As given; where missing `continuous` for a Real and `discrete` for others, as importers read it.
    pub variability: &'a str,
    /// As given, or the default of the standard's table; none where the table has none.
    pub initial: Option<&'a str>,
}

impl<'a> Document<'a> {
    /// Reads what is there.
    pub fn of(tree: &'a Tree<'a>) -> Self {
        let root = tree.root_element();
        let implementations = children(root)
            .filter(|node| matches!(node.tag_name().name(), "ModelExchange" | "CoSimulation"))
            .collect();
        let within = |part: &'static str| {
            children(root).filter(move |node| node.has_tag_name(part)).flat_map(children)
        };
        let variables =
            within("ModelVariables").filter(|n| n.has_tag_name("ScalarVariable")).map(Variable::of).collect();
        let types = within("TypeDefinitions")
            .filter_map(|node| Some((node.attribute("name")?, children(node).next()?)))
            .collect();
        Self { root, implementations, variables, types }
    }

    /// The elements of one part of `ModelStructure`, or none where the part is missing.
    pub fn unknowns(&self, part: &str) -> Vec<Node<'a, 'a>> {
        let structure = children(self.root).filter(|node| node.has_tag_name("ModelStructure"));
        let parts = structure.flat_map(children).filter(|node| node.has_tag_name(part));
        parts.flat_map(children).filter(|node| node.has_tag_name("Unknown")).collect()
    }

    /// The model's element of this name.
    pub fn part(&self, name: &str) -> Option<Node<'a, 'a>> {
        children(self.root).find(|node| node.has_tag_name(name))
    }

    /// One line for a person.
    pub fn summary(&self) -> String {
        let attribute = |name| self.root.attribute(name).unwrap_or("(none)");
        let kinds: Vec<&str> = self
            .implementations
            .iter()
            .map(|node| if node.has_tag_name("CoSimulation") { "co-simulation" } else { "model exchange" })
            .collect();
        format!(
            "{}, FMI {}, {}, {} variables, made by {}",
            attribute("modelName"),
            attribute("fmiVersion"),
            if kinds.is_empty() { "no implementation".to_owned() } else { kinds.join(" and ") },
            self.variables.len(),
            attribute("generationTool")
        )
    }
}

impl<'a> Variable<'a> {
    fn of(node: Node<'a, 'a>) -> Self {
        let kinds = ["Real", "Integer", "Boolean", "String", "Enumeration"];
        let typed = children(node).find(|child| kinds.contains(&child.tag_name().name()));
        let is_real = typed.is_none_or(|t| t.has_tag_name("Real"));
        let causality = node.attribute("causality").unwrap_or("local");
        let variability =
            node.attribute("variability").unwrap_or(if is_real { "continuous" } else { "discrete" });
        Self {
            node,
            typed,
            name: node.attribute("name").unwrap_or_default(),
            reference: node.attribute("valueReference").and_then(|text| text.trim().parse().ok()),
            causality,
            variability,
            initial: node.attribute("initial").or(super::initial::default(causality, variability)),
        }
    }

    /// `Real`, `Integer`, ...; empty where there is none.
    pub fn kind(&self) -> &'a str {
        self.typed.map_or("", |typed| typed.tag_name().name())
    }

    /// An attribute of its type element.
    pub fn typed_attribute(&self, name: &str) -> Option<&'a str> {
        self.typed.and_then(|typed| typed.attribute(name))
    }

    /// Where it is.
    pub fn place(&self) -> Place {
        Place { variable: Some(self.name.to_owned()), ..place(self.node) }
    }
}

/// The elements directly within.
pub fn children<'a>(node: Node<'a, 'a>) -> impl Iterator<Item = Node<'a, 'a>> {
    node.children().filter(Node::is_element)
}

/// Where an element begins. Counts the lines before it, hence only for what is wrong.
pub fn place(node: Node<'_, '_>) -> Place {
    Place::line(node.document().text_pos_at(node.range().start).row)
}
