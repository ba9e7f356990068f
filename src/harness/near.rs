//! "Did you mean ...": names close to a misspelt one.

/// Up to three of `candidates` that are nearest to `name`, nearest first; ties keep their order.
pub fn near_matches<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let bound = name.chars().count() / 3 + 1;
    let mut scored: Vec<(usize, &str)> = candidates
        .map(|candidate| (distance(&name.to_lowercase(), &candidate.to_lowercase()), candidate))
        .filter(|(distance, _)| *distance <= bound)
        .collect();
    scored.sort_by_key(|(distance, _)| *distance);
    scored.truncate(3);
    scored.into_iter().map(|(_, candidate)| candidate).collect()
}

/// The near matches as the end of an error message: `; near: "a", "b"`, or nothing.
pub(super) fn hint<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> String {
    let near = near_matches(name, candidates);
    if near.is_empty() { String::new() } else { format!("; did you mean {}?", near.join(", ")) }
}

/// Levenshtein distance: insertions, deletions and replacements that turn one into the other.
fn distance(left: &str, right: &str) -> usize {
    let right: Vec<char> = right.chars().collect();
    let mut row: Vec<usize> = (0..=right.len()).collect();
    for (i, a) in left.chars().enumerate() {
        let mut diagonal = i;
        let mut before = i + 1;
        for (cell, b) in row.iter_mut().skip(1).zip(&right) {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = *cell;
            *cell = replaced.min(diagonal + 1).min(before + 1);
            before = *cell;
        }
        if let Some(first) = row.first_mut() {
            *first = i + 1;
        }
    }
    row.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_textbook_pairs() {
        for (a, b, expected) in [
            ("kitten", "sitting", 3),
            ("flaw", "lawn", 2),
            ("", "abc", 3),
            ("abc", "", 3),
            ("same", "same", 0),
        ] {
            assert_eq!(distance(a, b), expected, "{a} {b}");
        }
    }

    #[test]
    fn nearest_names_come_first_and_far_ones_not_at_all() {
        let names = ["omega_set[1]", "omega[1]", "V_set[1]", "tie_closed"];
        assert_eq!(near_matches("Omega_set[1]", names.into_iter())[0], "omega_set[1]");
        assert!(near_matches("xyz", names.into_iter()).is_empty());
    }
}
