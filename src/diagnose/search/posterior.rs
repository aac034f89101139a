//! Posterior means over the nodes of a grid, weighted by their evidence.

pub struct Posterior<T> {
    /// Nodes with their weights.
    nodes: Vec<(f64, T)>,
    total: f64,
}

impl<T> Posterior<T> {
    /// `evidence` returns a node's log-likelihood plus log-prior, nats, and the volume it represents.
    /// `None` if no node has any weight.
    pub fn of(nodes: Vec<T>, evidence: impl Fn(&T) -> (f64, f64)) -> Option<Self> {
        let best = nodes.iter().map(|n| evidence(n).0).fold(f64::NEG_INFINITY, f64::max);
        let weigh = |node| {
            let (nats, volume) = evidence(&node);
            (volume * (nats - best).exp(), node)
        };
        let nodes: Vec<(f64, T)> = nodes.into_iter().map(weigh).collect();
        let total: f64 = nodes.iter().map(|n| n.0).sum();
        (total > 0.0).then_some(Posterior { nodes, total })
    }

    pub fn mean(&self, of: impl Fn(&T) -> f64) -> f64 {
        self.nodes.iter().map(|(weight, n)| weight * of(n)).sum::<f64>() / self.total
    }

    /// Root mean square.
    pub fn rms(&self, of: impl Fn(&T) -> f64) -> f64 {
        self.mean(|n| of(n).powi(2)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian of standard deviation 2 about 5, on nodes four times as dense on one side.
    #[test]
    fn a_gaussian_comes_back_whatever_the_grid() {
        let dense = (0..4000).map(|k| (-15.0 + k as f64 * 0.005, 0.005));
        let sparse = (0..1000).map(|k| (5.0 + k as f64 * 0.02, 0.02));
        let evidence = |&(x, volume): &(f64, f64)| (-0.125 * (x - 5.0f64).powi(2) - 700.0, volume);
        let posterior = Posterior::of(dense.chain(sparse).collect(), evidence).unwrap();
        let mean = posterior.mean(|n| n.0);
        assert!((mean - 5.0).abs() < 0.01, "{mean}");
        let rms = posterior.rms(|n| n.0 - 5.0);
        assert!((rms - 2.0).abs() < 0.01, "{rms}");
        assert!(Posterior::of(Vec::new(), evidence).is_none());
    }
}
