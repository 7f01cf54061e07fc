//! "Did you mean": the closest of the known names.

/// Number of single-letter insertions, removals, replacements and swaps of neighbors that turn `a` into `b`
/// (optimal string alignment distance), ignoring ASCII case.
///
/// ```
/// use choreo_plugin::suggest::distance;
/// assert_eq!((distance("wlak", "walk"), distance("Walk", "walks")), (1, 1));
/// ```
pub fn distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.chars().map(|c| c.to_ascii_lowercase()).collect();
    let b: Vec<char> = b.chars().map(|c| c.to_ascii_lowercase()).collect();
    let mut two_back = vec![0; b.len() + 1];
    let mut back: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replace = back[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replace.min(back[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(two_back[j - 2] + 1);
            }
        }
        two_back = back;
        back = row;
    }
    back[b.len()]
}

/// The known name closest to `wanted`, if it can be a typing mistake: at most a third of the letters differ, or one name is part of the
/// other. Of equally close names, the first.
///
/// ```
/// use choreo_plugin::suggest::closest;
/// assert_eq!((closest("rnu", ["walk", "run"]), closest("fly", ["walk", "run"])), (Some("run"), None));
/// ```
pub fn closest<'a>(wanted: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Longer names are not typed by hand, and the cost of the distance is the product of both lengths.
    const MAX_NAME_BYTES: usize = 128;
    if wanted.is_empty() || wanted.len() > MAX_NAME_BYTES {
        return None;
    }
    let lower = wanted.to_ascii_lowercase();
    let mut best: Option<(usize, &str)> = None;
    for name in known {
        if name.is_empty() || name.len() > MAX_NAME_BYTES {
            continue;
        }
        let mut d = distance(wanted, name);
        let limit = wanted.chars().count().max(name.chars().count()) / 3;
        let other = name.to_ascii_lowercase();
        let inside =
            lower.len() >= 3 && other.len() >= 3 && (other.contains(&lower) || lower.contains(&other));
        if inside {
            d = d.min(limit);
        }
        if d <= limit && best.is_none_or(|(b, _)| d < b) {
            best = Some((d, name));
        }
    }
    best.map(|(_, name)| name)
}

/// `; did you mean "walk"?`, or nothing.
///
/// ```
/// assert_eq!(choreo_plugin::suggest::did_you_mean("rnu", ["walk", "run"]), "; did you mean \"run\"?");
/// ```
pub fn did_you_mean<'a>(wanted: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    closest(wanted, known).map_or_else(String::new, |name| format!("; did you mean \"{name}\"?"))
}

/// Lists at most `most` names with commas between them, then says how many more there are.
///
/// ```
/// assert_eq!(choreo_plugin::suggest::list(["a", "b", "c", "d"], 2), "a, b, and 2 more");
/// ```
pub fn list<'a>(names: impl IntoIterator<Item = &'a str>, most: usize) -> String {
    let all: Vec<&str> = names.into_iter().collect();
    let mut text = all.iter().take(most).copied().collect::<Vec<_>>().join(", ");
    if all.len() > most {
        text.push_str(&format!(", and {} more", all.len() - most));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_definition() {
        assert_eq!(distance("walk", "walk"), 0);
        assert_eq!(distance("", "walk"), 4);
        assert_eq!(distance("wlak", "walk"), 1);
        assert_eq!(distance("LeftHnd", "lefthand"), 1);
        assert_eq!(distance("kitten", "sitting"), 3);
    }

    #[test]
    fn only_close_names_are_suggested() {
        let known = ["Walking_A", "Running_A", "Idle"];
        assert_eq!(closest("Walkng_A", known), Some("Walking_A"));
        assert_eq!(closest("walking", known), Some("Walking_A"));
        assert_eq!(closest("Dance", known), None);
        assert_eq!(closest("", known), None);
        assert_eq!(closest("x", ["f"]), None);
    }
}
