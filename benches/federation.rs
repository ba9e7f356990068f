//! The least that a federation of this size costs: a bare ring of HELICS federates through the same binding, each telling
//! the next as many numbers a step as our federates tell each other. `cargo xtask bench --only federation` runs it
//! beside `bess federate`. Prints one line of JSON.

use bess_consensus::federation::{Address, Broker, Helics, LATER_NS, Session, Share, Topic};
use std::io::{BufRead, BufReader};
use std::process::{Command, ExitCode, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

const USAGE: &str = "Usage: federation ring FEDERATES STEPS VALUES CORE TURNS
  FEDERATES processes in a ring; in each of STEPS steps each tells the next VALUES numbers and asks for the next time.
  CORE is zmq, tcp or ipc. TURNS is 1 where all have the same times, 2 where all but the first come a nanosecond later,
  as controllers come after the grid, and 3 where moreover all hear each other as grid and controllers do: the first and
  each of the others both ways, the others in a ring both ways. The library is that of $BESS_HELICS, or of python3's package helics.";

/// A communication step, ns.
const STEP_NS: i64 = 10_000_000;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let done = match words.as_slice() {
        ["ring", rest @ ..] => Ring::read(rest).and_then(|ring| ring.run()),
        ["member", place, host, port, rest @ ..] => {
            Ring::read(rest).and_then(|ring| ring.member(place, host, port))
        }
        _ => Err(USAGE.to_owned()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("{reason}");
            ExitCode::FAILURE
        }
    }
}

struct Ring {
    federates: usize,
    steps: i64,
    values: usize,
    core: String,
    turns: u32,
}

impl Ring {
    fn read(words: &[&str]) -> Result<Self, String> {
        let [federates, steps, values, core, turns] = words else { return Err(USAGE.to_owned()) };
        let number =
            |word: &str| word.parse::<i64>().map_err(|_| format!("{word}: expected a number\n{USAGE}"));
        Ok(Self {
            federates: number(federates)? as usize,
            steps: number(steps)?,
            values: number(values)? as usize,
            core: (*core).to_owned(),
            turns: number(turns)? as u32,
        })
    }

    /// Starts broker and members, and waits for the slowest.
    fn run(&self) -> Result<(), String> {
        let helics = helics()?;
        let (host, port) = self.place()?;
        let at = match &*self.core {
            "ipc" => format!("--local_interface={host}"),
            _ => format!("--port={port} --local_interface={host}"),
        };
        let options = format!("-f{} --loglevel=error {at}", self.federates);
        let broker =
            Broker::start(&helics, &self.core, "ring", &options).map_err(|error| error.to_string())?;
        let program = std::env::current_exe().map_err(|error| error.to_string())?;
        let mut members = Vec::with_capacity(self.federates);
        for place in 0..self.federates {
            let mut member = Command::new(&program);
            member.args(["member", &place.to_string(), &host, &port.to_string()]);
            member.args([self.federates.to_string(), self.steps.to_string(), self.values.to_string()]);
            member.args([&self.core, &self.turns.to_string()]).stdout(Stdio::piped());
            members.push(member.spawn().map_err(|error| error.to_string())?);
        }
        // When one dies the others would wait for it for ever.
        loop {
            let ended: Result<Vec<_>, _> = members.iter_mut().map(|member| member.try_wait()).collect();
            let ended = ended.map_err(|error| error.to_string())?;
            if ended.iter().flatten().any(|status| !status.success()) {
                members.iter_mut().for_each(|member| drop(member.kill()));
                return Err("a member of the ring ended early".to_owned());
            }
            if ended.iter().all(Option::is_some) {
                break;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let mut slowest: f64 = 0.0;
        let outputs: Vec<_> = members.iter_mut().filter_map(|member| member.stdout.take()).collect();
        for out in outputs {
            let mut line = String::new();
            let read = BufReader::new(out).read_line(&mut line);
            match (read, line.trim().parse::<f64>()) {
                (Ok(_), Ok(took_s)) => slowest = slowest.max(took_s),
                _ => return Err("a member of the ring told no time".to_owned()),
            }
        }
        drop(broker);
        println!(
            "{{\"steps\": {}, \"took_s\": {slowest}, \"version\": \"{}\"}}",
            self.steps,
            helics.version()
        );
        Ok(())
    }

    /// One federate of the ring; prints the time between first and last step, s.
    fn member(&self, place: &str, host: &str, port: &str) -> Result<(), String> {
        let helics = helics()?;
        let place: usize = place.parse().map_err(|_| USAGE.to_owned())?;
        let address = Address {
            core: self.core.clone(),
            host: host.to_owned(),
            port: port.parse().map_err(|_| USAGE.to_owned())?,
            options: "--loglevel=error".to_owned(),
        };
        let name = |k: usize| format!("member{}", k % self.federates);
        let ways = self.ways();
        let told_to = |from: usize| ways.iter().filter(|(of, _)| *of == from).count().max(1);
        let topic = |(from, to): &(usize, usize)| Topic {
            from: name(*from),
            to: name(*to),
            publication: format!("{}/{}/all", name(*from), name(*to)),
            input: format!("{}/from/{}", name(*to), name(*from)),
            unit: String::new(),
            // As many numbers a federate in all, however many it tells them.
            variables: (0..self.values.div_ceil(told_to(*from))).map(|k| format!("x[{k}]")).collect(),
            is_double: false,
        };
        let own = ways.iter().filter(|(from, to)| *from == place || *to == place);
        let topics: Vec<Topic> = own.map(topic).collect();
        let share = Share::of(&name(place), &topics);
        let run = || -> Result<f64, bess_consensus::federation::FederationError> {
            let mut session = Session::connect(&helics, &name(place), &address, &share)?;
            let heard_count = share.heard.iter().map(|topic| topic.variables.len()).sum();
            let mut heard = vec![0.0; heard_count];
            let told = vec![1.0; share.told_variables.len()];
            let mut flags = vec![false; session.senders().len()];
            session.enter_initializing()?;
            session.enter_executing()?;
            let offset_ns = if self.turns >= 2 && place > 0 { LATER_NS } else { 0 };
            let begun = Instant::now();
            for k in 1..=self.steps {
                session.publish(&told)?;
                session.request(k * STEP_NS + offset_ns)?;
                session.read(&mut heard, &mut flags)?;
            }
            let took_s = begun.elapsed().as_secs_f64();
            session.leave()?;
            Ok(took_s)
        };
        let took_s = run().map_err(|error| error.to_string())?;
        println!("{took_s}");
        // An ordinary end of the process may wait for a broker that is gone.
        helics.end_process(0)
    }

    /// Who tells whom.
    fn ways(&self) -> Vec<(usize, usize)> {
        let n = self.federates;
        if self.turns < 3 {
            return (0..n).map(|k| (k, (k + 1) % n)).collect();
        }
        let mut ways: Vec<(usize, usize)> = (1..n).flat_map(|k| [(0, k), (k, 0)]).collect();
        for k in 1..n {
            let next = k % (n - 1) + 1;
            if next != k {
                ways.extend([(k, next), (next, k)]);
            }
        }
        ways.sort_unstable();
        ways.dedup();
        ways
    }

    /// A broker's place that nobody has.
    fn place(&self) -> Result<(String, u16), String> {
        if self.core == "ipc" {
            return Ok((format!("ring{}", std::process::id()), 0));
        }
        // Every member takes two from there on.
        let is_free = |port: u16| std::net::TcpListener::bind(("127.0.0.1", port)).is_ok();
        for k in 0..100 {
            let first = 18_000 + (std::process::id() as u16 % 100 + k) % 100 * 64;
            if (first..first + 4 + 2 * self.federates as u16).all(is_free) {
                return Ok(("127.0.0.1".to_owned(), first));
            }
        }
        Err("no free ports next to each other from 18000 on".to_owned())
    }
}

fn helics() -> Result<Arc<Helics>, String> {
    Helics::load(None).map(Arc::new).map_err(|error| error.to_string())
}
