//! Lines that fit into a terminal.

/// Breaks text between words so that no line has more columns; lines after the first begin with `indent`. A word that is
/// longer than a line is broken where the line ends. Ends with a line's end.
pub(crate) fn wrapped(text: &str, columns: usize, indent: &str) -> String {
    let head: String = text.chars().take_while(|c| *c == ' ').collect();
    let (mut lines, mut line) = (Vec::new(), head.clone());
    let mut is_bare = true;
    for word in text.split_whitespace() {
        let mut word = word.to_owned();
        loop {
            let gap = usize::from(!is_bare);
            let left = columns.saturating_sub(line.chars().count() + gap);
            if word.chars().count() <= left {
                if gap == 1 {
                    line.push(' ');
                }
                line += &word;
                is_bare = false;
                break;
            }
            if is_bare {
                // Longer than a line.
                let rest =
                    word.split_off(word.char_indices().nth(left.max(1)).map_or(word.len(), |(at, _)| at));
                line += &word;
                word = rest;
            }
            lines.push(std::mem::replace(&mut line, indent.to_owned()));
            is_bare = true;
        }
    }
    lines.push(line);
    lines.join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::wrapped;

    #[test]
    fn lines_keep_the_columns_and_lose_no_word() {
        let text = "  a claim with äöü and averyveryverylongwordthatnobodycouldbreak at its end";
        for columns in 8..40 {
            let lines = wrapped(text, columns, "    ");
            assert!(lines.lines().all(|l| l.chars().count() <= columns), "{columns}: {lines}");
            let [a, b] = [text, lines.as_str()].map(|t| t.split_whitespace().collect::<String>());
            assert_eq!(a, b, "{columns}");
        }
        assert_eq!(wrapped("short", 120, ""), "short\n");
    }
}
