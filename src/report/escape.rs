//! Foreign text made harmless, once for HTML and once for JSON inside a script element.

/// Escapes text for HTML content and attributes. Plotly's labels obey a little HTML of their own and
/// know these same entities, so the result serves there too.
pub(super) fn html(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            // Numeric, because Plotly does not know `&quot;`.
            '"' => escaped.push_str("&#34;"),
            '\'' => escaped.push_str("&#39;"),
            _ => escaped.push(c),
        }
    }
    escaped
}

/// Makes JSON safe inside `<script>`: the HTML parser must meet neither `</script` nor `<!--`. These
/// characters occur in JSON only within strings, where the escape means the same character.
pub(super) fn json_in_script(json: &str) -> String {
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

/// A label of at most `max_chars` characters, made harmless; what is cut off is marked.
pub(super) fn short_label(text: &str, max_chars: usize) -> String {
    if text.chars().count() <= max_chars {
        return html(text);
    }
    let mut short: String = text.chars().take(max_chars.saturating_sub(1)).collect();
    short.push('\u{2026}');
    html(&short)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Decodes the five entities, the way a browser does.
    fn decode(text: &str) -> String {
        text.replace("&lt;", "<")
            .replace("&gt;", ">")
            .replace("&#34;", "\"")
            .replace("&#39;", "'")
            .replace("&amp;", "&")
    }

    proptest! {
        #[test]
        fn html_leaves_no_markup_and_loses_nothing(text in any::<String>()) {
            let escaped = html(&text);
            prop_assert!(!escaped.contains(['<', '>', '"', '\'']));
            prop_assert_eq!(decode(&escaped), text);
        }

        #[test]
        fn json_in_script_means_the_same(text in any::<String>()) {
            let json = serde_json::to_string(&text).unwrap();
            let safe = json_in_script(&json);
            prop_assert!(!safe.contains(['<', '>', '&']));
            prop_assert_eq!(serde_json::from_str::<String>(&safe).unwrap(), text);
        }
    }

    #[test]
    fn a_label_is_cut_before_it_is_escaped() {
        assert_eq!(short_label("<<<<", 3), "&lt;&lt;\u{2026}");
        assert_eq!(short_label("abc", 3), "abc");
    }
}
