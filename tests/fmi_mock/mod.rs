//! A model whose answers are known in closed form: n first-order lags, x' = (gain u - x) / tau, that
//! can be told to fail or to panic. `resources/n.txt` holds n.
#![allow(dead_code)]
#![allow(clippy::panic, reason = "it is what some tests are about")]

use bess_consensus::fmi::{
    Access, Along, Array, Causality, Dependencies, Group, Log, LogLevel, Model, ModelError, Phase, Plane,
    Range, Row, Shape, Size, Step, Unit, Values, Variability,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

#[cfg(test)]
pub mod resources;

/// What goes wrong, by the value of the input `fault`.
pub const STEP_PANICS: i32 = 1;
pub const STEP_FAILS: i32 = 2;
pub const REFRESH_PANICS: i32 = 3;
pub const REFRESH_FAILS: i32 = 4;
pub const STEP_LOGS: i32 = 5;
pub const DIFFERENTIATE_FAILS: i32 = 6;
/// A bias that cannot be built in, and one that panics when it is.
pub const BIAS_FAILS: f64 = 404.0;
pub const BIAS_PANICS: f64 = 666.0;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub u: Vec<f64>,
    pub x_start: Vec<f64>,
    pub gain: f64,
    pub tau: f64,
    pub mode: i32,
    pub fault: i32,
    pub enable: bool,
    pub steps: i32,
    pub nanoseconds: i64,
    pub total: f64,
}

/// The shown plane, and the other one: while tangents are shown the two have changed places. Then what it was built
/// from: `total` has the sum of `bias` in it.
#[derive(Clone)]
pub struct Mock(pub State, State, Shape);

impl Mock {
    pub fn with(n: usize) -> Self {
        let u: Vec<f64> = (0..n).map(|i| 1.0 + i as f64).collect();
        let values = State {
            x: vec![0.0; n],
            y: vec![0.0; n],
            u,
            x_start: vec![0.25; n],
            gain: 2.0,
            tau: 0.5,
            mode: 1,
            fault: 0,
            enable: true,
            steps: 0,
            nanoseconds: 0,
            total: 0.0,
        };
        let size = |name, value, min, max| Size {
            name,
            description: "a size",
            value,
            min,
            max,
            mend: "choose another",
        };
        let array = |name, at_most, values| Array {
            name,
            description: "of the sum",
            unit: matches!(values, Values::Float64(_)).then_some(Unit::PerUnit),
            size: "m",
            at_most,
            range: Range::NOT_NEGATIVE,
            values,
        };
        let shape = Shape {
            sizes: vec![size("n", n as u64, 1, 1000), size("m", 1, 0, 10)],
            arrays: vec![
                array("bias", None, Values::Float64(vec![0.0])),
                array("whose", Some("n"), Values::UInt64(vec![0])),
            ],
        };
        Mock(values.clone(), values, shape)
    }
}

impl Model for Mock {
    const IDENTIFIER: &'static str = "Mock";
    const DESCRIPTION: &'static str = "First-order lags <for tests> & \"nothing\" else";
    const HAS_TANGENTS: bool = true;
    type State = State;

    fn load(resources: &Path) -> Result<Self, ModelError> {
        let file = resources.join("n.txt");
        let text = std::fs::read_to_string(&file)
            .map_err(|e| ModelError::new(format!("{}: {e}; expected a number", file.display())))?;
        let n = text.trim().parse().map_err(|e| ModelError::new(format!("n.txt: {e}; expected a number")))?;
        if n == 666 {
            panic!("the mock was told to panic while loading");
        }
        Ok(Mock::with(n))
    }

    fn shape(&self) -> Shape {
        self.2.clone()
    }

    fn reshaped(&self, shape: &Shape) -> Result<Self, ModelError> {
        let bias = shape.reals("bias");
        if bias.contains(&BIAS_PANICS) {
            panic!("the mock was told to panic while it is built");
        }
        if bias.contains(&BIAS_FAILS) {
            return Err(ModelError::new("bias: found 404, expected something else"));
        }
        let Mock(values, tangents, _) = Mock::with(shape.size("n").unwrap_or_default() as usize);
        Ok(Mock(values, tangents, shape.clone()))
    }

    fn variables(&self) -> Vec<Group<Self>> {
        let n = Some(self.0.x.len());
        let group = |name, description, causality, variability, access| Group {
            name,
            description,
            unit: Some(Unit::PerUnit),
            count: n,
            size: Some("n"),
            causality,
            variability,
            access,
            range: Range::ANY,
            dependencies: Dependencies::None,
            row: Row::NONE,
        };
        use Causality::{Input, Output, Parameter};
        use Variability::{Continuous, Discrete, Fixed, Tunable};
        let real = Access::Real;
        let integer = Access::Integer;
        let boolean = Access::Boolean;
        vec![
            group("u", "input", Input, Continuous, real(|m, i| m.0.u[i], Some(|m, i, v| m.0.u[i] = v))),
            group("x", "state", Output, Continuous, real(|m, i| m.0.x[i], None)),
            Group {
                dependencies: Dependencies::SameIndex(&["u"]),
                ..group("y", "x + u", Output, Continuous, real(|m, i| m.0.y[i], None))
            },
            Group {
                count: None,
                dependencies: Dependencies::All(&["u"]),
                ..group("total", "sum of u", Output, Continuous, real(|m, _| m.0.total, None))
            },
            Group {
                unit: None,
                range: Range::POSITIVE,
                count: None,
                ..group(
                    "gain",
                    "a < b",
                    Parameter,
                    Tunable,
                    real(|m, _| m.0.gain, Some(|m, _, v| m.0.gain = v)),
                )
            },
            Group {
                unit: Some(Unit::Second),
                range: Range::POSITIVE,
                count: None,
                ..group("tau", "lag", Parameter, Fixed, real(|m, _| m.0.tau, Some(|m, _, v| m.0.tau = v)))
            },
            Group {
                unit: Some(Unit::PerUnitHour),
                ..group(
                    "x_start",
                    "start of x",
                    Parameter,
                    Fixed,
                    real(|m, i| m.0.x_start[i], Some(|m, i, v| m.0.x_start[i] = v)),
                )
            },
            Group {
                count: None,
                range: Range { min: 1.0, min_excluded: false, max: 3.0 },
                ..group(
                    "mode",
                    "mode",
                    Input,
                    Discrete,
                    integer(|m, _| m.0.mode, Some(|m, _, v| m.0.mode = v)),
                )
            },
            Group {
                count: None,
                ..group(
                    "fault",
                    "what goes wrong",
                    Input,
                    Discrete,
                    integer(|m, _| m.0.fault, Some(|m, _, v| m.0.fault = v)),
                )
            },
            Group {
                count: None,
                ..group(
                    "enable",
                    "whether x moves",
                    Input,
                    Discrete,
                    boolean(|m, _| m.0.enable, Some(|m, _, v| m.0.enable = v)),
                )
            },
            Group {
                count: None,
                ..group("steps", "steps so far", Output, Discrete, integer(|m, _| m.0.steps, None))
            },
            Group {
                count: None,
                ..group("settled", "x = gain u", Output, Discrete, boolean(|m, _| m.0.x == m.0.u, None))
            },
        ]
    }

    fn state(&self) -> &State {
        &self.0
    }

    fn set_state(&mut self, state: &State) -> Result<(), ModelError> {
        if state.x.len() != self.0.x.len() {
            return Err(ModelError::new(format!("{} lags; expected {}", state.x.len(), self.0.x.len())));
        }
        self.0.clone_from(state);
        Ok(())
    }

    fn refresh(&mut self, phase: Phase, _log: &mut dyn Log) -> Result<(), ModelError> {
        match self.0.fault {
            REFRESH_PANICS => panic!("the mock was told to panic in refresh"),
            REFRESH_FAILS => return Err(ModelError::new("the mock was told to fail in refresh")),
            _ => {}
        }
        if phase == Phase::Initialization {
            self.0.x.clone_from(&self.0.x_start);
        }
        self.follow_inputs();
        Ok(())
    }

    /// x' = (gain u - x) / tau with u = u_0 + du t, solved.
    fn step_ramped(&mut self, step: Step, log: &mut dyn Log) -> Result<(), ModelError> {
        let before = self.0.x.clone();
        self.step(step, log)?;
        let (s, du, t) = (&mut self.0, &self.1.u, step.duration_s());
        if s.enable {
            for i in 0..before.len() {
                let rest = s.gain * (s.u[i] - du[i] * s.tau);
                s.x[i] = rest + s.gain * du[i] * t + (before[i] - rest) * (-t / s.tau).exp();
            }
        }
        Ok(())
    }

    fn look_at(&mut self, plane: Plane) {
        std::mem::swap(&mut self.0, &mut self.1);
        if plane == Plane::Tangents {
            let d = &mut self.0;
            for values in [&mut d.u, &mut d.x, &mut d.y, &mut d.x_start] {
                values.fill(0.0);
            }
            (d.gain, d.tau, d.total) = (0.0, 0.0, 0.0);
        }
    }

    fn differentiate(&mut self, along: Along, _: Phase) -> Result<(), ModelError> {
        let Mock(d, s, _) = self;
        if s.fault == DIFFERENTIATE_FAILS {
            return Err(ModelError::new("the mock was told to fail in differentiate"));
        }
        for i in 0..s.x.len() {
            let rate = if s.enable { (s.gain * s.u[i] - s.x[i]) / s.tau } else { 0.0 };
            d.x[i] = if along == Along::Time { rate } else { 0.0 };
            d.y[i] = d.x[i] + d.u[i];
        }
        d.total = d.u.iter().sum();
        Ok(())
    }

    fn step(&mut self, step: Step, log: &mut dyn Log) -> Result<(), ModelError> {
        match self.0.fault {
            STEP_PANICS => panic!("the mock was told to panic in step"),
            STEP_FAILS => return Err(ModelError::new("the mock was told to fail in step")),
            STEP_LOGS => {
                log.log(LogLevel::Event, format_args!("an event at {} s, 100%s\nsure", step.start_s()));
                log.log(LogLevel::Warning, format_args!("a warning"));
            }
            _ => {}
        }
        let s = &mut self.0;
        if s.enable {
            let decay = (-step.duration_s() / s.tau).exp();
            for i in 0..s.x.len() {
                s.x[i] = s.gain * s.u[i] + (s.x[i] - s.gain * s.u[i]) * decay;
            }
        }
        s.steps += 1;
        s.nanoseconds += step.duration_ns;
        self.follow_inputs();
        Ok(())
    }
}

impl Mock {
    fn follow_inputs(&mut self) {
        for i in 0..self.0.x.len() {
            self.0.y[i] = self.0.x[i] + self.0.u[i];
        }
        self.0.total = self.0.u.iter().chain(self.2.reals("bias")).sum();
    }
}
