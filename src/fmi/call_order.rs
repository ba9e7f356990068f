//! Which function may be called in which state: one table, read by every call.
//!
//! Where masters in the field take liberties (values set and read right after instantiation, terminate
//! at any time or twice, no `fmi2SetupExperiment`), the table is wider than the standard. It never
//! allows what would make a result depend on luck, such as a set after terminate.

use serde::{Deserialize, Serialize};
use std::fmt;

/// The states of an instance (FMI 2.0.1, section 4.2.4; no step is ever in progress or half done).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// After fmi2Instantiate or fmi2Reset.
    Instantiated,
    /// Between fmi2EnterInitializationMode and fmi2ExitInitializationMode.
    Initialization,
    /// Between two communication steps.
    Step,
    /// After fmi2Terminate.
    Terminated,
    /// After a panic: only to be freed.
    Fatal,
}

impl State {
    /// All states, in the order of a life.
    pub const ALL: [State; 5] =
        [State::Instantiated, State::Initialization, State::Step, State::Terminated, State::Fatal];
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            State::Instantiated => "instantiated",
            State::Initialization => "initialization mode",
            State::Step => "step mode",
            State::Terminated => "terminated",
            State::Fatal => "fatal",
        })
    }
}

macro_rules! functions {
    ($($function:ident = $name:literal: $($state:ident)*;)*) => {
        /// The 34 functions of FMI 2.0 co-simulation.
        #[allow(missing_docs)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function { $($function),* }

        impl Function {
            /// All functions, in the order of the C headers.
            pub const ALL: &'static [Function] = &[$(Function::$function),*];

            /// Its C name.
            pub fn name(self) -> &'static str {
                match self { $(Function::$function => $name),* }
            }

            /// The same as a set, a bit for each state: every call asks.
            fn allowed(self) -> u8 {
                match self { $(Function::$function => 0 $(| 1 << State::$state as u8)*),* }
            }

            /// The states in which it may be called.
            pub fn allowed_states(self) -> &'static [State] {
                match self { $(Function::$function => &[$(State::$state),*]),* }
            }
        }
    };
}

functions! {
    GetTypesPlatform         = "fmi2GetTypesPlatform":         Instantiated Initialization Step Terminated Fatal;
    GetVersion               = "fmi2GetVersion":               Instantiated Initialization Step Terminated Fatal;
    SetDebugLogging          = "fmi2SetDebugLogging":          Instantiated Initialization Step Terminated;
    Instantiate              = "fmi2Instantiate":              Instantiated Initialization Step Terminated Fatal;
    FreeInstance             = "fmi2FreeInstance":             Instantiated Initialization Step Terminated Fatal;
    SetupExperiment          = "fmi2SetupExperiment":          Instantiated;
    EnterInitializationMode  = "fmi2EnterInitializationMode":  Instantiated;
    ExitInitializationMode   = "fmi2ExitInitializationMode":                Initialization;
    Terminate                = "fmi2Terminate":                Instantiated Initialization Step Terminated;
    Reset                    = "fmi2Reset":                    Instantiated Initialization Step Terminated;
    GetReal                  = "fmi2GetReal":                  Instantiated Initialization Step Terminated;
    GetInteger               = "fmi2GetInteger":               Instantiated Initialization Step Terminated;
    GetBoolean               = "fmi2GetBoolean":               Instantiated Initialization Step Terminated;
    GetString                = "fmi2GetString":                Instantiated Initialization Step Terminated;
    SetReal                  = "fmi2SetReal":                  Instantiated Initialization Step;
    SetInteger               = "fmi2SetInteger":               Instantiated Initialization Step;
    SetBoolean               = "fmi2SetBoolean":               Instantiated Initialization Step;
    SetString                = "fmi2SetString":                Instantiated Initialization Step;
    GetFmuState              = "fmi2GetFMUstate":              Instantiated Initialization Step Terminated;
    SetFmuState              = "fmi2SetFMUstate":              Instantiated Initialization Step Terminated;
    FreeFmuState             = "fmi2FreeFMUstate":             Instantiated Initialization Step Terminated Fatal;
    SerializedFmuStateSize   = "fmi2SerializedFMUstateSize":   Instantiated Initialization Step Terminated;
    SerializeFmuState        = "fmi2SerializeFMUstate":        Instantiated Initialization Step Terminated;
    DeSerializeFmuState      = "fmi2DeSerializeFMUstate":      Instantiated Initialization Step Terminated;
    GetDirectionalDerivative = "fmi2GetDirectionalDerivative":              Initialization Step Terminated;
    SetRealInputDerivatives  = "fmi2SetRealInputDerivatives":  Instantiated Initialization Step;
    GetRealOutputDerivatives = "fmi2GetRealOutputDerivatives":                             Step Terminated;
    DoStep                   = "fmi2DoStep":                                               Step;
    CancelStep               = "fmi2CancelStep":                                           Step;
    GetStatus                = "fmi2GetStatus":                Instantiated Initialization Step Terminated;
    GetRealStatus            = "fmi2GetRealStatus":            Instantiated Initialization Step Terminated;
    GetIntegerStatus         = "fmi2GetIntegerStatus":         Instantiated Initialization Step Terminated;
    GetBooleanStatus         = "fmi2GetBooleanStatus":         Instantiated Initialization Step Terminated;
    GetStringStatus          = "fmi2GetStringStatus":          Instantiated Initialization Step Terminated;
}

impl Function {
    /// Whether it may be called in this state.
    #[inline]
    pub fn is_allowed(self, state: State) -> bool {
        self.allowed() & (1 << state as u8) != 0
    }

    /// The allowed states, for an error message.
    pub(super) fn describe_allowed(self) -> String {
        let names: Vec<String> = self.allowed_states().iter().map(State::to_string).collect();
        names.join(", ")
    }
}

impl fmt::Display for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The standard's own table (FMI 2.0.1, section 4.2.4) as far as these states go: whatever it allows
    /// must be allowed here. Columns: instantiated, initialization, step, terminated.
    const STANDARD: &[(&str, [bool; 4])] = &[
        ("fmi2SetDebugLogging", [true, true, true, true]),
        ("fmi2SetupExperiment", [true, false, false, false]),
        ("fmi2EnterInitializationMode", [true, false, false, false]),
        ("fmi2ExitInitializationMode", [false, true, false, false]),
        ("fmi2Terminate", [false, false, true, false]),
        ("fmi2Reset", [true, true, true, true]),
        ("fmi2GetReal", [false, true, true, true]),
        ("fmi2SetReal", [true, true, true, false]),
        ("fmi2GetFMUstate", [true, true, true, true]),
        ("fmi2SetFMUstate", [true, true, true, true]),
        ("fmi2FreeFMUstate", [true, true, true, true]),
        ("fmi2SerializedFMUstateSize", [true, true, true, true]),
        ("fmi2SerializeFMUstate", [true, true, true, true]),
        ("fmi2DeSerializeFMUstate", [true, true, true, true]),
        ("fmi2GetDirectionalDerivative", [false, true, true, true]),
        ("fmi2GetRealOutputDerivatives", [false, false, true, true]),
        ("fmi2DoStep", [false, false, true, false]),
        ("fmi2GetStatus", [false, false, true, false]),
    ];

    #[test]
    fn nothing_that_the_standard_allows_is_refused() {
        for (name, row) in STANDARD {
            let function = Function::ALL.iter().find(|f| f.name() == *name).expect(name);
            for (state, allowed) in State::ALL.iter().zip(row) {
                assert!(!allowed || function.is_allowed(*state), "{name} in {state}");
            }
        }
    }

    #[test]
    fn set_and_list_of_states_are_one() {
        for function in Function::ALL {
            for state in State::ALL {
                assert_eq!(function.is_allowed(state), function.allowed_states().contains(&state));
            }
        }
    }

    #[test]
    fn a_fatal_instance_can_only_be_freed() {
        let allowed: Vec<&str> =
            Function::ALL.iter().filter(|f| f.is_allowed(State::Fatal)).map(|f| f.name()).collect();
        let expected = [
            "fmi2GetTypesPlatform",
            "fmi2GetVersion",
            "fmi2Instantiate",
            "fmi2FreeInstance",
            "fmi2FreeFMUstate",
        ];
        assert_eq!(allowed, expected);
    }

    #[test]
    fn thirty_four_functions_with_distinct_names() {
        let mut names: Vec<&str> = Function::ALL.iter().map(|f| f.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 34);
    }
}
