//! MATPOWER's own case format, version 2 (`.m`): `mpc.baseMVA`, `mpc.bus`, `mpc.gen`, `mpc.branch`.
//! Understands data, not the MATLAB language: a file that computes with its tables is refused rather
//! than misread. Tables that are not needed are passed over.

use super::case::{Branch, Bus, Case, Generator};
use super::error::GridError;
use super::matpower_text::{Glyph, glyphs};

impl Case {
    /// A case from the text of a MATPOWER case file, format version 2, validated. Errors name the line.
    ///
    /// Rows out of service are kept with status 0, isolated buses with type 4; columns beyond those used
    /// are ignored. Infinite limits become +-1e10, because JSON has no infinity.
    pub fn from_matpower(text: &str) -> Result<Self, GridError> {
        let glyphs = glyphs(text)?;
        let mut reader = Reader { glyphs: &glyphs, at: 0, variable: "mpc".to_owned(), name: String::new() };
        let mut tables = Tables::default();
        while reader.statement(&mut tables)? {}
        tables.into_case(reader.name)
    }
}

fn syntax(line: usize, message: impl Into<String>) -> GridError {
    GridError::Syntax { line, message: message.into() }
}

/// A matrix: each row with the line it stands in.
struct Table {
    line: usize,
    rows: Vec<(usize, Vec<f64>)>,
}

#[derive(Default)]
struct Tables {
    base_mva: Option<f64>,
    bus: Option<Table>,
    generator: Option<Table>,
    branch: Option<Table>,
}

struct Reader<'a> {
    glyphs: &'a [Glyph],
    at: usize,
    variable: String,
    name: String,
}

impl Reader<'_> {
    fn peek(&self) -> Option<Glyph> {
        self.glyphs.get(self.at).copied()
    }

    fn is(&self, c: char) -> bool {
        self.peek().is_some_and(|g| !g.quoted && g.c == c)
    }

    fn line(&self) -> usize {
        self.peek().or(self.glyphs.last().copied()).map_or(1, |g| g.line as usize)
    }

    fn skip(&mut self, skip: fn(char) -> bool) {
        while self.peek().is_some_and(|g| !g.quoted && skip(g.c)) {
            self.at += 1;
        }
    }

    fn take(&mut self, belongs: fn(char) -> bool) -> String {
        let mut word = String::new();
        while let Some(g) = self.peek().filter(|g| !g.quoted && belongs(g.c)) {
            word.push(g.c);
            self.at += 1;
        }
        word
    }

    /// Reads one statement; false at the end of the text.
    fn statement(&mut self, tables: &mut Tables) -> Result<bool, GridError> {
        self.skip(|c| c.is_whitespace() || c == ';' || c == ',');
        if self.peek().is_none() {
            return Ok(false);
        }
        let line = self.line();
        let target = self.take(|c| c.is_alphanumeric() || c == '_' || c == '.');
        if target == "function" {
            self.function(line)?;
            return Ok(true);
        }
        let field = target.strip_prefix(&self.variable).and_then(|rest| rest.strip_prefix('.')).unwrap_or("");
        self.skip(blank);
        let assigned = self.is('=');
        match field {
            "baseMVA" | "bus" | "gen" | "branch" | "version" if !assigned => Err(syntax(
                line,
                format!(
                    "{target}: the file computes with its data; expected plain tables (run it in MATPOWER and save the result with savecase)"
                ),
            )),
            "baseMVA" => {
                let value = self.scalar()?;
                let number = value
                    .parse()
                    .map_err(|_| syntax(line, format!("{target}: found `{value}`, expected a number")))?;
                tables.base_mva = Some(number);
                Ok(true)
            }
            "version" => match self.scalar()?.as_str() {
                "'2'" | "\"2\"" | "2" => Ok(true),
                other => Err(syntax(line, format!("{target}: found {other}, expected '2'"))),
            },
            "bus" => self.table(&target).map(|table| tables.bus = Some(table)).map(|()| true),
            "gen" => self.table(&target).map(|table| tables.generator = Some(table)).map(|()| true),
            "branch" => self.table(&target).map(|table| tables.branch = Some(table)).map(|()| true),
            _ => {
                self.pass_over();
                Ok(true)
            }
        }
    }

    /// `function mpc = case57`: the name of the struct and of the case.
    fn function(&mut self, line: usize) -> Result<(), GridError> {
        self.skip(blank);
        if self.is('[') {
            return Err(syntax(
                line,
                "a case of format version 1 (several outputs); expected version 2 (`function mpc = ...`)",
            ));
        }
        let first = self.take(|c| c.is_alphanumeric() || c == '_');
        self.skip(blank);
        if self.is('=') {
            self.at += 1;
            self.skip(blank);
            self.name = self.take(|c| c.is_alphanumeric() || c == '_');
            self.variable = first;
        }
        self.pass_over();
        Ok(())
    }

    /// What stands right of `=` up to the end of the statement.
    fn scalar(&mut self) -> Result<String, GridError> {
        self.at += 1;
        let mut text = String::new();
        while let Some(g) = self.peek() {
            if !g.quoted && matches!(g.c, ';' | '\n') {
                break;
            }
            text.push(g.c);
            self.at += 1;
        }
        Ok(text.trim().to_owned())
    }

    /// `= [ ... ]`, and nothing after it.
    fn table(&mut self, target: &str) -> Result<Table, GridError> {
        self.at += 1;
        self.skip(blank);
        let mut table = Table { line: self.line(), rows: Vec::new() };
        if !self.is('[') {
            return Err(syntax(table.line, format!("{target}: expected a table in brackets, [ ... ]")));
        }
        self.at += 1;
        let mut row = Vec::new();
        let mut row_line = table.line;
        loop {
            self.skip(|c| blank(c) || c == ',');
            let Some(glyph) = self.peek() else {
                return Err(syntax(
                    table.line,
                    format!("{target}: the table that begins here has no closing ]"),
                ));
            };
            if !glyph.quoted && matches!(glyph.c, '\n' | ';' | ']') {
                if !row.is_empty() {
                    table.rows.push((row_line, std::mem::take(&mut row)));
                }
                self.at += 1;
                if glyph.c == ']' {
                    break;
                }
                continue;
            }
            if row.is_empty() {
                row_line = glyph.line as usize;
            }
            let word = self.take(|c| !c.is_whitespace() && !matches!(c, ',' | ';' | ']' | '[' | '{' | '('));
            let number = word.parse::<f64>().ok().filter(|_| !word.is_empty()).ok_or_else(|| {
                let found = if word.is_empty() { glyph.c.to_string() } else { word };
                let message =
                    format!("{target}, row {}: found `{found}`, expected a number", table.rows.len() + 1);
                syntax(glyph.line as usize, message)
            })?;
            row.push(number);
        }
        self.skip(blank);
        if self.peek().is_some_and(|g| g.quoted || !matches!(g.c, ';' | ',' | '\n')) {
            return Err(syntax(
                self.line(),
                format!("{target}: the table is computed with; expected `;` after ]"),
            ));
        }
        Ok(table)
    }

    /// Passes to the end of a statement, over whole brackets.
    fn pass_over(&mut self) {
        let mut depth = 0usize;
        while let Some(g) = self.peek() {
            self.at += 1;
            if g.quoted {
                continue;
            }
            match g.c {
                '[' | '{' | '(' => depth += 1,
                ']' | '}' | ')' => depth = depth.saturating_sub(1),
                ';' | '\n' if depth == 0 => return,
                _ => {}
            }
        }
    }
}

fn blank(c: char) -> bool {
    c.is_whitespace() && c != '\n'
}

impl Tables {
    fn into_case(self, name: String) -> Result<Case, GridError> {
        let missing = |what: &str| {
            syntax(
                1,
                format!("no `mpc.{what} = ...` in the file; expected a MATPOWER case, format version 2"),
            )
        };
        let base_mva = self.base_mva.ok_or_else(|| missing("baseMVA"))?;
        let bus = self.bus.ok_or_else(|| missing("bus"))?;
        let generator = self.generator.ok_or_else(|| missing("gen"))?;
        let branch = self.branch.ok_or_else(|| missing("branch"))?;
        let case = Case {
            name,
            base_mva,
            bus: bus.read("bus", 9, read_bus)?,
            generator: generator.read("gen", 8, read_generator)?,
            branch: branch.read("branch", 11, read_branch)?,
        };
        // Names the line of the row that a later check refuses.
        case.validate("").map_err(|error| {
            let GridError::Invalid { path, .. } = &error else { return error };
            let row = path.split_once('[').and_then(|(key, rest)| {
                let index = rest.split_once(']')?.0.parse::<usize>().ok()?;
                let table = match key {
                    "bus" => &bus,
                    "generator" => &generator,
                    _ => &branch,
                };
                table.rows.get(index)
            });
            syntax(row.map_or(bus.line, |row| row.0), error.to_string())
        })?;
        Ok(case)
    }
}

impl Table {
    fn read<T>(
        &self,
        name: &str,
        columns: usize,
        read: fn(&Row<'_>) -> Result<T, GridError>,
    ) -> Result<Vec<T>, GridError> {
        self.rows
            .iter()
            .map(|(line, values)| {
                if values.len() < columns {
                    let message =
                        format!("mpc.{name}: found {} columns, expected at least {columns}", values.len());
                    return Err(syntax(*line, message));
                }
                read(&Row { name, line: *line, values })
            })
            .collect()
    }
}

struct Row<'a> {
    name: &'a str,
    line: usize,
    values: &'a [f64],
}

impl Row<'_> {
    /// Column, counted from 1 as in MATPOWER's manual.
    fn get(&self, column: usize) -> f64 {
        self.values.get(column - 1).copied().unwrap_or(0.0)
    }

    fn limit(&self, column: usize) -> f64 {
        let value = self.get(column);
        if value.is_nan() { 0.0 } else { value.clamp(-1e10, 1e10) }
    }

    fn whole(&self, column: usize, what: &str, most: f64) -> Result<u64, GridError> {
        let value = self.get(column);
        if value.fract() == 0.0 && (0.0..=most).contains(&value) {
            Ok(value as u64)
        } else {
            let message = format!("mpc.{}, column {column}: found {value}, expected {what}", self.name);
            Err(syntax(self.line, message))
        }
    }

    fn id(&self, column: usize) -> Result<u64, GridError> {
        self.whole(column, "a bus number", 9e15)
    }

    fn in_service(&self, column: usize) -> u8 {
        u8::from(self.get(column) > 0.0)
    }
}

fn read_bus(row: &Row<'_>) -> Result<Bus, GridError> {
    Ok(Bus {
        id: row.id(1)?,
        kind: row.whole(2, "a bus type, 1 to 4", 255.0)? as u8,
        pd: row.get(3),
        qd: row.get(4),
        gs: row.get(5),
        bs: row.get(6),
        vm: row.get(8),
        va: row.get(9),
        base_kv: row.get(10),
    })
}

fn read_generator(row: &Row<'_>) -> Result<Generator, GridError> {
    Ok(Generator {
        bus: row.id(1)?,
        pg: row.get(2),
        qg: row.get(3),
        qmax: row.limit(4),
        qmin: row.limit(5),
        vg: row.get(6),
        status: row.in_service(8),
        pmax: row.limit(9),
        pmin: row.limit(10),
    })
}

fn read_branch(row: &Row<'_>) -> Result<Branch, GridError> {
    Ok(Branch {
        from: row.id(1)?,
        to: row.id(2)?,
        r: row.get(3),
        x: row.get(4),
        b: row.get(5),
        ratio: row.get(9),
        shift: row.get(10),
        status: row.in_service(11),
    })
}
