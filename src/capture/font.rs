//! Big letters, for who stands away from the screen: five rows of blocks.

/// Rows of a letter.
pub const ROWS: usize = 5;

#[rustfmt::skip]
const GLYPHS: [(char, [&str; ROWS]); 41] = [
    ('0', ["###", "# #", "# #", "# #", "###"]), ('1', [" # ", "## ", " # ", " # ", "###"]),
    ('2', ["###", "  #", "###", "#  ", "###"]), ('3', ["###", "  #", "###", "  #", "###"]),
    ('4', ["# #", "# #", "###", "  #", "  #"]), ('5', ["###", "#  ", "###", "  #", "###"]),
    ('6', ["###", "#  ", "###", "# #", "###"]), ('7', ["###", "  #", " # ", " # ", " # "]),
    ('8', ["###", "# #", "###", "# #", "###"]), ('9', ["###", "# #", "###", "  #", "###"]),
    ('A', ["###", "# #", "###", "# #", "# #"]), ('B', ["## ", "# #", "## ", "# #", "## "]),
    ('C', ["###", "#  ", "#  ", "#  ", "###"]), ('D', ["## ", "# #", "# #", "# #", "## "]),
    ('E', ["###", "#  ", "###", "#  ", "###"]), ('F', ["###", "#  ", "###", "#  ", "#  "]),
    ('G', ["####", "#   ", "# ##", "#  #", "####"]), ('H', ["# #", "# #", "###", "# #", "# #"]),
    ('I', ["###", " # ", " # ", " # ", "###"]), ('J', ["  #", "  #", "  #", "# #", "###"]),
    ('K', ["# #", "# #", "## ", "# #", "# #"]), ('L', ["#  ", "#  ", "#  ", "#  ", "###"]),
    ('M', ["#   #", "## ##", "# # #", "#   #", "#   #"]), ('N', ["#  #", "## #", "# ##", "#  #", "#  #"]),
    ('O', ["###", "# #", "# #", "# #", "###"]), ('P', ["###", "# #", "###", "#  ", "#  "]),
    ('Q', ["###", "# #", "# #", "###", "  #"]), ('R', ["## ", "# #", "## ", "# #", "# #"]),
    ('S', ["###", "#  ", "###", "  #", "###"]), ('T', ["###", " # ", " # ", " # ", " # "]),
    ('U', ["# #", "# #", "# #", "# #", "###"]), ('V', ["# #", "# #", "# #", "# #", " # "]),
    ('W', ["#   #", "#   #", "# # #", "## ##", "#   #"]), ('X', ["# #", "# #", " # ", "# #", "# #"]),
    ('Y', ["# #", "# #", " # ", " # ", " # "]), ('Z', ["###", "  #", " # ", "#  ", "###"]),
    ('.', [" ", " ", " ", " ", "#"]), ('-', ["   ", "   ", "###", "   ", "   "]),
    ('+', ["   ", " # ", "###", " # ", "   "]), ('°', ["##", "##", "  ", "  ", "  "]),
    (' ', ["  ", "  ", "  ", "  ", "  "]),
];

/// The text in blocks, as wide as fits into `columns`: a dot of a letter is two columns, or one.
/// Letters that are not in the font are left out.
pub fn big(text: &str, columns: usize) -> [String; ROWS] {
    let letters: Vec<&[&str; ROWS]> = text
        .chars()
        .filter_map(|c| GLYPHS.iter().find(|(g, _)| *g == c).map(|(_, rows)| rows))
        .collect();
    let dots: usize = letters.iter().map(|rows| rows[0].chars().count() + 1).sum();
    let wide = if 2 * dots <= columns { 2 } else { 1 };
    std::array::from_fn(|row| {
        let mut line = String::new();
        for letter in &letters {
            for dot in letter[row].chars().chain([' ']) {
                let block = if dot == '#' { '█' } else { ' ' };
                line.extend(std::iter::repeat_n(block, wide));
            }
        }
        line.trim_end().chars().take(columns).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_has_five_rows_of_one_width() {
        for (letter, rows) in GLYPHS {
            assert!(rows.iter().all(|r| r.len() == rows[0].len()), "{letter}");
        }
    }

    #[test]
    fn narrow_terminals_get_narrow_letters() {
        let widest = |columns| big("BACK 20", columns).map(|l| l.chars().count()).into_iter().max();
        assert!(widest(80).is_some_and(|w| w > 50 && w <= 80));
        assert!(widest(40).is_some_and(|w| w <= 40));
        assert!(widest(10).is_some_and(|w| w <= 10));
    }
}
