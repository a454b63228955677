//! Confidence intervals, as pure functions.

use rand::Rng;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The 0.975 quantile of the standard normal distribution: 95 % lie within.
const Z: f64 = 1.959_963_984_540_054;
/// How often [`bootstrap_mean`] resamples.
pub(crate) const RESAMPLES: usize = 10_000;

/// An interval, lower end first.
pub(crate) type Interval = [f64; 2];

/// Wilson's 95 % score interval of a rate; everything is possible when nothing was tried.
pub(crate) fn wilson(successes: usize, trials: usize) -> Interval {
    score(successes as f64 / trials.max(1) as f64, trials as f64)
}

/// Wilson's interval of the rate of successes (1, else 0) in whole groups. Episodes of one task (different seeds) are alike, so
/// they count for as many as are as informative, had they been drawn independently: the rate's variance between tasks says how
/// many. That is no fewer than there are tasks and no more than there are episodes (Dean and Pagano, 2015, with a bound).
pub(crate) fn wilson_of_groups(groups: &[Vec<f64>]) -> Interval {
    let sums: Vec<(f64, f64)> =
        groups.iter().filter(|group| !group.is_empty()).map(|group| (group.iter().sum(), group.len() as f64)).collect();
    let (tasks, trials) = (sums.len() as f64, sums.iter().map(|(_, count)| count).sum::<f64>());
    let rate = sums.iter().map(|(successes, _)| successes).sum::<f64>() / trials.max(1.0);
    let spread: f64 = sums.iter().map(|(successes, count)| (successes - rate * count).powi(2)).sum();
    // What one drawn episode varies, in units of the rate's own variance.
    let effective = rate * (1.0 - rate) * trials * trials * (tasks - 1.0) / (tasks * spread);
    // Where all are alike, or there is one task only, nothing is known of how alike its episodes are.
    let effective = if effective.is_nan() { tasks } else { effective.clamp(tasks, trials) };
    score(rate, effective)
}

/// Wilson's interval of a rate over `n` trials.
fn score(rate: f64, n: f64) -> Interval {
    if n <= 0.0 {
        return [0.0, 1.0];
    }
    let spread = Z * (rate * (1.0 - rate) / n + Z * Z / (4.0 * n * n)).sqrt();
    let (middle, scale) = (rate + Z * Z / (2.0 * n), 1.0 + Z * Z / n);
    // At the edges the formula gives 0 and 1 but for rounding.
    let low = if rate <= 0.0 { 0.0 } else { (middle - spread) / scale };
    let high = if rate >= 1.0 { 1.0 } else { (middle + spread) / scale };
    [low, high]
}

/// The mean of all values; 0 when there are none.
pub(crate) fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0usize), |(sum, count), value| (sum + value, count + 1));
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// A 95 % percentile bootstrap interval of the mean of all values, resampling whole groups: episodes of one task (different
/// seeds) are alike, so the tasks are what varies. Both ends are 0 when there is nothing.
pub(crate) fn bootstrap_mean(groups: &[Vec<f64>], seed: u64) -> Interval {
    let sums: Vec<(f64, usize)> =
        groups.iter().filter(|group| !group.is_empty()).map(|group| (group.iter().sum(), group.len())).collect();
    if sums.is_empty() {
        return [0.0, 0.0];
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut means: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn = (0..sums.len()).map(|_| sums[rng.random_range(0..sums.len())]);
            let (sum, count) = drawn.fold((0.0, 0), |(sum, count), (s, c)| (sum + s, count + c));
            sum / count as f64
        })
        .collect();
    means.sort_by(f64::total_cmp);
    [quantile(&means, 0.025), quantile(&means, 0.975)]
}

/// [`bootstrap_mean`] of values within `bounds`. Where it has no width, as of one task or of values that are all alike, it says
/// nothing of what was not seen: then as many tasks as Wilson's interval allows, of none among so many, may lie anywhere within
/// the bounds. For a rate of 0 or 1 that is Wilson's interval; of nothing, it is the bounds.
pub(crate) fn bounded_mean(groups: &[Vec<f64>], bounds: Interval, seed: u64) -> Interval {
    let [low, high] = bootstrap_mean(groups, seed);
    if high - low > 1e-9 {
        return [low, high];
    }
    let tasks = groups.iter().filter(|group| !group.is_empty()).count();
    let mean = mean(groups.iter().flatten().copied());
    let [_, unseen] = wilson(0, tasks);
    [mean - unseen * (mean - bounds[0]).max(0.0), mean + unseen * (bounds[1] - mean).max(0.0)]
}

/// McNemar's exact test, two-sided: how likely so uneven a split of the pairs that differ is when neither side is better.
pub(crate) fn mcnemar(only_first: usize, only_second: usize) -> f64 {
    let (n, fewer) = (only_first + only_second, only_first.min(only_second));
    // The binomial distribution's terms in logarithms: 2^-n underflows for large n.
    let mut log_term = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for k in 0..=fewer {
        tail += log_term.exp();
        log_term += ((n - k) as f64).ln() - ((k + 1) as f64).ln();
    }
    (2.0 * tail).min(1.0)
}

/// A quantile of sorted values, interpolated between neighbours.
fn quantile(sorted: &[f64], q: f64) -> f64 {
    let at = q * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    below + (above - below) * at.fract()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Interval, b: Interval, by: f64) -> bool {
        (a[0] - b[0]).abs() <= by && (a[1] - b[1]).abs() <= by
    }

    #[test]
    fn wilsons_interval_has_the_published_values() {
        // Newcombe 1998, table I, method 3: 81/263, 15/148, 0/20, 1/29.
        assert!(close(wilson(81, 263), [0.2553, 0.3662], 5e-5), "{:?}", wilson(81, 263));
        assert!(close(wilson(15, 148), [0.0624, 0.1605], 5e-5), "{:?}", wilson(15, 148));
        assert!(close(wilson(0, 20), [0.0, 0.1611], 5e-5), "{:?}", wilson(0, 20));
        assert!(close(wilson(1, 29), [0.0061, 0.1718], 5e-5), "{:?}", wilson(1, 29));
    }

    #[test]
    fn wilsons_interval_is_symmetric_and_holds_the_rate() {
        for n in 1..60 {
            for k in 0..=n {
                let [low, high] = wilson(k, n);
                let [other_low, other_high] = wilson(n - k, n);
                assert!((low - (1.0 - other_high)).abs() < 1e-12 && (high - (1.0 - other_low)).abs() < 1e-12);
                assert!(0.0 <= low && low <= k as f64 / n as f64 && k as f64 / n as f64 <= high && high <= 1.0);
            }
        }
        assert_eq!(wilson(0, 0), [0.0, 1.0]);
    }

    #[test]
    fn seeds_that_always_agree_say_no_more_than_one_does() {
        let of = |seeds: usize| (0..40).map(|task| vec![f64::from(task % 4 / 3); seeds]).collect::<Vec<_>>();
        assert_eq!(wilson_of_groups(&of(1)), wilson(10, 40));
        assert_eq!(wilson_of_groups(&of(5)), wilson(10, 40));
        for rate in [0.0, 1.0] {
            let alike = vec![vec![rate; 7]; 12];
            assert_eq!(wilson_of_groups(&alike), wilson(12 * rate as usize, 12), "all alike: no more than the tasks");
        }
        assert_eq!(wilson_of_groups(&[vec![1.0, 0.0, 1.0]]).map(|end| end > 0.0), [true, true]);
        assert_eq!(wilson_of_groups(&[]), [0.0, 1.0]);
    }

    #[test]
    fn seeds_that_are_independent_count_in_full() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let groups: Vec<Vec<f64>> =
            (0..400).map(|_| (0..5).map(|_| f64::from(u8::from(rng.random_bool(0.3)))).collect()).collect();
        let successes = groups.iter().flatten().sum::<f64>() as usize;
        assert!(close(wilson_of_groups(&groups), wilson(successes, 2000), 0.003), "{:?}", wilson_of_groups(&groups));
        let mixed: Vec<Vec<f64>> =
            groups.iter().enumerate().map(|(i, g)| if i % 2 == 0 { g.clone() } else { vec![g[0]; 5] }).collect();
        let successes = mixed.iter().flatten().sum::<f64>() as usize;
        let (width, naive) = (wilson_of_groups(&mixed), wilson(successes, 2000));
        assert!(width[1] - width[0] > 1.3 * (naive[1] - naive[0]), "{width:?} {naive:?}");
    }

    #[test]
    fn the_bootstrap_of_equal_values_is_that_value() {
        assert_eq!(bootstrap_mean(&[vec![2.5], vec![2.5], vec![2.5, 2.5]], 1), [2.5, 2.5]);
        assert_eq!(bootstrap_mean(&[], 1), [0.0, 0.0]);
    }

    #[test]
    fn an_interval_of_one_task_or_of_values_that_are_all_alike_has_a_width() {
        let bounded = |groups: &[Vec<f64>], bounds| bounded_mean(groups, bounds, 1);
        for tasks in [1, 2, 20, 500] {
            for rate in [0.0, 1.0] {
                let found = bounded(&vec![vec![rate]; tasks], [0.0, 1.0]);
                assert!(close(found, wilson(tasks * rate as usize, tasks), 1e-12), "{found:?}");
            }
            let [low, high] = bounded(&vec![vec![0.0]; tasks], [-1.0, 1.0]);
            assert!(low < 0.0 && (low + high).abs() < 1e-12, "{low} {high}");
        }
        let [low, high] = bounded(&[vec![2.0, 1.0, 3.0]], [0.0, 4.0]);
        assert!(low < 1.0 && high > 3.0, "the seeds of one task say nothing of others: {low} {high}");
        assert_eq!(bounded(&[], [0.0, 3.0]), [0.0, 3.0]);
        let many: Vec<_> = (0..40).map(|i| vec![f64::from(i % 2)]).collect();
        assert_eq!(bounded(&many, [0.0, 1.0]), bootstrap_mean(&many, 1));
    }

    #[test]
    fn the_bootstrap_of_many_values_is_the_normal_interval() {
        // 0 and 1 in equal parts: standard deviation 0.5, so the mean of 400 has 0.5 +- 1.96 * 0.025.
        let groups: Vec<_> = (0..400).map(|i| vec![f64::from(i % 2)]).collect();
        assert!(close(bootstrap_mean(&groups, 0), [0.451, 0.549], 0.004), "{:?}", bootstrap_mean(&groups, 0));
    }

    #[test]
    fn the_bootstrap_resamples_tasks_not_episodes() {
        // Three seeds that always agree say nothing more than one does.
        let single: Vec<_> = (0..40).map(|i| vec![f64::from(i % 2)]).collect();
        let triple: Vec<_> = (0..40).map(|i| vec![f64::from(i % 2); 3]).collect();
        assert!(close(bootstrap_mean(&single, 7), bootstrap_mean(&triple, 7), 1e-12));
    }

    #[test]
    fn mcnemars_test_has_the_binomial_values() {
        // Twice the binomial tail at one half: 2 * (1 + 10) / 1024, 2 / 32, and certainty for an even split.
        assert!((mcnemar(1, 9) - 22.0 / 1024.0).abs() < 1e-12);
        assert!((mcnemar(5, 0) - 2.0 / 32.0).abs() < 1e-12);
        assert_eq!(mcnemar(3, 3), 1.0);
        assert_eq!(mcnemar(0, 0), 1.0);
        assert!(mcnemar(1000, 1200) < 1e-4 && mcnemar(1000, 1200) > 1e-6);
    }

    #[test]
    fn the_bootstrap_depends_on_its_seed_alone() {
        let groups: Vec<_> = (1..50).map(|i| vec![f64::from(i).sqrt()]).collect();
        assert_eq!(bootstrap_mean(&groups, 3), bootstrap_mean(&groups, 3));
        assert_ne!(bootstrap_mean(&groups, 3), bootstrap_mean(&groups, 4));
    }
}
