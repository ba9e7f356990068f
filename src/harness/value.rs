//! Values of the three types that travel between participants, and how one type becomes another.
//! Strings never travel.

use std::fmt;

/// The type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// fmi2Real.
    Real,
    /// fmi2Integer, and fmi2Enumeration, which is read and set like one.
    Integer,
    /// fmi2Boolean.
    Boolean,
    /// fmi2String: can be listed, not coupled.
    String,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Kind::Real => "Real",
            Kind::Integer => "Integer",
            Kind::Boolean => "Boolean",
            Kind::String => "String",
        })
    }
}

/// One value, in the type that its author wrote it in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// fmi2Real.
    Real(f64),
    /// fmi2Integer.
    Integer(i32),
    /// fmi2Boolean.
    Boolean(bool),
}

impl Value {
    /// As a number: Booleans are 0 or 1.
    pub fn as_f64(self) -> f64 {
        match self {
            Value::Real(value) => value,
            Value::Integer(value) => f64::from(value),
            Value::Boolean(value) => f64::from(u8::from(value)),
        }
    }

    /// As a value of this type, or none where it does not fit (see [`to_integer`], [`to_boolean`]).
    pub fn convert(self, kind: Kind) -> Option<Value> {
        match kind {
            Kind::Real => Some(Value::Real(self.as_f64())),
            Kind::Integer => to_integer(self.as_f64()).map(Value::Integer),
            Kind::Boolean => to_boolean(self.as_f64()).map(Value::Boolean),
            Kind::String => None,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Real(value) => write!(f, "{value:?}"),
            Value::Integer(value) => write!(f, "{value}"),
            Value::Boolean(value) => write!(f, "{value}"),
        }
    }
}

/// Rounded to the nearest integer; none if that is not an fmi2Integer.
pub fn to_integer(value: f64) -> Option<i32> {
    let rounded = value.round();
    (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&rounded).then_some(rounded as i32)
}

/// True from one half upwards, so that a Real 0/1 signal with rounding errors stays what it was;
/// none for NaN.
pub fn to_boolean(value: f64) -> Option<bool> {
    (!value.is_nan()).then_some(value >= 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_convert_where_the_value_fits() {
        let table = [
            (Value::Boolean(true), Kind::Real, Some(Value::Real(1.0))),
            (Value::Boolean(true), Kind::Integer, Some(Value::Integer(1))),
            (Value::Integer(-3), Kind::Real, Some(Value::Real(-3.0))),
            (Value::Integer(2), Kind::Boolean, Some(Value::Boolean(true))),
            (Value::Integer(0), Kind::Boolean, Some(Value::Boolean(false))),
            (Value::Real(1.9999999), Kind::Integer, Some(Value::Integer(2))),
            (Value::Real(-2.5), Kind::Integer, Some(Value::Integer(-3))),
            (Value::Real(2147483647.0), Kind::Integer, Some(Value::Integer(i32::MAX))),
            (Value::Real(2147483648.0), Kind::Integer, None),
            (Value::Real(-2147483649.0), Kind::Integer, None),
            (Value::Real(f64::NAN), Kind::Integer, None),
            (Value::Real(f64::NAN), Kind::Boolean, None),
            (Value::Real(0.5), Kind::Boolean, Some(Value::Boolean(true))),
            (Value::Real(0.4999), Kind::Boolean, Some(Value::Boolean(false))),
            (Value::Real(1.0), Kind::String, None),
        ];
        for (value, kind, expected) in table {
            assert_eq!(value.convert(kind), expected, "{value} as {kind}");
        }
    }
}
