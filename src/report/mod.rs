//! What a person looks at: data in, one HTML page out, readable without a network. Never runs a
//! simulation, reads no file, and knows neither the controller nor the grid.
//!
//! A [`Report`] is made of sections, a section of tables, figures over time and communication graphs.
//! [`five_states`], [`error_systems`] and [`phases`] make the usual ones from recorded columns.
#![forbid(unsafe_code)]
#![allow(non_snake_case)]

mod columns;
mod decimate;
mod error;
mod escape;
mod events;
mod faults;
mod figure;
mod graph;
mod graph_labels;
mod graph_layout;
mod page;
mod palette;
mod phases;
mod standard;
mod tree;

pub use columns::Columns;
pub use decimate::{decimate, decimate_shared};
pub use error::ReportError;
pub use faults::{FaultRow, FaultWindow, KeptLimits, fault_lines, fault_row, fault_table};
pub use figure::{Dash, Figure, Line};
pub use graph::{Edge, GraphFigure, Node};
pub use graph_layout::cluster_layout;
pub use palette::{color_of, dash_of};
pub use phases::{Phase, PhaseOptions, format_value, phase_table, phases};
pub use standard::{Agents, ERROR_FLOOR, MAX_LINES, error_systems, five_states};
pub use tree::{Branch, TreeFigure};

/// One page. All texts are plain text: markup in them is shown, never obeyed.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Heading of the page and title of the window: the name of the scenario.
    pub title: String,
    /// One sentence under the heading.
    pub subtitle: String,
    /// The verdict, where there is one.
    pub status: Option<Status>,
    /// In the order shown.
    pub sections: Vec<Section>,
}

/// The verdict under the heading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Status {
    /// Whether it is good news; shown by a sign and a word as well as by the colour.
    pub good: bool,
    /// What is said: "Settled after every event".
    pub text: String,
}

/// A heading, some text, and what belongs under it.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Heading.
    pub heading: String,
    /// Paragraphs, parted by empty lines; may be empty.
    pub text: String,
    /// In the order shown.
    pub items: Vec<Item>,
}

/// A part of a section.
#[derive(Clone, Debug)]
pub enum Item {
    /// Rows and columns.
    Table(Table),
    /// Lines over a common axis.
    Figure(Figure),
    /// A communication graph.
    Graph(GraphFigure),
    /// A spanning tree with its cuts.
    Tree(TreeFigure),
}

/// Rows and columns of text; a cell that reads as a number is set flush right.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// What the table shows.
    pub caption: String,
    /// One cell per column.
    pub header: Vec<String>,
    /// Each as long as the header.
    pub rows: Vec<Vec<String>>,
}
