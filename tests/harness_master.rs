#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
//! The master algorithm on participants whose answer is known in closed form.

mod harness_support;

use bess_consensus::harness::*;
use harness_support::{MS, Mock, S};
use std::cell::RefCell;
use std::rc::Rc;

/// y = number of steps taken.
fn counter(name: &str) -> Mock {
    Mock::new(name, |cells, _, _| cells[0] += 1.0).output("y", Kind::Real, 0.0)
}

/// y(t + h) = u.
fn follower(name: &str) -> Mock {
    Mock::new(name, |cells, _, _| cells[1] = cells[0]).input("u", Kind::Real, 0.0).output(
        "y",
        Kind::Real,
        -1.0,
    )
}

/// dy/dt = u, by explicit Euler, time counted exactly.
fn integrator(name: &str, input: &str, output: &str, start: f64) -> Mock {
    Mock::new(name, |cells, _, h| cells[1] += cells[0] * (h as f64 / 1e9))
        .input(input, Kind::Real, 0.0)
        .output(output, Kind::Real, start)
}

fn link(from: &str, to: &str) -> Connection {
    let end = |text: &str| {
        let (participant, variable) = text.split_once('.').unwrap();
        Endpoint::new(participant, variable)
    };
    Connection::new(end(from), end(to))
}

fn event(at_ns: i64, participant: &str, variable: &str, value: Value) -> Event {
    Event { at_ns, sets: vec![Setting::new(participant, variable, value)] }
}

fn all() -> Memory {
    Memory::new(1, |_| true)
}

#[test]
fn jacobi_lags_by_one_step_and_gauss_seidel_only_against_the_order() {
    for (algorithm, follower_first, lag) in [
        (Algorithm::Jacobi, false, 1.0),
        (Algorithm::Jacobi, true, 1.0),
        (Algorithm::GaussSeidel, false, 0.0),
        (Algorithm::GaussSeidel, true, 1.0),
    ] {
        let mut participants = vec![counter("a").boxed(), follower("b").boxed()];
        if follower_first {
            participants.reverse();
        }
        let connections = vec![link("a.y", "b.u")];
        let plan = Plan { stop_ns: S, step_ns: 100 * MS, algorithm, connections, ..Plan::default() };
        let mut memory = all();
        let outcome = run(&mut participants, &plan, &mut memory).unwrap();
        assert_eq!(outcome.steps, 10);
        let (a, b) = (memory.values("a", "y").unwrap(), memory.values("b", "y").unwrap());
        for k in 1..=10 {
            assert_eq!(a[k], k as f64);
            assert_eq!(b[k], k as f64 - lag, "{algorithm:?} {follower_first} {k}");
        }
    }
}

#[test]
fn coupled_oscillator_matches_explicit_and_symplectic_euler() {
    // x' = -y, y' = x. Jacobi is explicit Euler: (x + iy)_k = (1 + ih)^k. Gauss-Seidel is symplectic
    // Euler with x first, of which x^2 + y^2 - h x y is an invariant.
    let h: f64 = 0.01;
    let oscillator = || vec![integrator("x", "y", "x", 1.0).boxed(), integrator("y", "x", "y", 0.0).boxed()];
    for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel] {
        let mut participants = oscillator();
        let mut connections = connect_equal_names(&participants).unwrap();
        connections.iter_mut().filter(|c| c.to.participant == "x").for_each(|c| c.factor = -1.0);
        let plan = Plan { stop_ns: 20 * S, step_ns: 10 * MS, algorithm, connections, ..Plan::default() };
        let mut memory = all();
        run(&mut participants, &plan, &mut memory).unwrap();
        let (x, y) = (memory.values("x", "x").unwrap(), memory.values("y", "y").unwrap());
        assert_eq!(x.len(), 2001);
        for k in 0..=2000 {
            if algorithm == Algorithm::Jacobi {
                let (radius, angle) = ((1.0 + h * h).powf(k as f64 / 2.0), h.atan() * k as f64);
                assert!((x[k] - radius * angle.cos()).abs() < 1e-11, "{k}");
                assert!((y[k] - radius * angle.sin()).abs() < 1e-11, "{k}");
            } else {
                let invariant = x[k] * x[k] + y[k] * y[k] - h * x[k] * y[k];
                assert!((invariant - 1.0).abs() < 1e-12, "{k}");
            }
        }
    }
}

#[test]
fn a_million_steps_of_a_tenth_meet_every_event_on_the_nanosecond() {
    let seen = Rc::new(RefCell::new(Vec::new()));
    let (log, last) = (Rc::clone(&seen), Rc::new(RefCell::new((0.0, 0_i64))));
    let watcher = Mock::new("a", move |cells, t, h| {
        let mut last = last.borrow_mut();
        assert_eq!((t % (100 * MS), h, last.1), (0, 100 * MS, t));
        if cells[0] != last.0 {
            log.borrow_mut().push((t, cells[0]));
        }
        *last = (cells[0], t + h);
    });
    let mut participants = vec![watcher.input("u", Kind::Real, 0.0).boxed()];
    let events: Vec<Event> = [3, 20 * 10, 123_456, 800_001, 999_999]
        .into_iter()
        .map(|k: i64| event(k * 100 * MS, "a", "u", Value::Real(k as f64)))
        .collect();
    let expected: Vec<(i64, f64)> = events.iter().map(|e| (e.at_ns, (e.at_ns / (100 * MS)) as f64)).collect();
    let plan = Plan { stop_ns: 100_000 * S, step_ns: 100 * MS, events, ..Plan::default() };
    let outcome = run(&mut participants, &plan, &mut Silent).unwrap();
    assert_eq!((outcome.steps, outcome.events), (1_000_000, 5));
    assert_eq!(*seen.borrow(), expected);
}

#[test]
fn an_event_between_points_cuts_the_step_and_is_recorded() {
    for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel] {
        let mut participants = vec![integrator("a", "u", "y", 0.0).boxed()];
        let events = vec![
            event(750 * MS, "a", "u", Value::Integer(0)),
            event(250 * MS, "a", "u", Value::Real(2.0)),
            event(S, "a", "u", Value::Real(5.0)),
            event(7 * S, "a", "u", Value::Real(9.0)),
        ];
        let plan = Plan { stop_ns: S, step_ns: 100 * MS, events, algorithm, ..Plan::default() };
        let mut memory = all();
        let outcome = run(&mut participants, &plan, &mut memory).unwrap();
        assert_eq!((outcome.steps, outcome.events), (12, 3));
        let times: Vec<i64> = memory.times_ns().iter().map(|t| t / MS).collect();
        assert_eq!(times, [0, 100, 200, 250, 300, 400, 500, 600, 700, 750, 800, 900, 1000]);
        let y = memory.values("a", "y").unwrap();
        assert!((y[12] - 1.0).abs() < 1e-15, "{}", y[12]);
        assert!((y[6] - 0.5).abs() < 1e-15, "{}", y[6]);
        let u = memory.values("a", "u").unwrap();
        assert_eq!(u, [0., 0., 0., 2., 2., 2., 2., 2., 2., 0., 0., 0., 5.]);
    }
}

#[test]
fn factors_offsets_and_types() {
    let source = Mock::new("a", |cells, t, _| {
        cells[0] = t as f64 / 1e9;
        cells[1] = 7.0;
        cells[2] = 1.0 - cells[2];
    });
    let source = source.output("r", Kind::Real, 0.25).output("i", Kind::Integer, -2.0);
    let sink = Mock::new("b", |_, _, _| {}).feed(|cells| {
        let (inputs, outputs) = cells.split_at_mut(5);
        outputs.copy_from_slice(inputs);
    });
    let kinds = [Kind::Real, Kind::Integer, Kind::Boolean, Kind::Real, Kind::Real];
    let sink = (0..5).fold(sink, |sink, k| sink.input(&format!("u{k}"), kinds[k], 0.0));
    let sink = (0..5).fold(sink, |sink, k| sink.output(&format!("y{k}"), Kind::Real, 0.0));
    let mut participants = vec![source.output("b", Kind::Boolean, 0.0).boxed(), sink.boxed()];
    let scaled = |from, to, factor, offset| Connection { factor, offset, ..link(from, to) };
    let connections = vec![
        scaled("a.r", "b.u0", 1000.0, 2.0),
        scaled("a.r", "b.u1", 10.0, 0.0),
        scaled("a.r", "b.u2", 1.0, 0.0),
        scaled("a.i", "b.u3", -0.5, 0.0),
        scaled("a.b", "b.u4", 3.0, -1.0),
    ];
    let plan = Plan { stop_ns: 2 * S, step_ns: S, connections, ..Plan::default() };
    let mut memory = all();
    run(&mut participants, &plan, &mut memory).unwrap();
    let at = |variable: &str, k: usize| memory.values("b", variable).unwrap()[k];
    // The sink feeds through, so that at each point it shows what the source shows there.
    let row = |k| [at("y0", k), at("y1", k), at("y2", k), at("y3", k), at("y4", k)];
    assert_eq!(row(0), [252.0, 3.0, 0.0, 1.0, -1.0]);
    assert_eq!(row(1), [2.0, 0.0, 0.0, -3.5, 2.0]);
    assert_eq!(row(2), [1002.0, 10.0, 1.0, -3.5, -1.0]);
}

#[test]
fn initial_values_come_first_and_outputs_reach_every_input_before_the_start() {
    // p -> a.y -> b.u -> b.y -> c.u, each feeding through at once, given in the worst order.
    let chain = |name: &str| {
        Mock::new(name, |_, _, _| {}).feed(|cells| cells[1] = 2.0 * cells[0]).input("u", Kind::Real, 0.0)
    };
    let a = Mock::new("a", |_, _, _| {}).feed(|cells| cells[1] = cells[0]).parameter("p", Kind::Real, 0.0);
    let mut participants = vec![
        chain("c").output("y", Kind::Real, 0.0).boxed(),
        chain("b").output("y", Kind::Real, 0.0).boxed(),
        a.output("y", Kind::Real, 0.0).boxed(),
    ];
    let connections = vec![link("a.y", "b.u"), link("b.y", "c.u")];
    let initial = vec![Setting::new("a", "p", Value::Integer(3))];
    let plan = Plan { step_ns: S, connections, initial, ..Plan::default() };
    let mut memory = all();
    let outcome = run(&mut participants, &plan, &mut memory).unwrap();
    assert_eq!(memory.values("c", "y").unwrap(), [12.0]);
    assert!(outcome.is_settled && outcome.warnings.is_empty());
    assert_eq!((outcome.steps, outcome.initial_passes), (0, 3));
}

#[test]
fn an_endless_initial_loop_is_told() {
    let up = |name: &str, input: &str, output: &str| {
        Mock::new(name, |_, _, _| {})
            .feed(|cells| cells[1] = cells[0] + 1.0)
            .input(input, Kind::Real, 0.0)
            .output(output, Kind::Real, 0.0)
    };
    let mut participants = vec![up("a", "x", "y").boxed(), up("b", "y", "x").boxed()];
    let connections = connect_equal_names(&participants).unwrap();
    let plan = Plan { step_ns: S, connections, ..Plan::default() };
    let outcome = run(&mut participants, &plan, &mut Silent).unwrap();
    assert!(!outcome.is_settled);
    assert!(outcome.warnings[0].contains("still change after"), "{:?}", outcome.warnings);
}

#[test]
fn the_order_of_calls() {
    let calls = Rc::new(RefCell::new(Vec::new()));
    let mut participants = vec![
        integrator("a", "x", "y", 1.0).log_to(&calls).boxed(),
        integrator("b", "y", "x", 0.5).log_to(&calls).boxed(),
    ];
    let connections = connect_equal_names(&participants).unwrap();
    let both = |what: &[&str]| -> Vec<String> {
        what.iter().flat_map(|call| [format!("a {call}"), format!("b {call}")]).collect()
    };
    // The first exchange sets, the second finds that nothing has changed. Later, too, only what has
    // changed is set.
    let initialised = both(&["setup", "enter", "get", "set", "get", "exit"]);
    for (algorithm, stepped) in [
        (
            Algorithm::Jacobi,
            [
                both(&["get", "get", "step"]),
                ["a get", "b set", "b get", "a set"].map(String::from).to_vec(),
                both(&["get", "terminate"]),
            ]
            .concat(),
        ),
        (
            Algorithm::GaussSeidel,
            [
                both(&["get"]),
                ["a step", "a get", "b set", "b step", "b get"].map(String::from).to_vec(),
                both(&["terminate"]),
            ]
            .concat(),
        ),
    ] {
        calls.borrow_mut().clear();
        let plan =
            Plan { stop_ns: S, step_ns: S, algorithm, connections: connections.clone(), ..Plan::default() };
        run(&mut participants, &plan, &mut Silent).unwrap();
        assert_eq!(*calls.borrow(), [initialised.clone(), stepped].concat(), "{algorithm:?}");
    }
}

/// Remembers how it ended.
#[derive(Default)]
struct Ending {
    samples: usize,
    error: Option<String>,
    finished: usize,
}

impl Observer for Ending {
    fn begin(&mut self, _: &Experiment) -> Result<(), ObserverError> {
        Ok(())
    }
    fn sample(&mut self, _: Sample<'_>) -> Result<(), ObserverError> {
        self.samples += 1;
        Ok(())
    }
    fn finish(&mut self, error: Option<&HarnessError>) -> Result<(), ObserverError> {
        self.finished += 1;
        self.error = error.map(ToString::to_string);
        Ok(())
    }
}

#[test]
fn a_failing_step_names_participant_function_and_time_and_observers_finish() {
    let calls = Rc::new(RefCell::new(Vec::new()));
    let bad =
        Mock::failing("grid", |_, t, _| if t < 300 * MS { Ok(()) } else { Err("no power flow".into()) });
    let mut participants = vec![counter("controller").log_to(&calls).boxed(), bad.log_to(&calls).boxed()];
    let plan = Plan { stop_ns: S, step_ns: 100 * MS, ..Plan::default() };
    let (mut one, mut two) = (Ending::default(), Ending::default());
    let mut reports = Vec::new();
    let mut progress = Progress::new(std::time::Duration::ZERO, |t_s, share| reports.push((t_s, share)));
    let error = run(&mut participants, &plan, &mut FanOut(vec![&mut one, &mut progress, &mut two]))
        .unwrap_err()
        .to_string();
    assert_eq!(error, "grid at t = 0.3 s: fmi2DoStep: no power flow");
    for ending in [one, two] {
        assert_eq!((ending.samples, ending.finished, ending.error.as_deref()), (4, 1, Some(error.as_str())));
    }
    assert_eq!(reports, [(0.0, 0.0), (0.1, 0.1), (0.2, 0.2), (0.3, 0.3)]);
    assert!(calls.borrow().ends_with(&["controller terminate".into(), "grid terminate".into()]));
}

#[test]
fn a_value_that_does_not_fit_its_target_is_named() {
    let source = Mock::new("a", |cells, _, _| cells[0] *= 1e9).output("y", Kind::Real, 3.0);
    let sink = Mock::new("b", |_, _, _| {}).input("u", Kind::Integer, 0.0);
    let mut participants = vec![source.boxed(), sink.boxed()];
    let plan = Plan { stop_ns: S, step_ns: S, connections: vec![link("a.y", "b.u")], ..Plan::default() };
    let error = run(&mut participants, &plan, &mut Silent).unwrap_err().to_string();
    assert!(error.starts_with("a.y = 3000000000.0 at t = 1.0 s cannot become the Integer b.u"), "{error}");
}

#[test]
fn plans_that_do_not_fit_are_refused_with_place_and_remedy() {
    let check = |change: &dyn Fn(&mut Plan), expected: &[&str]| {
        let mut fixed =
            counter("controller").input("omega[1]", Kind::Real, 1.0).parameter("K", Kind::Real, 1.0);
        fixed.varies_step = false;
        let fixed = fixed.output("name", Kind::String, 0.0);
        let mut participants =
            vec![fixed.boxed(), follower("grid").output("omega[1]", Kind::Real, 1.0).boxed()];
        let mut plan = Plan { stop_ns: S, step_ns: 100 * MS, ..Plan::default() };
        change(&mut plan);
        let mut ending = Ending::default();
        let error = run(&mut participants, &plan, &mut ending).unwrap_err().to_string();
        assert_eq!(ending.finished, 0);
        for part in expected {
            assert!(error.contains(part), "{part:?} not in {error:?}");
        }
    };
    let connect =
        |from: &'static str, to: &'static str| move |plan: &mut Plan| plan.connections.push(link(from, to));
    check(&connect("gird.y", "grid.u"), &["connection 1", "no participant \"gird\"", "did you mean grid?"]);
    check(
        &connect("grid.Omega[1]", "grid.u"),
        &["grid has no variable \"Omega[1]\"; did you mean omega[1]?"],
    );
    check(&connect("grid.u", "controller.omega[1]"), &["grid.u is input Real; expected an output"]);
    check(&connect("grid.y", "controller.K"), &["controller.K is parameter Real; expected an input"]);
    check(&connect("controller.name", "grid.u"), &["controller.name is output String"]);
    check(
        &|plan| plan.connections = vec![link("grid.y", "grid.u"), link("controller.y", "grid.u")],
        &["connection 2 (controller.y to grid.u): grid.u already has the source grid.y"],
    );
    check(
        &|plan| {
            plan.connections = vec![link("controller.y", "grid.u")];
            plan.events = vec![event(0, "grid", "u", Value::Real(1.0))];
        },
        &["grid.u already has the source an event"],
    );
    check(
        &|plan| plan.connections = vec![Connection { factor: f64::NAN, ..link("controller.y", "grid.u") }],
        &["factor NaN"],
    );
    check(
        &|plan| plan.events = vec![event(500 * MS, "controller", "K", Value::Real(1.0))],
        &["event at 0.5 s: controller.K is fixed parameter; expected an input or a tunable parameter"],
    );
    check(
        &|plan| plan.initial = vec![Setting::new("grid", "v", Value::Real(1.0))],
        &["initial value: grid has no"],
    );
    check(&|plan| plan.events = vec![event(-1, "grid", "u", Value::Real(1.0))], &["event: -1e-9 s"]);
    check(
        &|plan| plan.events = vec![event(150 * MS, "grid", "u", Value::Real(1.0))],
        &["controller cannot vary its step", "an event at 0.15 s"],
    );
    check(&|plan| plan.stop_ns = 950 * MS, &["the end of the run at 0.95 s cuts one"]);
    check(&|plan| plan.step_ns = 0, &["communication step: 0.0 s; expected a positive time"]);
    check(&|plan| plan.stop_ns = -1, &["end of the run: -1e-9 s"]);
}

#[test]
fn equal_names_connect_except_where_a_table_or_ambiguity_says_otherwise() {
    let node = |name: &str| follower(name).input("x", Kind::Real, 0.0).output("u", Kind::Real, 0.0);
    let participants = vec![node("a").boxed(), counter("b").output("x", Kind::Real, 0.0).boxed()];
    let found = connect_equal_names(&participants).unwrap();
    assert_eq!(found, [link("b.x", "a.x")], "a.u must not feed itself");
    let table = [link("b.y", "a.x")];
    assert_eq!(connect(&participants, &table).unwrap(), table);

    let participants = vec![node("a").boxed(), node("b").boxed(), node("c").boxed()];
    let error = connect_equal_names(&participants).unwrap_err().to_string();
    assert!(error.contains("a.u could be fed by the output of that name of b, c"), "{error}");
}

#[test]
fn names_of_participants_are_unique() {
    let mut participants = vec![counter("a").boxed(), counter("a").boxed()];
    let plan = Plan { step_ns: S, ..Plan::default() };
    let error = run(&mut participants, &plan, &mut Silent).unwrap_err().to_string();
    assert!(error.contains("two participants are called \"a\""), "{error}");
}
