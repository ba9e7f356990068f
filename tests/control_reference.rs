//! The controller on the agent model against trajectories and certificates of an independent solver.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use control_support::{Loop, Reference, spread};

const FILES: [&str; 2] = ["agents_eta05.json", "agents_eta03.json"];

/// Error of every agent at every sample up to `until`, by quantity.
fn errors(reference: &Reference, h_ns: i64, until: f64) -> [Vec<f64>; 5] {
    let mut coupled = Loop::new(reference.config(), &reference.start);
    let mut errors: [Vec<f64>; 5] = Default::default();
    for sample in reference.samples.iter().filter(|s| s.t > 0.0 && s.t <= until) {
        let t_ns = (sample.t * 1e9).round() as i64;
        while coupled.now_ns < t_ns {
            coupled.step(h_ns);
        }
        assert_eq!(coupled.now_ns, t_ns, "the step divides the sampling interval");
        for (q, (x, y)) in coupled.plant.quantities().into_iter().zip(sample.quantities()).enumerate() {
            errors[q].extend(x.iter().zip(y).map(|(x, y)| (x - y).abs()));
        }
    }
    errors
}

/// The median of how much smaller the errors get from one step size to the next.
fn median_ratio(coarse: &[f64], fine: &[f64]) -> f64 {
    let mut ratios: Vec<f64> = coarse.iter().zip(fine).map(|(c, f)| c / f).collect();
    ratios.sort_by(f64::total_cmp);
    ratios[ratios.len() / 2]
}

fn largest(x: &[f64]) -> f64 {
    x.iter().copied().fold(0.0, f64::max)
}

/// Agents that have met stay together, and what error they had before is gone: their sum is exact. What
/// is left is of the boundary layer, h^(1/(1-eta)), a higher order. So the order is at least one
/// everywhere (ratio 2 or more), and one (ratio 2) in quantities that are still spread out.
#[test]
fn the_trajectories_converge_to_the_reference_with_the_first_order() {
    for file in FILES {
        let reference = Reference::read(file);
        let end = reference.samples.iter().find(|s| s.t >= 0.3).unwrap();
        let [coarse, middle, fine] = [1_250_000, 625_000, 312_500].map(|h| errors(&reference, h, 0.3));
        for q in 0..5 {
            let ratios = [median_ratio(&coarse[q], &middle[q]), median_ratio(&middle[q], &fine[q])];
            println!(
                "{file}, quantity {q}: largest error {:.1e}, {:.1e}, {:.1e} at 1.25, 0.625, 0.3125 ms; ratios {ratios:.2?}",
                largest(&coarse[q]),
                largest(&middle[q]),
                largest(&fine[q])
            );
            let left = spread(end.quantities()[q]) / spread(reference.start.quantities()[q]);
            println!("  of its spread {left:.2} is left at the end of the transient");
            let most = if left > 0.3 { 2.1 } else { f64::INFINITY };
            assert!(
                ratios.iter().all(|ratio| (1.9..most).contains(ratio)),
                "{file}, quantity {q}: {ratios:?}"
            );
        }
        // The whole trajectory, consensus included.
        let whole = errors(&reference, 1_250_000, f64::INFINITY).map(|e| largest(&e));
        println!("{file}: whole trajectory, h = 1.25 ms: {whole:?}");
        assert!(whole.iter().all(|&e| e < 5e-4), "{file}: {whole:?}");
    }
}

#[test]
fn eigenvalues_and_certified_times_are_those_of_the_reference() {
    for file in FILES {
        let reference = Reference::read(file);
        let coupled = Loop::new(reference.config(), &reference.start);
        let spectrum = coupled.controller.spectrum();
        let outputs = coupled.controller.outputs();
        let norm = |x: &[f64], about: f64| x.iter().map(|x| (x - about).powi(2)).sum::<f64>().sqrt();
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let start = &reference.start;
        let T_Q = spectrum.P.settling_time(norm(&start.Q, mean(&start.Q)), reference.eta);
        let T_V = spectrum.omega.settling_time(norm(&start.V, 1.0), reference.eta);
        for (name, found, expected) in [
            ("lambda_2", outputs.lambda_2, reference.lambda2),
            ("lambda_omega", spectrum.omega.lambda.value, reference.lambda_omega),
            ("T_P", outputs.T_P, reference.T_P),
            ("T_omega", outputs.T_omega, reference.T_omega),
            ("T_Q", T_Q, reference.T_Q),
            ("T_V", T_V, reference.T_V),
        ] {
            assert!((found - expected).abs() <= 1e-9 * expected, "{file} {name}: {found} {expected}");
        }
    }
}

#[test]
fn consensus_is_reached_before_the_certified_times_and_sums_are_kept() {
    for file in FILES {
        let reference = Reference::read(file);
        let mut coupled = Loop::new(reference.config(), &reference.start);
        let sum = |x: &[f64]| x.iter().sum::<f64>();
        let (P, Q, E) = (sum(&reference.start.P), sum(&reference.start.Q), sum(&reference.start.E));
        let h_ns = 1_000_000;
        let times = [reference.T_P, reference.T_Q, reference.T_omega, reference.T_V];
        let mut reached = [f64::INFINITY; 4];
        while (coupled.now_ns as f64) < 1e9 * times.iter().copied().fold(0.0, f64::max) {
            coupled.step(h_ns);
            let plant = &coupled.plant;
            let t = coupled.now_ns as f64 * 1e-9;
            assert!((sum(&plant.P) - P).abs() < 1e-12, "{file} at {t}: sum of P");
            assert!((sum(&plant.Q) - Q).abs() < 1e-12, "{file} at {t}: sum of Q");
            assert!((sum(&plant.E) + P / 3600.0 * t - E).abs() < 1e-12, "{file} at {t}: sum of E");
            assert!(
                sum(&coupled.controller.outputs().P_set).abs() < 1e-9,
                "{file} at {t}: sum of P_set (~2000 pu)"
            );
            let off = |x: &[f64]| x.iter().fold(0.0_f64, |e, x| e.max((x - 1.0).abs()));
            let now = [spread(&plant.P), spread(&plant.Q), off(&plant.omega), off(&plant.V)];
            for k in 0..4 {
                // The capped law ends its last stretch, of the size h^(1/(1-eta)), exponentially.
                reached[k] = if now[k] < 1e-4 { reached[k].min(t) } else { f64::INFINITY };
            }
        }
        println!("{file}: P, Q, omega, V within 1e-4 at {reached:?}, certified {times:?}");
        for k in 0..4 {
            assert!(reached[k] < times[k], "{file}: {reached:?} {times:?}");
        }
    }
}
