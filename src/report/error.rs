//! Why a report cannot be made: what, where, found, expected.

/// Why a report cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A standard figure needs a column that was not recorded.
    #[error(
        "column `{name}` is missing; recorded with the same prefix: {recorded}. Record it, or leave this figure out"
    )]
    MissingColumn {
        /// The column looked for.
        name: String,
        /// Columns of the same model, or a note that there is none.
        recorded: String,
    },
    /// The same column twice.
    #[error("column `{name}` is given twice; give each name once")]
    DuplicateColumn {
        /// The column.
        name: String,
    },
    /// Two sequences that belong together differ in length.
    #[error("{place}: found {found} values, expected {expected} ({reason})")]
    Length {
        /// Which sequence.
        place: String,
        /// Its length.
        found: usize,
        /// The length it should have.
        expected: usize,
        /// What it is measured by.
        reason: &'static str,
    },
    /// An edge or a pin of a graph names a node that is not there.
    #[error("graph `{graph}`: {place} names node {found} (counted from 0), but there are {nodes} nodes")]
    NoSuchNode {
        /// Title of the graph.
        graph: String,
        /// The edge or pin.
        place: String,
        /// The index found.
        found: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// A position or weight of a graph is not a finite number.
    #[error("graph `{graph}`: {place} is {found}, expected a finite number")]
    NotFinite {
        /// Title of the graph.
        graph: String,
        /// The node or edge.
        place: String,
        /// The value found.
        found: f64,
    },
    /// The figures cannot be put into JSON.
    #[error("the figures cannot be written as JSON")]
    Json(#[from] serde_json::Error),
}
