//! Distances of pixels from the edge of the target.

/// Steps of the 3-4 chamfer distance (Borgefors 1986), px: straight, and diagonal.
const STRAIGHT: f32 = 1.0;
const ACROSS: f32 = 4.0 / 3.0;

/// Distance of each pixel of the target to the nearest pixel off it, px; zero off the target. The picture's
/// border is no edge.
pub fn edge_distances(on_target: &[bool], width: usize) -> Vec<f32> {
    if on_target.is_empty() {
        return Vec::new();
    }
    let height = on_target.len() / width.max(1);
    let far = (width + height) as f32;
    // Frame the picture in pixels that are far from any edge.
    let across = width + 2;
    let mut framed = vec![far; across * (height + 2)];
    for (line, on) in framed.chunks_exact_mut(across).skip(1).zip(on_target.chunks_exact(width)) {
        let inside = line[1..].iter_mut().zip(on);
        inside.filter(|(_, on)| !**on).for_each(|(d, _)| *d = 0.0);
    }
    for v in 1..=height {
        let (above, line) = framed.split_at_mut(v * across);
        let line = &mut line[..across];
        from_line(&above[(v - 1) * across..], line);
        for u in 1..=width {
            line[u] = line[u].min(line[u - 1] + STRAIGHT);
        }
    }
    for v in (1..=height).rev() {
        let (line, below) = framed.split_at_mut((v + 1) * across);
        let line = &mut line[v * across..];
        from_line(&below[..across], line);
        for u in (1..=width).rev() {
            line[u] = line[u].min(line[u + 1] + STRAIGHT);
        }
    }
    let lines = framed.chunks_exact(across).skip(1).take(height);
    lines.flat_map(|line| &line[1..=width]).copied().collect()
}

/// Lowers a line's distances to what the line before allows, inside the frame.
fn from_line(before: &[f32], line: &mut [f32]) {
    for (d, near) in line[1..].iter_mut().zip(before.windows(3)) {
        let across = near[0].min(near[2]) + ACROSS;
        *d = d.min(near[1] + STRAIGHT).min(across);
    }
}

#[cfg(test)]
mod tests {
    use super::edge_distances;

    /// A 20 px square in the corner of a picture: its outer sides are no edges.
    #[test]
    fn a_corner_square_has_edges_only_where_something_else_is_seen() {
        let (w, h) = (40, 30);
        let on: Vec<bool> = (0..w * h).map(|i| i % w < 20 && i / w < 20).collect();
        let d = edge_distances(&on, w);
        for (u, v) in [(0, 0), (19, 3), (4, 18), (10, 15), (25, 25)] {
            let straight = if u < 20 && v < 20 { (20 - u).min(20 - v) } else { 0 };
            assert!((d[v * w + u] - straight as f32).abs() < 1e-5, "{u} {v}: {}", d[v * w + u]);
        }
        assert_eq!(edge_distances(&[true; 12], 4), [7.0; 12], "no edge in sight");
    }
}
