#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
//! A model of ours under the master without C, beside a mock: dx/dt = u.

mod harness_support;

use bess_consensus::fmi::{
    self, Access, Dependencies, Group, Instance, Log, Model, ModelError, Phase, Range, Row, Step, Unit,
};
use bess_consensus::harness::*;
use harness_support::{MS, Mock, S};
use std::path::Path;

#[derive(Clone)]
struct Integrator {
    state: State,
}

#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
struct State {
    u: [f64; 2],
    x: [f64; 2],
    start: f64,
    steps: i32,
    hold: bool,
}

fn group(
    name: &'static str,
    count: Option<usize>,
    causality: fmi::Causality,
    access: Access<Integrator>,
) -> Group<Integrator> {
    let variability = match (&access, causality) {
        (_, fmi::Causality::Parameter) => fmi::Variability::Fixed,
        (Access::Real(..), _) => fmi::Variability::Continuous,
        _ => fmi::Variability::Discrete,
    };
    Group {
        name,
        description: name,
        unit: matches!(access, Access::Real(..)).then_some(Unit::PerUnit),
        count,
        size: None,
        causality,
        variability,
        access,
        range: Range::ANY,
        dependencies: Dependencies::None,
        row: Row::NONE,
    }
}

impl Model for Integrator {
    const IDENTIFIER: &'static str = "Integrator";
    const DESCRIPTION: &'static str = "Two integrators";
    type State = State;

    fn load(_: &Path) -> Result<Self, ModelError> {
        Ok(Self { state: State::default() })
    }

    fn variables(&self) -> Vec<Group<Self>> {
        use fmi::Causality::{Input, Output, Parameter};
        vec![
            group("u", Some(2), Input, Access::Real(|m, i| m.state.u[i], Some(|m, i, v| m.state.u[i] = v))),
            group(
                "hold",
                None,
                Input,
                Access::Boolean(|m, _| m.state.hold, Some(|m, _, v| m.state.hold = v)),
            ),
            group("x", Some(2), Output, Access::Real(|m, i| m.state.x[i], None)),
            group("steps", None, Output, Access::Integer(|m, _| m.state.steps, None)),
            group(
                "x_start",
                None,
                Parameter,
                Access::Real(|m, _| m.state.start, Some(|m, _, v| m.state.start = v)),
            ),
        ]
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn set_state(&mut self, state: &State) -> Result<(), ModelError> {
        self.state = state.clone();
        Ok(())
    }

    fn refresh(&mut self, phase: Phase, _: &mut dyn Log) -> Result<(), ModelError> {
        if phase == Phase::Initialization {
            self.state.x = [self.state.start; 2];
        }
        Ok(())
    }

    fn step(&mut self, step: Step, _: &mut dyn Log) -> Result<(), ModelError> {
        if self.state.u[1] == 13.0 {
            return Err(ModelError::new("u[2] = 13 brings bad luck"));
        }
        for (x, u) in self.state.x.iter_mut().zip(self.state.u) {
            *x += if self.state.hold { 0.0 } else { u * step.duration_s() };
        }
        self.state.steps += 1;
        Ok(())
    }
}

fn model(name: &str) -> InProcess<Integrator> {
    InProcess::load(name, Path::new("unused")).unwrap()
}

#[test]
fn a_model_runs_under_the_master_with_all_types() {
    let ramp =
        Mock::new("ramp", |cells, t, h| cells[0] = (t + h) as f64 / 1e9).output("u[2]", Kind::Real, 0.0);
    let mut participants: Vec<Box<dyn Participant>> = vec![Box::new(model("model")), ramp.boxed()];
    let connections = connect_equal_names(&participants).unwrap();
    let initial = vec![
        Setting::new("model", "x_start", Value::Real(3.0)),
        Setting::new("model", "u[1]", Value::Real(-2.0)),
    ];
    let events =
        vec![Event { at_ns: 1005 * MS, sets: vec![Setting::new("model", "hold", Value::Boolean(true))] }];
    let plan = Plan { stop_ns: 2 * S, step_ns: 10 * MS, connections, initial, events, ..Plan::default() };
    let mut memory = Memory::new(1, |_| true);
    let outcome = run(&mut participants, &plan, &mut memory).unwrap();
    assert!(outcome.is_settled);
    let last = |variable: &str| *memory.values("model", variable).unwrap().last().unwrap();
    // x[1] = 3 - 2 * 1.005; x[2] = 3 + sum of rectangles h (k h) up to k = 99, then half a step of k = 100.
    assert!((last("x[1]") - (3.0 - 2.01)).abs() < 1e-13);
    assert!((last("x[2]") - (3.0 + 0.0001 * 4950.0 + 0.005)).abs() < 1e-13, "{}", last("x[2]"));
    assert_eq!((last("steps"), last("hold")), (201.0, 1.0));
    assert_eq!(memory.values("model", "x[1]").unwrap()[0], 3.0);
    let units: Vec<Option<&str>> = memory.columns().iter().map(|column| column.unit.as_deref()).collect();
    assert_eq!(units, [Some("pu"), Some("pu"), None, None, None]);
}

#[test]
fn refusals_are_told_once_with_function_and_reason() {
    let mut model = model("model");
    let error = model.set_real(&[1], &[f64::NAN]).unwrap_err();
    assert_eq!(error.function, "fmi2SetReal");
    assert!(error.reason.starts_with("u[1] = NaN is refused"), "{error}");
    let mut participants: Vec<Box<dyn Participant>> = vec![Box::new(model)];
    let events =
        vec![Event { at_ns: 50 * MS, sets: vec![Setting::new("model", "u[2]", Value::Integer(13))] }];
    let plan = Plan { stop_ns: S, step_ns: 100 * MS, events, ..Plan::default() };
    let error = run(&mut participants, &plan, &mut Silent).unwrap_err().to_string();
    assert_eq!(error, "model at t = 0.05 s: fmi2DoStep: u[2] = 13 brings bad luck");
}

#[test]
fn states_roll_back_and_travel() {
    let mut one = model("one");
    one.setup(0, None).unwrap();
    one.enter_initialization().unwrap();
    one.exit_initialization().unwrap();
    one.set_real(&[1], &[1.0]).unwrap();
    one.do_step(0, S).unwrap();
    let state = one.save_state().unwrap();
    one.do_step(S, S).unwrap();
    let bytes = one.serialise_state(state).unwrap();
    let mut two = model("two");
    let foreign = two.deserialise_state(&bytes).unwrap();
    for (participant, state) in [(&mut one, state), (&mut two, foreign)] {
        participant.restore_state(state).unwrap();
        participant.do_step(S, S / 2).unwrap();
        let mut x = [0.0];
        participant.get_real(&[4], &mut x).unwrap();
        assert_eq!(x, [1.5]);
        participant.forget_state(state);
        assert!(participant.restore_state(state).is_err());
    }
}

#[test]
fn wrapping_keeps_the_instance_reachable() {
    let wrapped = InProcess::new("a", Instance::<Integrator>::new("b", Path::new("unused")).unwrap());
    assert_eq!((wrapped.name(), wrapped.instance().name(), wrapped.variables().len()), ("a", "b", 7));
}
