#![cfg(feature = "host")]
//! Case 1 on the AC network: how far frequency and sharing are off before each next event.
#![allow(non_snake_case, clippy::unwrap_used)]

mod case_support;

use case_support::{Run, scenario};

/// abs(omega - 1) and the spread of K_P (P - P_set), worst of the last 5 s before each next event.
fn residuals(run: &Run) -> (f64, f64) {
    let p = run.p();
    [50.0, 80.0, 120.0].iter().fold((0.0, 0.0), |(omega, sharing): (f64, f64), &end| {
        (omega.max(run.omega_error(end - 5.0, end)), sharing.max(run.spread(&p, end - 5.0, end)))
    })
}

#[test]
fn without_exchange_frequency_and_sharing_are_exact_to_1e_9_at_10_ms() {
    let (omega, sharing) = residuals(&scenario("case1", &[("control.gains.E", "0")]));
    println!("10 ms, no exchange: omega {omega:.1e}, sharing {sharing:.1e}");
    assert!(omega < 1e-9 && sharing < 1e-9, "{omega:e} {sharing:e}");
}

#[test]
fn without_exchange_frequency_and_sharing_are_within_1e_5_at_100_ms() {
    let (omega, sharing) = residuals(&scenario("case1", &[("control.gains.E", "0"), ("step_s", "0.1")]));
    println!("100 ms, no exchange: omega {omega:.1e}, sharing {sharing:.1e}");
    assert!(omega < 1e-5 && sharing < 1e-5, "{omega:e} {sharing:e}");
}

#[test]
fn with_exchange_all_three_are_met_at_once_at_10_ms() {
    let run = scenario("case1", &[]);
    let (omega, sharing) = residuals(&run);
    let (sum, soc) = (run.worst_sum_of_P_set(), run.spread(&run.soc(), 119.9, 120.1));
    println!("10 ms, exchange: omega {omega:.1e}, sharing {sharing:.1e}, sum {sum:.1e}, SoC {soc:.1e}");
    assert!(omega < 1e-5 && sharing < 1e-5, "{omega:e} {sharing:e}");
    assert!(sum < 1e-9, "sum of P_set {sum:e}");
    assert!(soc < 2e-4, "SoC spread {soc:e}");
}

#[test]
fn the_explicit_law_chatters_where_the_capped_one_is_at_rest() {
    let explicit = [("control.gains.E", "0"), ("control.discretisation", "\"explicit\"")];
    let (omega, _) = residuals(&scenario("case1", &explicit));
    println!("10 ms, explicit law: omega {omega:.1e}");
    assert!(omega > 1e-5, "{omega:e}: then the cap would be needless");
}
