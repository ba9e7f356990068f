//! The text of a MATLAB file without comments and line continuations, each character with its line.
//! Knows nothing of cases.

use super::error::GridError;

/// One character that counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glyph {
    /// The character.
    pub c: char,
    /// Line it stands in, from 1.
    pub line: u32,
    /// Whether it belongs to a quoted text.
    pub quoted: bool,
}

/// Takes out `% ...`, `%{ ... %}` and `... ` continuations; marks quoted text.
pub(super) fn glyphs(text: &str) -> Result<Vec<Glyph>, GridError> {
    let mut out: Vec<Glyph> = Vec::with_capacity(text.len());
    let mut block_comments = 0usize;
    for (index, line_text) in text.trim_start_matches('\u{feff}').split('\n').enumerate() {
        let line = u32::try_from(index + 1).unwrap_or(u32::MAX);
        match line_text.trim() {
            "%{" => {
                block_comments += 1;
                continue;
            }
            "%}" => {
                block_comments = block_comments.saturating_sub(1);
                continue;
            }
            _ if block_comments > 0 => continue,
            _ => {}
        }
        let mut quote: Option<char> = None;
        let mut continued = false;
        let mut rest = line_text.chars();
        while let Some(c) = rest.next() {
            if let Some(end) = quote {
                out.push(Glyph { c, line, quoted: true });
                if c == end {
                    if rest.as_str().starts_with(end) {
                        // A doubled quote is one inside the text.
                        rest.next();
                    } else {
                        quote = None;
                    }
                }
                continue;
            }
            if c == '%' {
                break;
            }
            if c == '.' && rest.as_str().starts_with("..") {
                continued = true;
                break;
            }
            // After a value a ' transposes, elsewhere it opens a text.
            let transposes = c == '\''
                && out.last().is_some_and(|g| {
                    g.line == line && (g.c.is_alphanumeric() || matches!(g.c, ')' | ']' | '}' | '.' | '_'))
                });
            let opens = (c == '\'' && !transposes) || c == '"';
            if opens {
                quote = Some(c);
            }
            out.push(Glyph { c, line, quoted: opens });
        }
        if quote.is_some() {
            let message = "a text in quotes has no end in this line; expected a closing quote".to_owned();
            return Err(GridError::Syntax { line: line as usize, message });
        }
        if !continued {
            out.push(Glyph { c: '\n', line, quoted: false });
        }
    }
    Ok(out)
}
