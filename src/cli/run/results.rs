//! The figures of a run and its variants: for the terminal, for `summary.json` and for the report.

use super::super::Failure;
use super::comparison::{self, Compared, Row};
use super::ended::Ended;
use super::record::Record;
use super::sections::{certificates, communication, figures_of_paper, side_by_side};
use crate::report::{
    Agents, FaultRow, Item, Phase, PhaseOptions, Report, Section, Status, error_systems, fault_table,
    five_states, phase_table, phases,
};
use crate::scenario::Resolved;
use miette::{IntoDiagnostic, WrapErr};
use serde::Serialize;
use std::io::Write;
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
    agents: Agents,
    #[serde(skip)]
    events: Vec<(f64, String)>,
    #[serde(skip)]
    options: PhaseOptions,
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
        let n = resolved.control.agents();
        let agents = Agents {
            names: (0..n).map(|i| resolved.bess_name(i)).collect(),
            K_P: resolved.control.K_P.clone(),
            K_Q: resolved.control.K_Q.clone(),
            capacity: resolved.control.capacity.clone(),
            omega_ref: 1.0,
            V_ref: 1.0,
        };
        let events: Vec<(f64, String)> =
            resolved.scenario.events.iter().map(|e| (e.at_s, e.label.clone())).collect();
        let options = PhaseOptions { active_from_s: enabled_from(resolved), ..PhaseOptions::default() };
        let of = |record: &Record| phases(&record.columns()?, &agents, &events, &options);
        let mut variants = Vec::with_capacity(compared.len());
        for Compared { label, record, .. } in compared {
            variants.push(VariantResults { label: label.clone(), phases: of(record).into_diagnostic()? });
        }
        let own = of(main).into_diagnostic()?;
        let side_by_side = if variants.is_empty() {
            Vec::new()
        } else {
            let mut rows = Vec::with_capacity(variants.len() + 1);
            let first = |phases: &[Phase]| phases.iter().find(|p| p.from_s >= options.active_from_s).cloned();
            if let Some(phase) = first(&own) {
                rows.push(comparison::row("as given", resolved, resolved, main, &agents, &phase)?);
            }
            for (k, (c, v)) in compared.iter().zip(&variants).enumerate() {
                if let Some(phase) = first(&v.phases) {
                    let mut row =
                        comparison::row(&c.label, resolved, &c.resolved, &c.record, &agents, &phase)?;
                    row.run = k + 1;
                    rows.push(row);
                }
            }
            rows
        };
        Ok(Self {
            scenario: resolved.scenario.name.clone(),
            simulated_s: match &main.ended {
                Some(_) => main.time_s().last().copied().unwrap_or(0.0),
                None => resolved.scenario.stop_s,
            },
            step_s: resolved.scenario.step_s,
            wall_s: main.outcome.total.as_secs_f64(),
            real_time_factor: main.real_time_factor(),
            worst_sum_of_P_set: main.worst_sum_of_p_set(n),
            phases: own,
            variants,
            eta: comparison::eta_verdict(&side_by_side),
            side_by_side,
            faults: Vec::new(),
            resumed_at_s: main.resumed_at_s(),
            ended,
            agents,
            events,
            options,
        })
    }

    /// Whether everything settled in every phase in which the controller works.
    pub fn settled(&self) -> bool {
        self.phases.iter().filter(|p| p.from_s >= self.options.active_from_s).all(Phase::settled)
    }

    /// The batteries.
    pub fn agents(&self) -> &Agents {
        &self.agents
    }

    /// What counts as settled.
    pub fn options(&self) -> &PhaseOptions {
        &self.options
    }

    /// Writes `summary.json`, whole or not at all.
    pub fn write_summary(&self, path: &Path) -> Result<(), Failure> {
        let text = serde_json::to_string_pretty(self).into_diagnostic()?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        // Readable like any other file of the user.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let written = builder.tempfile_in(folder).and_then(|mut file| {
            writeln!(file, "{text}")?;
            file.persist(path).map_err(|e| e.error).map(|_| ())
        });
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
            items: vec![phase_table(&self.phases, &self.agents, &self.options)],
        });
        if self.side_by_side.len() > 1 {
            sections.push(side_by_side(&self.side_by_side, &self.agents, &self.events, main, compared)?);
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
        sections.push(self.errors(&title("Error systems", paper.map(|p| p.1)), main)?);
        for (variant, Compared { label, record, .. }) in self.variants.iter().zip(compared) {
            let mut section = self.errors(&format!("To compare: {label}"), record)?;
            section.items.insert(0, phase_table(&variant.phases, &self.agents, &self.options));
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
        let figures = five_states(&columns, &self.agents, &self.events).into_diagnostic()?;
        Ok(Section {
            heading: heading.into(),
            text: String::new(),
            items: figures.into_iter().map(Item::Figure).collect(),
        })
    }

    fn errors(&self, heading: &str, record: &Record) -> Result<Section, Failure> {
        let columns = record.columns().into_diagnostic()?;
        let figures = error_systems(&columns, &self.agents, &self.events).into_diagnostic()?;
        Ok(Section {
            heading: heading.into(),
            text: String::new(),
            items: figures.into_iter().map(Item::Figure).collect(),
        })
    }
}

/// When the controller is first enabled, s; infinite if never.
pub fn enabled_from(resolved: &Resolved) -> f64 {
    let on = |set: &serde_json::Map<String, serde_json::Value>| {
        set.get("controller.enable").is_some_and(|v| v.as_bool() == Some(true) || v.as_f64() == Some(1.0))
    };
    if on(&resolved.scenario.initial) {
        return 0.0;
    }
    let times = resolved.scenario.events.iter().filter(|e| on(&e.set)).map(|e| e.at_s);
    times.fold(f64::INFINITY, f64::min)
}
