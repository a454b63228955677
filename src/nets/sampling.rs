//! Drawing a token: temperature and top-p (Holtzman et al. 2020).

use rand::Rng;

use crate::language::maker::Sampling;

/// A token drawn of its logits; at temperature 0 the likeliest one.
pub(super) fn draw(logits: &[f32], sampling: &Sampling, rng: &mut impl Rng) -> usize {
    if sampling.temperature <= 0.0 {
        return likeliest(logits);
    }
    let nucleus = nucleus(logits, sampling);
    let total: f64 = nucleus.iter().map(|(_, weight)| weight).sum();
    let mut left = rng.random_range(0.0..1.0) * total;
    for &(token, weight) in &nucleus {
        left -= weight;
        if left < 0.0 {
            return token;
        }
    }
    nucleus.last().map_or(0, |&(token, _)| token)
}

/// The token of the highest logit; of several the first.
pub(super) fn likeliest(logits: &[f32]) -> usize {
    let better = |best: usize, token: usize| if logits[token] > logits[best] { token } else { best };
    (0..logits.len()).reduce(better).unwrap_or(0)
}

/// The likeliest tokens whose probabilities together reach top-p, with their weights; at least one.
fn nucleus(logits: &[f32], sampling: &Sampling) -> Vec<(usize, f64)> {
    let highest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let weight = |&logit: &f32| (f64::from(logit - highest) / sampling.temperature).exp();
    let mut tokens: Vec<(usize, f64)> = logits.iter().map(weight).enumerate().collect();
    let enough = sampling.top_p * tokens.iter().map(|(_, weight)| weight).sum::<f64>();
    tokens.sort_unstable_by(|(a, weight_a), (b, weight_b)| weight_b.total_cmp(weight_a).then(a.cmp(b)));
    let mut sum = 0.0;
    let last = tokens.iter().position(|(_, weight)| {
        sum += weight;
        sum >= enough
    });
    tokens.truncate(last.map_or(tokens.len(), |last| last + 1));
    tokens
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn sampling(temperature: f64, top_p: f64) -> Sampling {
        Sampling { temperature, top_p, most_tokens: 1 }
    }

    fn shares(logits: &[f32], sampling: Sampling) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut counts = vec![0.0; logits.len()];
        (0..20_000).for_each(|_| counts[draw(logits, &sampling, &mut rng)] += 1.0 / 20_000.0);
        counts
    }

    #[test]
    fn tokens_are_drawn_by_their_probabilities_within_the_nucleus_alone() {
        // Probabilities .5, .3, .15, .05.
        let logits = [0.5f32, 0.3, 0.15, 0.05].map(f32::ln);
        let close = |found: Vec<f64>, wanted: [f64; 4]| {
            assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 0.015), "{found:?} is not {wanted:?}");
        };
        close(shares(&logits, sampling(1.0, 1.0)), [0.5, 0.3, 0.15, 0.05]);
        close(shares(&logits, sampling(1.0, 0.75)), [0.625, 0.375, 0.0, 0.0]);
        close(shares(&logits, sampling(1.0, 0.1)), [1.0, 0.0, 0.0, 0.0]);
        // At temperature 1/2 probabilities are squared: .25, .09, .0225, .0025 of .365.
        close(shares(&logits, sampling(0.5, 1.0)), [0.685, 0.247, 0.062, 0.007]);
    }

    #[test]
    fn at_temperature_zero_the_likeliest_token_is_taken() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        assert_eq!(draw(&[0.1, 3.0, 3.0, -1.0], &sampling(0.0, 0.9), &mut rng), 1);
    }
}
