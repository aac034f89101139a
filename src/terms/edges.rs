//! How far pixels are from the edge of the target.

/// Steps of the 3-4 chamfer (Borgefors 1986), px: straight, and across a corner.
const STRAIGHT: f32 = 1.0;
const ACROSS: f32 = 4.0 / 3.0;

/// Distance of each pixel of the target to the nearest that is not the target's, px; zero off the
/// target. The picture's border is no edge.
pub fn edge_distances(on_target: &[bool], width: usize) -> Vec<f32> {
    let height = on_target.len() / width.max(1);
    let far = (width + height) as f32;
    let mut distance: Vec<f32> = on_target.iter().map(|&on| if on { far } else { 0.0 }).collect();
    let mut relax = |i: usize, neighbours: [(bool, usize, f32); 4]| {
        let reached = neighbours.into_iter().filter(|(inside, ..)| *inside);
        let best = reached.map(|(_, j, step)| distance[j] + step).fold(far, f32::min);
        distance[i] = distance[i].min(best);
    };
    let at = |i: usize| (i % width, i / width);
    for i in 0..on_target.len() {
        let (u, v) = at(i);
        let (left, up, right) = (u > 0, v > 0, u + 1 < width);
        relax(
            i,
            [
                (left, i.wrapping_sub(1), STRAIGHT),
                (up, i.wrapping_sub(width), STRAIGHT),
                (left && up, i.wrapping_sub(width + 1), ACROSS),
                (right && up, i.wrapping_sub(width).wrapping_add(1), ACROSS),
            ],
        );
    }
    for i in (0..on_target.len()).rev() {
        let (u, v) = at(i);
        let (left, down, right) = (u > 0, v + 1 < height, u + 1 < width);
        relax(
            i,
            [
                (right, i + 1, STRAIGHT),
                (down, i + width, STRAIGHT),
                (right && down, i + width + 1, ACROSS),
                (left && down, (i + width).wrapping_sub(1), ACROSS),
            ],
        );
    }
    distance
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
