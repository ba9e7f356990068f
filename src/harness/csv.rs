//! Numbers as CSV text: shortest form that reads back as the same f64, names quoted where they hold a
//! comma. Runs on the recorder's thread.

use super::hash::Fnv64;
use super::observer::Column;
use super::value::Kind;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Write};
use std::sync::mpsc::{Receiver, SyncSender};

/// Text is handed to the file in portions of about this many bytes.
const PORTION: usize = 256 * 1024;

/// What the writing thread is asked for.
pub(super) enum Job {
    /// Rows: time and one value for each column, one row after the other.
    Rows(Vec<f64>),
    /// To bring everything so far to the disk and say where the file ends.
    Mark(SyncSender<Mark>),
}

/// The end of a file, by length and contents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    /// Bytes.
    pub bytes: u64,
    /// FNV-1a of all of them; of none where nobody asks for marks.
    pub hash: u64,
}

/// Writes the header, unless `from` says what the file holds already, then does the jobs as they come, until the sender
/// is gone; gives the buffers back. After each job its rows are with the system, in whole lines.
pub(super) fn write(
    mut file: File,
    columns: &[Column],
    (from, is_marked): (Option<Mark>, bool),
    jobs: &Receiver<Job>,
    recycle: &SyncSender<Vec<f64>>,
) -> io::Result<File> {
    let mut text = Vec::with_capacity(PORTION + 64 * columns.len());
    let mut cells = vec![Cell::default(); columns.len()];
    let mut end = from.unwrap_or(Mark { bytes: 0, hash: Fnv64::default().value() });
    let mut put = |file: &mut File, text: &mut Vec<u8>| {
        let mut hash = Fnv64::from_value(end.hash);
        if is_marked {
            hash.add(text);
        }
        end = Mark { bytes: end.bytes + text.len() as u64, hash: hash.value() };
        let written = file.write_all(text);
        text.clear();
        written.map(|()| end)
    };
    if from.is_none() {
        header(&mut text, columns);
    }
    put(&mut file, &mut text)?;
    while let Ok(job) = jobs.recv() {
        let mut block = match job {
            Job::Rows(block) => block,
            Job::Mark(answer) => {
                let end = put(&mut file, &mut text)?;
                file.sync_data()?;
                // The other side may be gone already: then nobody needs the answer.
                let _ = answer.try_send(end);
                continue;
            }
        };
        for row in block.chunks_exact(1 + columns.len()) {
            push_row(&mut text, columns, &mut cells, row)?;
            if text.len() >= PORTION {
                put(&mut file, &mut text)?;
            }
        }
        put(&mut file, &mut text)?;
        block.clear();
        let _ = recycle.try_send(block);
    }
    Ok(file)
}

fn header(text: &mut Vec<u8>, columns: &[Column]) {
    text.extend_from_slice(b"time");
    for column in columns {
        let label = column.label();
        text.push(b',');
        if label.contains([',', '"', '\n', '\r']) {
            text.push(b'"');
            text.extend_from_slice(label.replace('"', "\"\"").as_bytes());
            text.push(b'"');
        } else {
            text.extend_from_slice(label.as_bytes());
        }
    }
    text.push(b'\n');
}

/// What was last written into a column. Many columns stand still for long, and copying is cheaper than
/// finding the shortest form again.
#[derive(Clone, Default)]
struct Cell {
    bits: u64,
    text: Vec<u8>,
}

fn push_row(text: &mut Vec<u8>, columns: &[Column], cells: &mut [Cell], row: &[f64]) -> io::Result<()> {
    let [time, values @ ..] = row else { return Ok(()) };
    push_real(text, *time)?;
    for ((value, column), cell) in values.iter().zip(columns).zip(cells) {
        text.push(b',');
        match column.kind {
            Kind::Real if !cell.text.is_empty() && cell.bits == value.to_bits() => {
                text.extend_from_slice(&cell.text);
            }
            Kind::Real => {
                let begin = text.len();
                push_real(text, *value)?;
                cell.bits = value.to_bits();
                cell.text.clear();
                cell.text.extend_from_slice(&text[begin..]);
            }
            Kind::Boolean => text.push(if *value == 0.0 { b'0' } else { b'1' }),
            Kind::Integer | Kind::String => serde_json::to_writer(&mut *text, &(*value as i64))?,
        }
    }
    text.push(b'\n');
    Ok(())
}

/// `serde_json` writes the shortest form faster than `std`, but knows no NaN.
fn push_real(text: &mut Vec<u8>, value: f64) -> io::Result<()> {
    if value.is_finite() { Ok(serde_json::to_writer(text, &value)?) } else { write!(text, "{value}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(variable: &str, kind: Kind) -> Column {
        Column { participant: "grid".into(), variable: variable.into(), kind, unit: None }
    }

    #[test]
    fn reals_read_back_to_the_bit() {
        let mut bits = 0x9e37_79b9_7f4a_7c15_u64;
        for _ in 0..200_000 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let value = f64::from_bits(bits);
            if value.is_finite() {
                let mut text = Vec::new();
                push_real(&mut text, value).unwrap();
                let text = std::str::from_utf8(&text).unwrap();
                assert_eq!(text.parse::<f64>().unwrap().to_bits(), bits, "{text}");
            }
        }
    }

    #[test]
    fn a_row_holds_each_type_in_its_form() {
        let columns =
            [column("P[1]", Kind::Real), column("cluster[1]", Kind::Integer), column("on", Kind::Boolean)];
        let mut text = Vec::new();
        header(&mut text, &columns);
        let mut cells = vec![Cell::default(); columns.len()];
        for row in [
            [0.1, -1e-7, -3.0, 1.0],
            [0.2, f64::NAN, 2.0, 0.0],
            [0.3, f64::NAN, 2.0, 0.0],
            [0.4, 0.0, 2.0, 1.0],
        ] {
            push_row(&mut text, &columns, &mut cells, &row).unwrap();
        }
        let expected = "time,grid.P[1],grid.cluster[1],grid.on\n0.1,-1e-7,-3,1\n0.2,NaN,2,0\n0.3,NaN,2,0\n\
                        0.4,0.0,2,1\n";
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }

    #[test]
    fn names_with_commas_are_quoted() {
        let mut text = Vec::new();
        header(&mut text, &[column("A[1,2]", Kind::Real), column("say \"x\"", Kind::Real)]);
        assert_eq!(String::from_utf8(text).unwrap(), "time,\"grid.A[1,2]\",\"grid.say \"\"x\"\"\"\n");
    }
}
