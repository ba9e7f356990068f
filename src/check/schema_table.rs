//! The XML Schema of FMI 2.0 (`fmi2ModelDescription.xsd` and what it includes) as a table: which elements stand
//! where, in which order, with which attributes. The table only; `schema` reads it.

use Type::{Bool, DateTime, Double, Int, Kinds, Text, Unsigned, UnsignedList, Words};

/// Type of an attribute.
#[derive(Clone, Copy)]
pub enum Type {
    /// xs:string or xs:normalizedString.
    Text,
    /// xs:boolean.
    Bool,
    /// xs:int.
    Int,
    /// xs:unsignedInt.
    Unsigned,
    /// xs:double.
    Double,
    /// xs:dateTime.
    DateTime,
    /// One of these.
    Words(&'static [&'static str]),
    /// A list of xs:unsignedInt.
    UnsignedList,
    /// A list of these.
    Kinds(&'static [&'static str]),
}

/// An attribute: name, type, whether it is required.
pub type Attribute = (&'static str, Type, bool);

/// A place in a sequence: one of these elements, at least and at most so often.
pub struct Particle {
    /// Any one of them.
    pub any_of: &'static [&'static Element],
    /// minOccurs.
    pub least: u32,
    /// maxOccurs.
    pub most: u32,
}

/// An element.
pub struct Element {
    /// Its name.
    pub name: &'static str,
    /// Its own attributes.
    own: &'static [Attribute],
    /// Those that it shares with others.
    shared: &'static [Attribute],
    /// Its elements, in order.
    pub sequence: &'static [Particle],
    /// Whether anything may stand in it.
    pub open: bool,
}

impl Element {
    /// Its attributes.
    pub fn attributes(&self) -> impl Iterator<Item = &'static Attribute> {
        self.own.iter().chain(self.shared)
    }

    const fn and(self, shared: &'static [Attribute]) -> Element {
        Element { shared, ..self }
    }
}

const MANY: u32 = u32::MAX;

const fn leaf(name: &'static str, own: &'static [Attribute]) -> Element {
    node(name, own, &[])
}

const fn node(name: &'static str, own: &'static [Attribute], sequence: &'static [Particle]) -> Element {
    Element { name, own, shared: &[], sequence, open: false }
}

const fn some(any_of: &'static [&'static Element], least: u32, most: u32) -> Particle {
    Particle { any_of, least, most }
}

static FILE: Element = leaf("File", &[("name", Text, true)]);
static SOURCE_FILES: Element = node("SourceFiles", &[], &[some(&[&FILE], 1, MANY)]);

/// Of both kinds of FMU.
const OF_BOTH: &[Attribute] = &[
    ("modelIdentifier", Text, true),
    ("needsExecutionTool", Bool, false),
    ("canBeInstantiatedOnlyOncePerProcess", Bool, false),
    ("canNotUseMemoryManagementFunctions", Bool, false),
    ("canGetAndSetFMUstate", Bool, false),
    ("canSerializeFMUstate", Bool, false),
    ("providesDirectionalDerivative", Bool, false),
];
static MODEL_EXCHANGE: Element = node(
    "ModelExchange",
    &[("completedIntegratorStepNotNeeded", Bool, false)],
    &[some(&[&SOURCE_FILES], 0, 1)],
)
.and(OF_BOTH);
static CO_SIMULATION: Element = node(
    "CoSimulation",
    &[
        ("canHandleVariableCommunicationStepSize", Bool, false),
        ("canInterpolateInputs", Bool, false),
        ("maxOutputDerivativeOrder", Unsigned, false),
        ("canRunAsynchronuously", Bool, false),
    ],
    &[some(&[&SOURCE_FILES], 0, 1)],
)
.and(OF_BOTH);

static BASE_UNIT: Element = leaf(
    "BaseUnit",
    &[
        ("kg", Int, false),
        ("m", Int, false),
        ("s", Int, false),
        ("A", Int, false),
        ("K", Int, false),
        ("mol", Int, false),
        ("cd", Int, false),
        ("rad", Int, false),
        ("factor", Double, false),
        ("offset", Double, false),
    ],
);
static DISPLAY_UNIT: Element =
    leaf("DisplayUnit", &[("name", Text, true), ("factor", Double, false), ("offset", Double, false)]);
static UNIT: Element =
    node("Unit", &[("name", Text, true)], &[some(&[&BASE_UNIT], 0, 1), some(&[&DISPLAY_UNIT], 0, MANY)]);
static UNITS: Element = node("UnitDefinitions", &[], &[some(&[&UNIT], 1, MANY)]);

/// The group fmi2RealAttributes.
const OF_REALS: &[Attribute] = &[
    ("quantity", Text, false),
    ("unit", Text, false),
    ("displayUnit", Text, false),
    ("relativeQuantity", Bool, false),
    ("min", Double, false),
    ("max", Double, false),
    ("nominal", Double, false),
    ("unbounded", Bool, false),
];
/// The group fmi2IntegerAttributes.
const OF_INTEGERS: &[Attribute] = &[("quantity", Text, false), ("min", Int, false), ("max", Int, false)];

static TYPE_REAL: Element = leaf("Real", OF_REALS);
static TYPE_INTEGER: Element = leaf("Integer", OF_INTEGERS);
static TYPE_BOOLEAN: Element = leaf("Boolean", &[]);
static TYPE_STRING: Element = leaf("String", &[]);
static ITEM: Element =
    leaf("Item", &[("name", Text, true), ("value", Int, true), ("description", Text, false)]);
static TYPE_ENUMERATION: Element =
    node("Enumeration", &[("quantity", Text, false)], &[some(&[&ITEM], 1, MANY)]);
static SIMPLE_TYPE: Element = node(
    "SimpleType",
    &[("name", Text, true), ("description", Text, false)],
    &[some(&[&TYPE_REAL, &TYPE_INTEGER, &TYPE_BOOLEAN, &TYPE_STRING, &TYPE_ENUMERATION], 1, 1)],
);
static TYPES: Element = node("TypeDefinitions", &[], &[some(&[&SIMPLE_TYPE], 1, MANY)]);

static CATEGORY: Element = leaf("Category", &[("name", Text, true), ("description", Text, false)]);
static LOG_CATEGORIES: Element = node("LogCategories", &[], &[some(&[&CATEGORY], 1, MANY)]);
static EXPERIMENT: Element = leaf(
    "DefaultExperiment",
    &[
        ("startTime", Double, false),
        ("stopTime", Double, false),
        ("tolerance", Double, false),
        ("stepSize", Double, false),
    ],
);
static TOOL: Element = Element { open: true, ..leaf("Tool", &[("name", Text, true)]) };
static VENDOR: Element = node("VendorAnnotations", &[], &[some(&[&TOOL], 1, MANY)]);
static ANNOTATIONS: Element = node("Annotations", &[], &[some(&[&TOOL], 1, MANY)]);

static REAL: Element = leaf(
    "Real",
    &[
        ("declaredType", Text, false),
        ("start", Double, false),
        ("derivative", Unsigned, false),
        ("reinit", Bool, false),
    ],
)
.and(OF_REALS);
static INTEGER: Element =
    leaf("Integer", &[("declaredType", Text, false), ("start", Int, false)]).and(OF_INTEGERS);
static BOOLEAN: Element = leaf("Boolean", &[("declaredType", Text, false), ("start", Bool, false)]);
static STRING: Element = leaf("String", &[("declaredType", Text, false), ("start", Text, false)]);
static ENUMERATION: Element =
    leaf("Enumeration", &[("declaredType", Text, true), ("start", Int, false)]).and(OF_INTEGERS);
static VARIABLE: Element = node(
    "ScalarVariable",
    &[
        ("name", Text, true),
        ("valueReference", Unsigned, true),
        ("description", Text, false),
        (
            "causality",
            Words(&["parameter", "calculatedParameter", "input", "output", "local", "independent"]),
            false,
        ),
        ("variability", Words(&["constant", "fixed", "tunable", "discrete", "continuous"]), false),
        ("initial", Words(&["exact", "approx", "calculated"]), false),
        ("canHandleMultipleSetPerTimeInstant", Bool, false),
    ],
    &[some(&[&REAL, &INTEGER, &BOOLEAN, &STRING, &ENUMERATION], 1, 1), some(&[&ANNOTATIONS], 0, 1)],
);
static VARIABLES: Element = node("ModelVariables", &[], &[some(&[&VARIABLE], 1, MANY)]);

static UNKNOWN: Element = leaf(
    "Unknown",
    &[
        ("index", Unsigned, true),
        ("dependencies", UnsignedList, false),
        ("dependenciesKind", Kinds(&["dependent", "constant", "fixed", "tunable", "discrete"]), false),
    ],
);
static OUTPUTS: Element = node("Outputs", &[], &[some(&[&UNKNOWN], 1, MANY)]);
static DERIVATIVES: Element = node("Derivatives", &[], &[some(&[&UNKNOWN], 1, MANY)]);
static INITIAL_UNKNOWNS: Element = node("InitialUnknowns", &[], &[some(&[&UNKNOWN], 1, MANY)]);
static STRUCTURE: Element = node(
    "ModelStructure",
    &[],
    &[some(&[&OUTPUTS], 0, 1), some(&[&DERIVATIVES], 0, 1), some(&[&INITIAL_UNKNOWNS], 0, 1)],
);

/// The root.
pub static ROOT: Element = node(
    "fmiModelDescription",
    &[
        ("fmiVersion", Text, true),
        ("modelName", Text, true),
        ("guid", Text, true),
        ("description", Text, false),
        ("author", Text, false),
        ("version", Text, false),
        ("copyright", Text, false),
        ("license", Text, false),
        ("generationTool", Text, false),
        ("generationDateAndTime", DateTime, false),
        ("variableNamingConvention", Words(&["flat", "structured"]), false),
        ("numberOfEventIndicators", Unsigned, false),
    ],
    &[
        // The schema allows none at all; `model` asks for one.
        some(&[&MODEL_EXCHANGE, &CO_SIMULATION], 0, 4),
        some(&[&UNITS], 0, 1),
        some(&[&TYPES], 0, 1),
        some(&[&LOG_CATEGORIES], 0, 1),
        some(&[&EXPERIMENT], 0, 1),
        some(&[&VENDOR], 0, 1),
        some(&[&VARIABLES], 1, 1),
        some(&[&STRUCTURE], 1, 1),
    ],
);
