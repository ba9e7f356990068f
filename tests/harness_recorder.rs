#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
//! The trajectory on disk: content, completeness, names, what remains after an error.

mod harness_support;

use bess_consensus::harness::recorder::{PART, WHOLE};
use bess_consensus::harness::*;
use harness_support::{MS, Mock, S};
use std::path::Path;

/// A participant whose outputs are known: r = 0.1 k, i = -k, b = k odd, after k steps.
fn source(fail_at_ns: i64) -> Box<dyn Participant> {
    let mut k = 0;
    let step = move |cells: &mut [f64], t: i64, _: i64| {
        k += 1;
        cells[..3].copy_from_slice(&[0.1 * k as f64, -k as f64, (k % 2) as f64]);
        if t >= fail_at_ns { Err("enough".into()) } else { Ok(()) }
    };
    Mock::failing("a", step)
        .output("r[1]", Kind::Real, 0.0)
        .output("i", Kind::Integer, 0.0)
        .output("b", Kind::Boolean, 0.0)
        .input("u", Kind::Boolean, 0.0)
        .boxed()
}

fn plan(stop_ns: i64) -> Plan {
    let sets = vec![Setting::new("a", "u", Value::Boolean(true))];
    Plan { stop_ns, step_ns: 100 * MS, events: vec![Event { at_ns: 250 * MS, sets }], ..Plan::default() }
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn the_file_holds_what_was_read() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("new/folder");
    let mut recorder = Recorder::new(&target, 1);
    run(&mut [source(i64::MAX)], &plan(400 * MS), &mut recorder).unwrap();
    assert_eq!(recorder.written(), Some(target.join(WHOLE).as_path()));
    assert_eq!(files(&target), [WHOLE]);
    let expected = "time,a.r[1],a.i,a.b,a.u\n\
                    0.0,0.0,0,0,0\n0.1,0.1,-1,1,0\n0.2,0.2,-2,0,0\n\
                    0.25,0.30000000000000004,-3,1,1\n0.3,0.4,-4,0,1\n0.4,0.5,-5,1,1\n";
    assert_eq!(std::fs::read_to_string(target.join(WHOLE)).unwrap(), expected);
}

#[test]
fn every_third_point_the_events_and_the_last_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    run(&mut [source(i64::MAX)], &plan(S), &mut Recorder::new(folder.path(), 3)).unwrap();
    let text = std::fs::read_to_string(folder.path().join(WHOLE)).unwrap();
    let times: Vec<&str> = text.lines().skip(1).map(|line| line.split(',').next().unwrap()).collect();
    assert_eq!(times, ["0.0", "0.25", "0.3", "0.6", "0.9", "1.0"]);
}

#[test]
fn after_an_error_what_there_is_is_kept_as_partial_until_a_run_succeeds() {
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = Recorder::new(folder.path(), 1);
    run(&mut [source(200 * MS)], &plan(S), &mut recorder).unwrap_err();
    assert_eq!(recorder.written(), Some(folder.path().join(PART).as_path()));
    assert_eq!(files(folder.path()), [PART]);
    let text = std::fs::read_to_string(folder.path().join(PART)).unwrap();
    assert_eq!(text.lines().last().unwrap(), "0.2,0.2,-2,0,0");

    run(&mut [source(i64::MAX)], &plan(S), &mut recorder).unwrap();
    assert_eq!(recorder.written(), Some(folder.path().join(WHOLE).as_path()));
    assert_eq!(files(folder.path()), [WHOLE]);
}

#[cfg(unix)]
#[test]
fn others_may_read_the_file_as_far_as_the_umask_lets_them() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    run(&mut [source(i64::MAX)], &plan(S), &mut Recorder::new(folder.path(), 1)).unwrap();
    std::fs::write(folder.path().join("plain"), b"").unwrap();
    let mode = |name: &str| std::fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
    assert_eq!(mode(WHOLE), mode("plain"));
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, b"").unwrap();
    let error = run(&mut [source(i64::MAX)], &plan(S), &mut Recorder::new(file.join("x"), 1)).unwrap_err();
    assert!(error.to_string().contains(&format!("recording into {}", file.join("x").display())), "{error}");
}

/// 300 columns, 2,000 rows: many blocks go round. Every number must come back, in its place.
#[test]
fn many_blocks_arrive_whole_and_in_order() {
    let value = |k: usize, column: usize| ((k * 300 + column) as f64).sin();
    let mut k = 0;
    let wide = Mock::new("w", move |cells, _, _| {
        k += 1;
        for (column, cell) in cells.iter_mut().enumerate() {
            *cell = value(k, column);
        }
    });
    let wide = (0..300)
        .fold(wide, |mock, column| mock.output(&format!("y[{}]", column + 1), Kind::Real, value(0, column)));
    let folder = tempfile::tempdir().unwrap();
    let plan = Plan { stop_ns: 1999 * S, step_ns: S, ..Plan::default() };
    let mut memory = Memory::new(1, |column| column.variable == "y[17]");
    let mut recorder = Recorder::new(folder.path(), 1);
    run(&mut [wide.boxed()], &plan, &mut FanOut(vec![&mut recorder, &mut memory])).unwrap();
    let text = std::fs::read_to_string(folder.path().join(WHOLE)).unwrap();
    let mut rows = 0;
    for (k, line) in text.lines().skip(1).enumerate() {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        assert_eq!((numbers.len(), numbers[0]), (301, k as f64));
        assert!((0..300).all(|column| numbers[1 + column] == value(k, column)), "row {k}");
        rows += 1;
    }
    assert_eq!(rows, 2000);
    let kept = memory.values("w", "y[17]").unwrap();
    assert!((0..2000).all(|k| kept[k] == value(k, 16)));
    assert_eq!(memory.columns().len(), 1);
}
