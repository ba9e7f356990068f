//! Consensus past a BESS at its limit. An agent that cannot take its share of a power must not keep its
//! neighbours from sharing: where it is the only way between two parts of the graph, they would part.
//!
//! So an agent tells y_i = p_i + x_i, its power and what it owes: the power it would have without its limit.
//! y_i follows the law (9) whole; of its rate the agent does what it has room for, and owes the rest. As soon
//! as there is room, it pays. x_i stays 0 where no limit binds; (10) alike. Knows one agent at a time.

use super::scalar::Scalar;

/// What an agent does of a rate, and what it owes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split<S = f64> {
    /// The rate that its own setpoint takes, pu/s.
    pub done: S,
    /// x_i at the end of the step, pu.
    pub owed: S,
}

/// Splits the rate `u` of y_i, pu/s, of an agent that owes `owed`, pu, and has `up` room to rise and `down` to
/// fall (1 free, 0 none), over a step of `h_s`; it pays in `theta_s`, not below `h_s`.
pub fn split<S: Scalar>(u: S, owed: S, (up, down): (S, S), h_s: f64, theta_s: f64) -> Split<S> {
    let (zero, h) = (S::constant(0.0), S::constant(h_s));
    // Who owes power upwards and hears that less is wanted owes less first.
    let (u, left) = if u.value() * owed.value() < 0.0 {
        let left = owed + h * u;
        if left.value() * owed.value() > 0.0 {
            (zero, left)
        } else {
            (if h_s > 0.0 { left / h } else { u }, zero)
        }
    } else {
        (u, owed)
    };
    let room = |x: S| if x.value() > 0.0 { up } else { down };
    let done = u * room(u);
    let paid = left * room(left) / S::constant(theta_s);
    Split { done: done + paid, owed: left + h * (u - done - paid) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: (f64, f64) = (1.0, 1.0);

    #[test]
    fn done_and_owed_are_the_whole_rate() {
        for u in [-0.3, 0.0, 0.2] {
            for owed in [-0.1, 0.0, 1e-3, 0.4] {
                for room in [FREE, (0.0, 1.0), (0.25, 1.0), (1.0, 0.5)] {
                    let Split { done, owed: after } = split(u, owed, room, 0.1, 1.0);
                    assert!((0.1 * done + after - owed - 0.1 * u).abs() < 1e-16, "{u} {owed} {room:?}");
                }
            }
        }
    }

    #[test]
    fn a_free_agent_does_all_and_a_full_one_owes_all() {
        assert_eq!(split(0.2, 0.0, FREE, 0.1, 1.0), Split { done: 0.2, owed: 0.0 });
        assert_eq!(split(0.2, 0.0, (0.0, 1.0), 0.5, 1.0), Split { done: 0.0, owed: 0.1 });
        assert_eq!(split(-0.2, 0.0, (0.0, 1.0), 0.5, 1.0), Split { done: -0.2, owed: 0.0 });
    }

    #[test]
    fn what_is_no_longer_wanted_is_owed_no_more_and_the_rest_is_paid() {
        assert_eq!(split(-0.2, 0.4, (0.0, 1.0), 1.0, 1.0), Split { done: 0.0, owed: 0.2 });
        assert_eq!(split(0.0, 0.4, FREE, 0.5, 1.0), Split { done: 0.4, owed: 0.2 });
    }
}
