//! Which function of FMI 3.0 may be called in which state: one table, read by every call.
//!
//! Like that of FMI 2.0 it is wider than the standard where masters take liberties (values read right after
//! instantiation, terminate at any time or twice). What this FMU has no use for is allowed wherever an instance
//! lives: the answer says why there is nothing behind it.

use std::fmt;

/// The states of a co-simulation instance (FMI 3.0, sections 2.3 and 4.2) without event mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// After fmi3InstantiateCoSimulation or fmi3Reset.
    Instantiated,
    /// Between fmi3EnterConfigurationMode and fmi3ExitConfigurationMode.
    Configuration,
    /// Between fmi3EnterInitializationMode and fmi3ExitInitializationMode.
    Initialization,
    /// Between two communication steps.
    Step,
    /// After fmi3Terminate.
    Terminated,
    /// After a panic: only to be freed.
    Fatal,
}

impl State {
    /// All states, in the order of a life.
    pub const ALL: [State; 6] = [
        State::Instantiated,
        State::Configuration,
        State::Initialization,
        State::Step,
        State::Terminated,
        State::Fatal,
    ];
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            State::Instantiated => "instantiated",
            State::Configuration => "configuration mode",
            State::Initialization => "initialization mode",
            State::Step => "step mode",
            State::Terminated => "terminated",
            State::Fatal => "fatal",
        })
    }
}

/// A bit for each state, in the order of [`State::ALL`].
const LIVING: u8 = 0b01_1111;
const ANY: u8 = 0b11_1111;
const INSTANTIATED: u8 = 0b00_0001;
const CONFIGURATION: u8 = 0b00_0010;
const INITIALIZATION: u8 = 0b00_0100;
const STEP: u8 = 0b00_1000;
const TERMINATED: u8 = 0b01_0000;
/// Before the first step and between steps.
const SETTING: u8 = INSTANTIATED | CONFIGURATION | INITIALIZATION | STEP;

macro_rules! functions {
    ($($function:ident: $states:expr;)*) => {
        /// The 75 functions of FMI 3.0, each under its C name without `fmi3`.
        #[allow(missing_docs)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function { $($function),* }

        impl Function {
            /// All functions, in the order of the C header.
            pub const ALL: &'static [Function] = &[$(Function::$function),*];

            /// Its C name.
            pub fn name(self) -> &'static str {
                match self { $(Function::$function => concat!("fmi3", stringify!($function))),* }
            }

            /// The states in which it may be called, a bit for each.
            fn allowed(self) -> u8 {
                match self { $(Function::$function => $states),* }
            }
        }
    };
}

functions! {
    GetVersion: ANY;
    SetDebugLogging: LIVING;
    InstantiateModelExchange: ANY;
    InstantiateCoSimulation: ANY;
    InstantiateScheduledExecution: ANY;
    FreeInstance: ANY;
    EnterInitializationMode: INSTANTIATED;
    ExitInitializationMode: INITIALIZATION;
    EnterEventMode: LIVING;
    Terminate: LIVING;
    Reset: LIVING;
    GetFloat32: LIVING;
    GetFloat64: LIVING;
    GetInt8: LIVING;
    GetUInt8: LIVING;
    GetInt16: LIVING;
    GetUInt16: LIVING;
    GetInt32: LIVING;
    GetUInt32: LIVING;
    GetInt64: LIVING;
    GetUInt64: LIVING;
    GetBoolean: LIVING;
    GetString: LIVING;
    GetBinary: LIVING;
    GetClock: LIVING;
    SetFloat32: SETTING;
    SetFloat64: SETTING;
    SetInt8: SETTING;
    SetUInt8: SETTING;
    SetInt16: SETTING;
    SetUInt16: SETTING;
    SetInt32: SETTING;
    SetUInt32: SETTING;
    SetInt64: SETTING;
    SetUInt64: SETTING;
    SetBoolean: SETTING;
    SetString: SETTING;
    SetBinary: SETTING;
    SetClock: SETTING;
    GetNumberOfVariableDependencies: LIVING & !CONFIGURATION;
    GetVariableDependencies: LIVING & !CONFIGURATION;
    GetFMUState: LIVING;
    SetFMUState: LIVING;
    FreeFMUState: ANY;
    SerializedFMUStateSize: LIVING;
    SerializeFMUState: LIVING;
    DeserializeFMUState: LIVING;
    GetDirectionalDerivative: INITIALIZATION | STEP | TERMINATED;
    GetAdjointDerivative: LIVING;
    EnterConfigurationMode: INSTANTIATED;
    ExitConfigurationMode: CONFIGURATION;
    GetIntervalDecimal: LIVING;
    GetIntervalFraction: LIVING;
    GetShiftDecimal: LIVING;
    GetShiftFraction: LIVING;
    SetIntervalDecimal: LIVING;
    SetIntervalFraction: LIVING;
    SetShiftDecimal: LIVING;
    SetShiftFraction: LIVING;
    EvaluateDiscreteStates: LIVING;
    UpdateDiscreteStates: LIVING;
    EnterContinuousTimeMode: LIVING;
    CompletedIntegratorStep: LIVING;
    SetTime: LIVING;
    SetContinuousStates: LIVING;
    GetContinuousStateDerivatives: LIVING;
    GetEventIndicators: LIVING;
    GetContinuousStates: LIVING;
    GetNominalsOfContinuousStates: LIVING;
    GetNumberOfEventIndicators: LIVING;
    GetNumberOfContinuousStates: LIVING;
    EnterStepMode: LIVING;
    GetOutputDerivatives: STEP | TERMINATED;
    DoStep: STEP;
    ActivateModelPartition: LIVING;
}

impl Function {
    /// Whether it may be called in this state.
    #[inline]
    pub fn is_allowed(self, state: State) -> bool {
        self.allowed() & (1 << state as u8) != 0
    }

    /// The allowed states, for an error message.
    pub(super) fn describe_allowed(self) -> String {
        let names: Vec<String> =
            State::ALL.iter().filter(|state| self.is_allowed(**state)).map(State::to_string).collect();
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

    /// Every function that the header declares, and none besides.
    #[test]
    fn the_table_is_that_of_the_header() {
        let header = include_str!("../headers/fmi3Functions.h");
        let declared = header
            .lines()
            .filter_map(|line| line.trim().strip_prefix("FMI3_Export fmi3"))
            .filter_map(|rest| rest.split_once("TYPE").map(|(_, names)| names.trim()))
            .map(|name| name.trim_end_matches(';').trim());
        let mut declared: Vec<&str> = declared.collect();
        let mut table: Vec<&str> = Function::ALL.iter().map(|function| function.name()).collect();
        declared.sort_unstable();
        table.sort_unstable();
        assert_eq!(table, declared);
        assert_eq!(table.len(), 75);
    }

    /// The standard's own rules (FMI 3.0, sections 2.3 and 4.2) as far as these states go: whatever they allow must
    /// be allowed here. Columns: instantiated, configuration, initialization, step, terminated.
    #[test]
    fn nothing_that_the_standard_allows_is_refused() {
        for (name, row) in [
            ("fmi3SetDebugLogging", [true, true, true, true, true]),
            ("fmi3EnterConfigurationMode", [true, false, false, false, false]),
            ("fmi3ExitConfigurationMode", [false, true, false, false, false]),
            ("fmi3EnterInitializationMode", [true, false, false, false, false]),
            ("fmi3ExitInitializationMode", [false, false, true, false, false]),
            ("fmi3Terminate", [false, false, false, true, false]),
            ("fmi3Reset", [true, true, true, true, true]),
            ("fmi3GetFloat64", [true, false, true, true, true]),
            ("fmi3GetUInt64", [true, true, true, true, true]),
            ("fmi3SetFloat64", [true, false, true, true, false]),
            ("fmi3SetUInt64", [false, true, true, true, false]),
            ("fmi3GetFMUState", [true, true, true, true, true]),
            ("fmi3SetFMUState", [true, true, true, true, true]),
            ("fmi3FreeFMUState", [true, true, true, true, true]),
            ("fmi3SerializeFMUState", [true, true, true, true, true]),
            ("fmi3GetDirectionalDerivative", [false, false, true, true, true]),
            ("fmi3GetVariableDependencies", [true, false, true, true, true]),
            ("fmi3GetOutputDerivatives", [false, false, false, true, true]),
            ("fmi3DoStep", [false, false, false, true, false]),
        ] {
            let function = Function::ALL.iter().find(|f| f.name() == name).unwrap();
            for (state, allowed) in State::ALL.iter().zip(row) {
                assert!(!allowed || function.is_allowed(*state), "{name} in {state}");
            }
        }
    }

    #[test]
    fn a_fatal_instance_can_only_be_freed() {
        let allowed: Vec<&str> =
            Function::ALL.iter().filter(|f| f.is_allowed(State::Fatal)).map(|f| f.name()).collect();
        let expected = [
            "fmi3GetVersion",
            "fmi3InstantiateModelExchange",
            "fmi3InstantiateCoSimulation",
            "fmi3InstantiateScheduledExecution",
            "fmi3FreeInstance",
            "fmi3FreeFMUState",
        ];
        assert_eq!(allowed, expected);
    }
}
