//! A run that ended too early: who, in which call, when and how, for the terminal, for `summary.json` and for the report.

use crate::harness::{HarnessError, Trouble};
use crate::report::{Item, Report, Section, Status, Table};
use crate::scenario::Resolved;
use serde::Serialize;

/// What ended a run.
#[derive(Clone, Debug, Serialize)]
pub struct Ended {
    /// The variant, if it was not the scenario itself.
    pub variant: Option<String>,
    /// The participant that failed, if one did.
    pub participant: Option<String>,
    /// The call that it failed in.
    pub call: Option<&'static str>,
    /// Communication point, s; none before the first.
    pub time_s: Option<f64>,
    /// `refused`, `died` or `hung`; `other` where no participant failed.
    pub how: &'static str,
    /// In words.
    pub reason: String,
    /// The last lines of its log and of what it printed, oldest first.
    pub log: Vec<String>,
}

impl Ended {
    /// Takes an error apart.
    pub fn of(error: &HarnessError, variant: Option<&str>) -> Self {
        let (participant, time_s, source) = match error {
            HarnessError::Run { participant, time_s, source } => {
                (Some(participant), Some(*time_s), Some(source))
            }
            HarnessError::Call { participant, source } => (Some(participant), None, Some(source)),
            HarnessError::Conversion { time_s, .. } => (None, Some(*time_s), None),
            _ => (None, None, None),
        };
        let how = source.map_or("other", |source| match source.trouble {
            Trouble::Refused => "refused",
            Trouble::Died => "died",
            Trouble::Hung => "hung",
        });
        Self {
            variant: variant.map(str::to_owned),
            participant: participant.cloned(),
            call: source.map(|source| source.function),
            time_s,
            how,
            reason: source.map_or_else(|| error.to_string(), |source| source.reason.clone()),
            log: source.map(|source| source.log.clone()).unwrap_or_default(),
        }
    }

    /// What no participant's call can be blamed for.
    pub fn other(reason: &str, time_s: Option<f64>) -> Self {
        let (variant, participant, call, log) = (None, None, None, Vec::new());
        Self { variant, participant, call, time_s, how: "other", reason: reason.to_owned(), log }
    }

    /// One line for the head of the report.
    pub fn status(&self) -> Status {
        let who = self.participant.as_deref().unwrap_or("the run");
        let call = self.call.map_or_else(String::new, |call| format!(" in {call}"));
        let when =
            self.time_s.map_or_else(|| " before its first step".to_owned(), |t| format!(" at t = {t:?} s"));
        let how = match self.how {
            "died" => "crashed",
            "hung" => "hung",
            "refused" => "failed",
            _ => "was stopped",
        };
        Status { good: false, text: format!("Ended early: {who} {how}{call}{when}") }
    }

    /// The section that tells it.
    pub fn section(&self) -> Section {
        let dash = || "\u{2013}".to_owned();
        let row = vec![
            self.participant.clone().unwrap_or_else(dash),
            self.call.map_or_else(dash, str::to_owned),
            self.time_s.map_or_else(dash, |t| format!("{t:?}")),
            self.reason.clone(),
        ];
        let header = ["participant", "call", "communication point (s)", "what happened"];
        let mut items = vec![table("What the run ended with.", &header, vec![row])];
        if !self.log.is_empty() {
            let lines = self.log.iter().map(|line| vec![line.clone()]).collect();
            items.push(table("Its last log lines and what it printed last, oldest first.", &["line"], lines));
        }
        let of = self
            .variant
            .as_ref()
            .map_or_else(String::new, |label| format!(" of the variant \u{201c}{label}\u{201d}"));
        let text = format!(
            "The run{of} did not reach its end. What follows was computed from what was recorded until then; \
             trajectory.csv.part holds it, in whole lines but perhaps the last. A trajectory.csv beside it is whole, \
             and an earlier run's unless it was a variant that failed."
        );
        Section { heading: "What ended the run".into(), text, items }
    }

    /// The whole report where nothing was recorded.
    pub fn report(&self, resolved: &Resolved) -> Report {
        Report {
            title: resolved.scenario.name.clone(),
            subtitle: resolved.scenario.description.clone(),
            status: Some(self.status()),
            sections: vec![self.section()],
        }
    }
}

fn table(caption: &str, header: &[&str], rows: Vec<Vec<String>>) -> Item {
    Item::Table(Table {
        caption: caption.to_owned(),
        header: header.iter().map(|cell| (*cell).to_owned()).collect(),
        rows,
    })
}
