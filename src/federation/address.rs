//! Where the broker is, as HELICS wants to be told.

/// How to reach the broker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// `zmq`, `tcp` or `ipc`.
    pub core: String,
    /// Host or address of the broker; its name with `ipc`.
    pub host: String,
    /// Its port; not used with `ipc`.
    pub port: u16,
    /// Further options for HELICS's core, as it takes them on a command line.
    pub options: String,
}

impl Address {
    /// The options of a federate's core.
    pub fn core_options(&self) -> String {
        let where_to = match &*self.core {
            "ipc" => format!("--broker_address={}", self.host),
            _ => format!("--broker_address={} --brokerport={}", self.host, self.port),
        };
        format!("--federates=1 {where_to} {}", self.options)
    }
}
