//! One federate in this process: what a machine of a distributed run does.

use super::super::{Failure, print, run::identity};
use super::vigil::Vigil;
use super::watch::Watch;
use super::{FederateArgs, failed};
use crate::federation::{Federation, Helics, Waiting};
use crate::harness::{
    Checkpoint, CheckpointError, FanOut, Keeping, Memory, Observer, Progress, Recorder, run_from,
};
use crate::scenario::Resolved;
use miette::IntoDiagnostic;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What a child prints before the time it has reached, s, and its share of the run.
pub const PROGRESS: &str = "at";

/// What a child prints at the end before the wall time from the first communication point to the last, s.
pub const TOOK: &str = "took";

/// What a child prints at the end before the name of each federate that is silent then.
pub const LOST: &str = "lost";

/// Runs it to the end of the scenario.
pub fn run(
    args: &FederateArgs,
    helics: &Arc<Helics>,
    (resolved, federation): (&Resolved, Federation),
    name: &str,
) -> Result<(), Failure> {
    let folder = args.folder(resolved);
    let address = args.address();
    let watch = if args.child { Watch::start(helics).into_diagnostic()? } else { Watch::default() };
    let failed_read = |error: CheckpointError| super::super::run::failed(&error.into());
    // Looked at before anybody is taken out of a federation for its sake.
    let found = if args.resume { Some(Checkpoint::open(&folder).map_err(failed_read)?) } else { None };
    if args.resume {
        federation.bury(helics, name, &address).map_err(failed)?;
    }
    let (names, waiting) = (federation.names(), Waiting::default());
    let joined = federation.join(helics, name, &address, (args.resume, &waiting));
    let (mut participants, plan) = joined.map_err(failed)?;
    Vigil { args: args.clone(), helics: Arc::clone(helics), own: name.to_owned(), names }
        .start(&waiting, &watch)
        .into_diagnostic()?;

    let identity = identity(resolved, &participants);
    // Nothing is shown here: the samples are for a checkpoint alone.
    let nothing = || Memory::new(1, |_| false);
    let mut kept: Box<dyn Observer> = if let Some(found) = &found {
        found.check(&folder, &identity).map_err(failed_read)?;
        Box::new(Keeping::resuming(&folder, found, 1, nothing()))
    } else if let Some(every_ns) = args.checkpoint {
        Box::new(Keeping::new(&folder, every_ns, identity, 1, nothing()))
    } else {
        Box::new(Recorder::new(&folder, 1))
    };
    let is_child = args.child;
    let mut span: Option<(Instant, Instant)> = None;
    let mut progress = Progress::new(Duration::from_millis(100), |t_s, share| {
        let now = Instant::now();
        span = Some((span.map_or(now, |(first, _)| first), now));
        if is_child {
            // Whoever started this one may be gone; the watch sees to that.
            let _ = print(&format!("{PROGRESS} {t_s} {share}\n"));
        }
    });
    let mut observers = FanOut(vec![kept.as_mut(), &mut progress]);
    let from = found.as_ref().map(|found| &found.position);
    let (outcome, result) = run_from(&mut participants, &plan, &mut observers, from);
    drop(participants);
    if let (true, Some((first, last))) = (is_child, span) {
        let _ = print(&format!("{TOOK} {}\n", (last - first).as_secs_f64()));
    }
    for warning in &outcome.warnings {
        eprintln!("warning: {warning}");
    }
    let (_, end_ns) = outcome.span_ns;
    let end_s = end_ns as f64 / 1e9;
    match (result, watch.reason()) {
        (Ok(()), _) => {
            Keeping::clear(&folder).into_diagnostic()?;
            let lost = waiting.silent();
            if args.child {
                lost.iter().try_for_each(|lost| print(&format!("{LOST} {lost}\n")))?;
            } else if !lost.is_empty() {
                let help = "from then on what it told last was held";
                let lost = lost.join(", ");
                let report = miette::miette!(
                    help = help,
                    "{lost} fell silent and did not come back; {name} went on to the end"
                );
                return Err(Failure { report, code: 3 });
            }
            if !args.child && !args.quiet {
                eprintln!("{name}: {end_s} s done; trajectory.csv in {}", folder.display());
            }
            Ok(())
        }
        (Err(_), Some(reason)) => Err(ended(name, end_s, &reason, &folder)),
        (Err(error), None) => {
            let failure = super::super::run::failed(&error);
            Err(if end_ns > 0 { ended(name, end_s, &failure.report.to_string(), &folder) } else { failure })
        }
    }
}

fn ended(name: &str, end_s: f64, reason: &str, folder: &std::path::Path) -> Failure {
    let help = format!("what was recorded lies in {}", folder.join(crate::harness::recorder::PART).display());
    Failure { report: miette::miette!(help = help, "{name} ended at t = {end_s} s: {reason}"), code: 1 }
}

/// Leaves in the name of a federate that has died.
pub fn bury(
    args: &FederateArgs,
    helics: &Arc<Helics>,
    federation: Federation,
    name: &str,
) -> Result<(), Failure> {
    let _watch = if args.child { Some(Watch::start(helics).into_diagnostic()?) } else { None };
    federation.bury(helics, name, &args.address()).map_err(failed)?;
    Ok(())
}
