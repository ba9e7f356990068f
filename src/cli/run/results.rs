//! The figures of a run and its variants: for the terminal, for `summary.json` and for the report.

use super::super::Failure;
use super::comparison::{self, Compared, Row};
use super::ended::Ended;
use super::record::Record;
use super::sections::{certificates, communication, figures_of_paper, side_by_side};
use super::terms::Terms;
use crate::harness::whole::write_whole;
use crate::report::{FaultRow, Item, Phase, Report, Section, Status, fault_table, five_states, phase_table};
use crate::scenario::Resolved;
use miette::{IntoDiagnostic, WrapErr};
use serde::Serialize;
use std::path::Path;

/// What `summary.json` holds.
#[derive(Serialize)]
pub struct Results {
    /// Name of the scenario.
    pub scenario: String,
    /// Simulated time, s.
    pub simulated_s: f64,
    /// Communication step, s.
    pub step_s: f64,
    /// Wall time of the coupled run, recording included, s.
    pub wall_s: f64,
    /// Simulated time over wall time.
    pub real_time_factor: f64,
    /// Largest abs(sum of P_set) at any communication point, pu.
    pub worst_sum_of_P_set: f64,
    /// From event to event.
    pub phases: Vec<Phase>,
    /// The same scenario with other keys.
    pub variants: Vec<VariantResults>,
    /// The run and its variants from enabling to the next event; empty without variants.
    pub side_by_side: Vec<Row>,
    /// In which range of eta the smaller one is faster, where eta was varied.
    pub eta: Option<String>,
    /// What goes wrong, line by line; empty without faults.
    pub faults: Vec<FaultRow>,
    /// Where an interrupted run was resumed, s; wall time and real-time factor count from there.
    pub resumed_at_s: Option<f64>,
    /// What ended the run too early; all figures are of the time before.
    pub ended: Option<Ended>,
    #[serde(skip)]
    terms: Terms,
}

/// A variant, phase by phase.
#[derive(Serialize)]
pub struct VariantResults {
    /// What is different.
    pub label: String,
    /// From event to event.
    pub phases: Vec<Phase>,
}

impl Results {
    /// Sums up the run and its variants.
    pub fn new(
        resolved: &Resolved,
        main: &Record,
        compared: &[Compared],
        ended: Option<Ended>,
    ) -> Result<Self, Failure> {
        let terms = Terms::of(resolved);
        let own = terms.phases(main).into_diagnostic()?;
        let mut rows = Vec::with_capacity(compared.len() + 1);
        if let Some(phase) = terms.first_active(&own).filter(|_| !compared.is_empty()) {
            rows.push(comparison::row("as given", resolved, resolved, main, phase)?);
        }
        let mut variants = Vec::with_capacity(compared.len());
        for (k, Compared { label, resolved: other, record }) in compared.iter().enumerate() {
            let terms = Terms::of(other);
            let phases = terms.phases(record).into_diagnostic()?;
            if let Some(phase) = terms.first_active(&phases) {
                let mut row = comparison::row(label, resolved, other, record, phase)?;
                row.run = k + 1;
                rows.push(row);
            }
            variants.push(VariantResults { label: label.clone(), phases });
        }
        Ok(Self {
            scenario: resolved.scenario.name.clone(),
            simulated_s: match &main.ended {
                Some(_) => main.time_s().last().copied().unwrap_or(0.0),
                None => resolved.scenario.stop_s,
            },
            step_s: resolved.scenario.step_s,
            wall_s: main.outcome.total.as_secs_f64(),
            real_time_factor: main.real_time_factor(),
            worst_sum_of_P_set: main.worst_sum_of_p_set(resolved.control.agents()),
            phases: own,
            variants,
            eta: comparison::eta_verdict(&rows),
            side_by_side: rows,
            faults: Vec::new(),
            resumed_at_s: main.resumed_at_s(),
            ended,
            terms,
        })
    }

    /// Whether everything settled in every phase in which the controller works.
    pub fn settled(&self) -> bool {
        self.phases.iter().filter(|p| p.from_s >= self.terms.options.active_from_s).all(Phase::settled)
    }

    /// What the run itself is judged by.
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// Writes `summary.json`, whole or not at all.
    pub fn write_summary(&self, path: &Path) -> Result<(), Failure> {
        let text = serde_json::to_string_pretty(self).into_diagnostic()?;
        let written = write_whole(path, &[text.as_bytes(), b"\n"]);
        Ok(written.into_diagnostic().wrap_err_with(|| format!("{}: cannot be written", path.display()))?)
    }

    /// The page.
    pub fn report(
        &self,
        resolved: &Resolved,
        main: &Record,
        compared: &[Compared],
    ) -> Result<Report, Failure> {
        let mut sections: Vec<Section> = self.ended.iter().map(Ended::section).collect();
        sections.push(Section {
            heading: "Figures of the run".into(),
            text: format!(
                "{} s simulated in {:.3} s, {:.0} times faster than real time, with a communication step of \
                     {} s. The sum of the power references stayed within {:.1e} pu of zero.",
                self.simulated_s, self.wall_s, self.real_time_factor, self.step_s, self.worst_sum_of_P_set
            ),
            items: vec![phase_table(&self.phases, &self.terms.agents, &self.terms.options)],
        });
        if self.side_by_side.len() > 1 {
            sections.push(side_by_side(&self.side_by_side, (&self.terms, main), compared)?);
        }
        if !self.faults.is_empty() {
            sections.push(Section {
                heading: "Faults".into(),
                text: "Each line is a run of its own.".into(),
                items: vec![fault_table(&self.faults)],
            });
        }
        let paper = figures_of_paper(&self.scenario);
        let title = |what: &str, figure: Option<u32>| {
            figure.map_or_else(|| what.to_owned(), |k| format!("{what} (the paper's Figure {k})"))
        };
        sections.push(self.states(&title("The five states", paper.map(|p| p.0)), main)?);
        sections.push(errors(&title("Error systems", paper.map(|p| p.1)), &self.terms, main)?);
        for (variant, Compared { label, resolved, record }) in self.variants.iter().zip(compared) {
            let terms = Terms::of(resolved);
            let mut section = errors(&format!("To compare: {label}"), &terms, record)?;
            section.items.insert(0, phase_table(&variant.phases, &terms.agents, &terms.options));
            sections.push(section);
        }
        sections.push(communication(resolved));
        // Without a network the errors that the certified times start from are not known.
        if resolved.grid.is_some() {
            sections.push(certificates(resolved)?);
        }
        Ok(Report {
            title: resolved.scenario.name.clone(),
            subtitle: resolved.scenario.description.clone(),
            status: Some(self.ended.as_ref().map_or_else(|| self.status(), Ended::status)),
            sections,
        })
    }

    fn status(&self) -> Status {
        let text =
            if self.settled() { "Settled after every event" } else { "Not settled after every event" }.into();
        Status { good: self.settled(), text }
    }

    fn states(&self, heading: &str, record: &Record) -> Result<Section, Failure> {
        let columns = record.columns().into_diagnostic()?;
        let figures = five_states(&columns, &self.terms.agents, &self.terms.events).into_diagnostic()?;
        Ok(Section {
            heading: heading.into(),
            text: String::new(),
            items: figures.into_iter().map(Item::Figure).collect(),
        })
    }
}

fn errors(heading: &str, terms: &Terms, record: &Record) -> Result<Section, Failure> {
    let figures = terms.errors(record).into_diagnostic()?;
    Ok(Section {
        heading: heading.into(),
        text: String::new(),
        items: figures.into_iter().map(Item::Figure).collect(),
    })
}
