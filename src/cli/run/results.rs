//! The figures of a run and its variants: for the terminal, for `summary.json` and for the report.

use super::super::Failure;
use super::record::Record;
use crate::control::topology::Topologies;
use crate::report::{
    Agents, Edge, GraphFigure, Item, Node, Phase, PhaseOptions, Report, Section, Status, cluster_layout,
    error_systems, five_states, phase_table, phases,
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
    pub fn new(resolved: &Resolved, main: &Record, compared: &[(String, Record)]) -> Result<Self, Failure> {
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
        for (label, record) in compared {
            variants.push(VariantResults { label: label.clone(), phases: of(record).into_diagnostic()? });
        }
        Ok(Self {
            scenario: resolved.scenario.name.clone(),
            simulated_s: resolved.scenario.stop_s,
            step_s: resolved.scenario.step_s,
            wall_s: main.outcome.total.as_secs_f64(),
            real_time_factor: main.real_time_factor(),
            worst_sum_of_P_set: main.worst_sum_of_p_set(n),
            phases: of(main).into_diagnostic()?,
            variants,
            agents,
            events,
            options,
        })
    }

    /// Whether everything settled in every phase in which the controller works.
    pub fn settled(&self) -> bool {
        self.phases.iter().filter(|p| p.from_s >= self.options.active_from_s).all(Phase::settled)
    }

    /// What counts as settled.
    pub fn options(&self) -> &PhaseOptions {
        &self.options
    }

    /// Writes `summary.json`, whole or not at all.
    pub fn write_summary(&self, path: &Path) -> Result<(), Failure> {
        let text = serde_json::to_string_pretty(self).into_diagnostic()?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let written = tempfile::NamedTempFile::new_in(folder).and_then(|mut file| {
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
        compared: &[(String, Record)],
    ) -> Result<Report, Failure> {
        let mut sections = vec![
            Section {
                heading: "Figures of the run".into(),
                text: format!(
                    "{} s simulated in {:.3} s, {:.0} times faster than real time, with a communication step of \
                     {} s. The sum of the power references stayed within {:.1e} pu of zero.",
                    self.simulated_s,
                    self.wall_s,
                    self.real_time_factor,
                    self.step_s,
                    self.worst_sum_of_P_set
                ),
                items: vec![phase_table(&self.phases, &self.agents, &self.options)],
            },
            self.states("The five states", main)?,
            self.errors("Error systems", main)?,
        ];
        for (variant, (label, record)) in self.variants.iter().zip(compared) {
            let mut section = self.errors(&format!("To compare: {label}"), record)?;
            section.items.insert(0, phase_table(&variant.phases, &self.agents, &self.options));
            sections.push(section);
        }
        sections.push(graphs(resolved));
        Ok(Report {
            title: resolved.scenario.name.clone(),
            subtitle: resolved.scenario.description.clone(),
            status: Some(Status {
                good: self.settled(),
                text: if self.settled() {
                    "Settled after every event"
                } else {
                    "Not settled after every event"
                }
                .into(),
            }),
            sections,
        })
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
fn enabled_from(resolved: &Resolved) -> f64 {
    let on = |set: &serde_json::Map<String, serde_json::Value>| {
        set.get("controller.enable").is_some_and(|v| v.as_bool() == Some(true) || v.as_f64() == Some(1.0))
    };
    if on(&resolved.scenario.initial) {
        return 0.0;
    }
    let times = resolved.scenario.events.iter().filter(|e| on(&e.set)).map(|e| e.at_s);
    times.fold(f64::INFINITY, f64::min)
}

/// The communication graphs, at the positions of the batteries where they are known.
fn graphs(resolved: &Resolved) -> Section {
    let config = &resolved.control;
    let n = config.agents();
    let topologies = Topologies::new(n, &config.communication);
    let mut items = Vec::new();
    for k in 0..topologies.count() {
        let topology = topologies.build(k, &vec![true; n]);
        let groups: Vec<usize> = topology.cluster.iter().map(|c| (*c - 1).max(0) as usize).collect();
        let leads: Vec<bool> = (0..n).map(|i| topology.leaders.contains(&i)).collect();
        let given: Option<Vec<(f64, f64)>> =
            resolved.scenario.bess.iter().map(|b| b.position.map(|[x, y]| (x, y))).collect();
        let places = given.unwrap_or_else(|| cluster_layout(&groups, &leads));
        let nodes = (0..n)
            .map(|i| Node {
                name: resolved.bess_name(i),
                x: places[i].0,
                y: places[i].1,
                group: groups[i],
                is_leader: leads[i],
            })
            .collect();
        let edges = topology.graph.edges().iter().map(|e| {
            let (a, b) = e.ends();
            Edge { a, b, weight: e.weight }
        });
        let pins = topology.graph.pins().iter().enumerate().filter(|(_, w)| **w > 0.0).map(|(i, _)| i);
        items.push(Item::Graph(GraphFigure {
            title: format!(
                "Topology {}: {}",
                k + 1,
                config.communication.topology_name(k).unwrap_or_default()
            ),
            nodes,
            edges: edges.collect(),
            pins: pins.collect(),
            note: "Shaded: clusters. Edges: who talks to whom, with weights.".into(),
        }));
    }
    Section { heading: "Communication".into(), text: String::new(), items }
}
