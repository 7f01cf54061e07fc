//! Line-by-line difference of two texts, with one line of context.

/// Number of unchanged lines shown around a change.
const CONTEXT_LINES: usize = 1;
/// Largest number of lines; the middle ones are left out.
const MAX_LINES: usize = 400;

/// Lines of the difference, each marked with `-`, `+` or a blank. Computed as the longest common subsequence of the lines between the common
/// beginning and end.
pub(crate) fn diff_lines(before: &str, after: &str) -> Vec<(char, String)> {
    let (a, b): (Vec<&str>, Vec<&str>) = (before.lines().collect(), after.lines().collect());
    let first = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
    let most = a.len().min(b.len()) - first;
    let last = a.iter().rev().zip(b.iter().rev()).take(most).take_while(|(a, b)| a == b).count();
    let (old, new) = (&a[first..a.len() - last], &b[first..b.len() - last]);
    let mut out: Vec<(char, String)> = Vec::new();
    let mut add = |sign: char, line: &str| out.push((sign, line.to_string()));
    a[first.saturating_sub(CONTEXT_LINES)..first].iter().for_each(|l| add(' ', l));
    if old.len() > MAX_LINES || new.len() > MAX_LINES {
        add('-', &format!("… {} lines", old.len()));
        add('+', &format!("… {} lines", new.len()));
    } else {
        let width = new.len() + 1;
        let mut common = vec![0u32; (old.len() + 1) * width];
        for i in (0..old.len()).rev() {
            for j in (0..new.len()).rev() {
                common[i * width + j] = match old[i] == new[j] {
                    true => common[(i + 1) * width + j + 1] + 1,
                    false => common[(i + 1) * width + j].max(common[i * width + j + 1]),
                };
            }
        }
        let (mut i, mut j) = (0, 0);
        while i < old.len() || j < new.len() {
            if i < old.len() && j < new.len() && old[i] == new[j] {
                add(' ', old[i]);
                (i, j) = (i + 1, j + 1);
            } else if j >= new.len()
                || (i < old.len() && common[(i + 1) * width + j] >= common[i * width + j + 1])
            {
                add('-', old[i]);
                i += 1;
            } else {
                add('+', new[j]);
                j += 1;
            }
        }
    }
    a[a.len() - last..].iter().take(CONTEXT_LINES).for_each(|l| add(' ', l));
    out
}

#[cfg(test)]
mod tests {
    use super::diff_lines;

    fn diff_text(before: &str, after: &str) -> String {
        diff_lines(before, after).iter().map(|(sign, line)| format!("{sign}{line}|")).collect()
    }

    #[test]
    fn removed_and_added_lines_are_marked() {
        assert_eq!(diff_text("a\nb\nc\nd", "a\nb\nx\nd"), " b|-c|+x| d|");
        assert_eq!(diff_text("a\nb", "a\nn\nb"), " a|+n| b|");
        assert_eq!(diff_text("a\nb\nc\nd\ne", "x\nb\nc\nd\ny"), "-a|+x| b| c| d|-e|+y|");
        assert_eq!(diff_text("same", "same"), " same|");
        assert_eq!(diff_text("", "a"), "+a|");
    }
}
